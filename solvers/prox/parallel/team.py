"""Run one compiled kernel in several threads, including the calling one.

The kernels release the global interpreter lock. The other threads start when they are first needed. After their part of
a call, they wait in compiled code for the next one, because waking a thread takes up to half a millisecond on virtual
cores, as long as ten sweeps. If no call follows within a millisecond, they wait without using a core. No thread
outlives a solve, and no threading library is required. The threads claim tasks one by one (``atomic``), so a thread
that is late or preempted delays the others by at most one task.

Calls are numbered from 1. The state of a thread is 2k between calls k and k + 1, 2k + 1 during call k, and ``AWAY`` if
it takes no further part until it is started again. Only the thread itself begins and ends its part. At the end of a
call, the calling thread waits for threads within the call, and sends away those that have not begun.
"""

import _thread
import sys
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import Any

import numpy as np
from numba import njit

from ....problems.arrays import IntArray
from ...iteration.cores import thread_requirement, usable_cores
from ...iteration.method import check_option
from .atomic import SPINS_BEFORE_YIELD, add, read, swap_if_equal, yield_core

AWAY = -1
"""State of a thread that does not wait for calls."""

YIELDS_BEFORE_LEAVING = 2000
"""Number of times that a waiting thread yields its core, about a millisecond in all, before it leaves."""


def check_threads(threads: int) -> None:
    """Raise ``SolverError`` unless ``threads`` is from 1 to the number of cores that this process may use."""
    cores = usable_cores()
    is_valid = type(threads) is int and 1 <= threads <= cores
    check_option("threads", threads, is_valid, thread_requirement(cores))


class _Member:
    """A thread that runs functions one by one.

    Attributes:
        is_idle: whether the last function has ended.
    """

    def __init__(self) -> None:
        self.is_idle = True
        self._functions: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._ended = _thread.allocate_lock()
        self._ended.acquire()
        _thread.start_new_thread(self._run, ())

    def begin(self, function: Callable[[], Any]) -> None:
        """Run ``function`` in the thread, which must be idle."""
        self.is_idle = False
        self._functions.put(function)

    def end(self) -> None:
        """End the thread after its last function, and wait for its end."""
        self._functions.put(None)
        self._ended.acquire()

    def _run(self) -> None:
        try:
            while (function := self._functions.get()) is not None:
                try:
                    function()
                finally:
                    self.is_idle = True
        finally:
            self._ended.release()


class Team:
    """Threads that run ``kernel(number, threads, calls, states, *arguments)`` together; they end when it is deleted.

    The kernel does its part of one call in the calling thread, which has number 0. In the others, it does so for as
    long as ``joins_call`` returns True, and calls ``leave_call`` after each part.
    """

    def __init__(self, threads: int, kernel: Callable[..., Any], *arguments: Any) -> None:
        self._calls, self._states = np.zeros(1, dtype=np.int64), np.full(threads, AWAY, dtype=np.int64)
        self._members: list[_Member] = []
        self._errors: list[BaseException] = []
        self._kernel = kernel
        self._arguments = threads, self._calls, self._states, *arguments

    def start(self) -> None:
        """Let the other threads wait for calls, as far as they do not; ``run`` does this, too.

        Until a thread has started, which takes a tenth of a millisecond, the caller can do other work.
        """
        while len(self._members) < len(self._states) - 1:
            self._members.append(_Member())
        for number, member in enumerate(self._members, start=1):
            if self._states[number] == AWAY and member.is_idle:
                self._states[number] = 2 * self._calls[0]
                part = partial(_take_part, number, self._states, self._errors, self._kernel, *self._arguments)
                member.begin(part)

    def run(self) -> Any:
        """Run the kernel in each thread, and return the result of thread 0.

        Raise the error of the calling thread, or else one of the other threads.
        """
        if len(self._states) == 1:
            return self._kernel(0, *self._arguments)
        self.start()
        _begin_call(self._calls)
        try:
            result = self._kernel(0, *self._arguments)
        finally:
            _end_call(self._calls, self._states)
        if self._errors:
            raise self._errors.pop()
        return result

    def __del__(self, is_finalizing: Callable[[], bool] = sys.is_finalizing) -> None:
        if is_finalizing():  # the process ends its threads, which cannot return to Python any more
            return
        if self._members:
            _send_away(self._states)
        for member in self._members:
            member.end()


def _take_part(
    number: int, states: IntArray, errors: list[BaseException], kernel: Callable[..., Any], *arguments: Any
) -> None:
    """Run the kernel in a thread until it leaves.

    The thread holds no reference to the team, because deleting the team ends the thread.
    """
    try:
        kernel(number, *arguments)
    except BaseException as error:  # the calling thread raises it
        errors.append(error)
    finally:
        states[number] = AWAY


@njit(cache=True, nogil=True)
def joins_call(calls, states, thread):  # type: ignore[no-untyped-def]
    """Wait for the next call and return True, or return False if the thread is to leave the kernel."""
    state, spins = read(states, thread), 0
    while spins < SPINS_BEFORE_YIELD + YIELDS_BEFORE_LEAVING:
        if state == AWAY or read(states, thread) != state:
            return False
        if 2 * read(calls, 0) > state:
            return swap_if_equal(states, thread, state, state + 3)
        spins += 1
        if spins > SPINS_BEFORE_YIELD:
            yield_core()
    swap_if_equal(states, thread, state, AWAY)
    return False


@njit(cache=True, nogil=True)
def leave_call(states, thread):  # type: ignore[no-untyped-def]
    """End the part of a thread in a call."""
    add(states, thread, -1)


@njit(cache=True, nogil=True)
def _begin_call(calls):  # type: ignore[no-untyped-def]
    add(calls, 0, 1)


@njit(cache=True, nogil=True)
def _end_call(calls, states):  # type: ignore[no-untyped-def]
    """Wait until no thread is in the call, and send away threads that have not begun their part."""
    active_state = 2 * calls[0] + 1
    for thread in range(1, len(states)):
        state, spins = read(states, thread), 0
        while state != active_state - 1 and state != AWAY:
            if state != active_state:
                swap_if_equal(states, thread, state, AWAY)
            spins += 1
            if spins > SPINS_BEFORE_YIELD:
                yield_core()
            state = read(states, thread)


@njit(cache=True, nogil=True)
def _send_away(states):  # type: ignore[no-untyped-def]
    """Send all threads away, none of which is in a call."""
    for thread in range(1, len(states)):
        state = read(states, thread)
        while state != AWAY and not swap_if_equal(states, thread, state, AWAY):
            state = read(states, thread)
