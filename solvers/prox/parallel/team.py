"""Run one compiled kernel in several threads, including the calling one.

The kernels release the global interpreter lock. The other threads start when they are first needed, wait without using
a core, and end with the team. No thread outlives a solve, and no threading library is required. The threads claim tasks
one by one (``atomic``), so a thread that is late or preempted delays the others by at most one task.
"""

import _thread
from collections.abc import Callable
from functools import partial
from typing import Any

from ...iteration.cores import thread_requirement, usable_cores
from ...iteration.method import check_option


def check_threads(threads: int) -> None:
    """Raise ``SolverError`` unless ``threads`` is from 1 to the number of cores that this process may use."""
    cores = usable_cores()
    is_valid = type(threads) is int and 1 <= threads <= cores
    check_option("threads", threads, is_valid, thread_requirement(cores))


class _Member:
    """A thread that runs calls one by one, until a call is None."""

    def __init__(self) -> None:
        self.call: Callable[[], Any] | None = None
        self.error: BaseException | None = None
        self._begin, self._end = _thread.allocate_lock(), _thread.allocate_lock()
        self._begin.acquire()
        self._end.acquire()
        _thread.start_new_thread(self._run, ())

    def begin(self, call: Callable[[], Any] | None) -> None:
        """Run ``call`` in the thread, or end the thread if ``call`` is None."""
        self.call = call
        self._begin.release()

    def wait(self) -> None:
        """Wait until the call is done, or the thread has ended."""
        self._end.acquire()

    def _run(self) -> None:
        while True:
            self._begin.acquire()
            call, self.call, self.error = self.call, None, None
            try:
                if call is None:
                    return
                call()
            except BaseException as error:  # the calling thread raises it
                self.error = error
            finally:
                self._end.release()


class Team:
    """Threads that run a kernel together. They end when the team is deleted."""

    def __init__(self) -> None:
        self._members: list[_Member] = []

    def run(self, threads: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Run ``kernel(number, threads, *arguments)`` in each thread, and return the result of thread 0.

        Wait for all threads, and raise the error of the calling thread, or else the first one of the other threads.
        """
        while len(self._members) < threads - 1:
            self._members.append(_Member())
        helpers = self._members[: threads - 1]
        for number, member in enumerate(helpers, start=1):
            member.begin(partial(kernel, number, threads, *arguments))
        try:
            result = kernel(0, threads, *arguments)
        finally:
            for member in helpers:
                member.wait()
        for member in helpers:
            if member.error is not None:
                raise member.error
        return result

    def __del__(self) -> None:
        for member in self._members:
            member.begin(None)
            member.wait()
