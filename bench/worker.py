"""Child processes that cases run in, and the conversation with them.

Cases are forked from a server that has everything loaded (``preload``), each under a keeper that ends all it has
started, also when this process is gone (``keeper``). What a case sends back is JSON and raw numbers, never objects
that could run code here, and is waited for no longer than the case's time (``messages``).
"""

import contextlib
import os
import pickle
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..problems.laws import FloatArray
from ..problems.plugins import registered
from .case_process import Assignment
from .descendants import send, writers
from .errors import BenchError
from .keeper import END, GO_ON, STOP, keep
from .messages import NoMessageError, read_message, read_object
from .outcome import FAULTS, Outcome
from .shared_file import SharedFile

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB_MAXIMUM", "RAYON")}
"""Environment that pins every numerical library to one thread."""

LARGEST_ANSWER = 2**24
"""Bytes that the JSON of an answer may have."""

LARGEST_NUMBERS = 2**32
"""Bytes that the array of an answer may have."""

SHOWN_OUTPUT = 4000
"""Bytes of captured output that are kept with a failed case."""

END_SECONDS = 5.0
"""Wall time that a keeper has to end its case."""


@dataclass
class Fault(Exception):  # noqa: N818 - the case is at fault, this is how that is told
    """A case that ended otherwise than by an answer."""

    outcome: Outcome
    reason: str
    traceback: str = ""


class Task(Protocol):
    """What a process does: answer requests. It is pickled on its way there, and plugin files are known to it."""

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Return a JSON object, and the bytes of an array of float64, which may be empty."""
        ...


class Worker:
    """One case's process, seen from outside. Between requests it is stopped, with all its threads.

    Attributes:
        busy_seconds: wall time that the case has used so far [s].

    Raises:
        Fault: if the task cannot be pickled, or no process can be started.
        BenchError: if there is no room for temporary files.
    """

    def __init__(self, task: Task, case_seconds: float, memory_bytes: int, with_main: bool = False) -> None:
        """Start the process.

        Args:
            task: what it does.
            case_seconds: limit of the wall time of all requests together [s].
            memory_bytes: memory it may take beyond what the framework itself needs.
            with_main: whether the task needs the caller's main script, which is then run again in the process.
        """
        try:
            pickled = pickle.dumps(task)
        except Exception as error:
            reason = f"it cannot be sent to the process of its case: {error}"
            raise Fault(Outcome.MISBEHAVED, reason, traceback.format_exc()) from None
        self.busy_seconds = 0.0
        self.peak_memory_bytes = 0
        self._is_stopped = False
        self._case_seconds = case_seconds
        try:
            self._output, self._folder = SharedFile(), Path(tempfile.mkdtemp(prefix="proxbench-"))
        except OSError as error:
            raise BenchError(f"cannot make a temporary file: {error.strerror}; make room, or set TMPDIR.") from None
        context = get_context("forkserver")
        context.set_forkserver_preload([f"{__package__}.preload"])
        self._pipe, theirs = context.Pipe()
        heard, self._orders = context.Pipe(duplex=False)
        assignment = Assignment(pickled, registered(), memory_bytes, self._output, self._folder)
        self._process = context.Process(target=keep, args=(theirs, heard, assignment), daemon=True)
        try:
            with _environment(ONE_THREAD), contextlib.nullcontext() if with_main else _main_left_alone():
                self._process.start()
        except (OSError, EOFError) as error:
            self._let_go()
            raise Fault(Outcome.CRASHED, f"its process could not be started: {error}") from None
        finally:
            theirs.close()
            heard.close()

    def ask(self, request: str, *arguments: Any, largest: int = LARGEST_NUMBERS) -> tuple[dict[str, Any], FloatArray]:
        """Send one request and wait for its answer: a JSON object and an array, which may be empty.

        Args:
            request: what is asked for.
            arguments: to it.
            largest: number of bytes that the array may have.

        Raises:
            Fault: if the case raises, misbehaves, dies, or its time is up.
        """
        began = time.monotonic()
        deadline = began + max(self._case_seconds - self.busy_seconds, 0.0)
        try:
            if self._is_stopped:
                self._tell(GO_ON)
            self._pipe.send((request, arguments))
            answer = read_object(self._pipe.fileno(), LARGEST_ANSWER, deadline)
            numbers = np.frombuffer(read_message(self._pipe.fileno(), largest, deadline), dtype=np.float64)
            self.peak_memory_bytes = max(self.peak_memory_bytes, int(answer.get("peak_memory_bytes", 0)))
            fault = _told_fault(answer)
        except TimeoutError:
            raise Fault(Outcome.TIMEOUT, f"the case took longer than its {self._case_seconds:g} s") from None
        except (EOFError, OSError):
            raise Fault(Outcome.CRASHED, self._death()) from None
        except (NoMessageError, ValueError, TypeError, OverflowError, KeyError):
            raise Fault(Outcome.MISBEHAVED, "its process sent something that is no answer") from None
        finally:
            self._tell(STOP)
            self._is_stopped = True
            self.busy_seconds += time.monotonic() - began
        if fault is not None:
            raise fault
        return answer, numbers

    def output(self) -> str:
        """Return the end of what the case printed."""
        return self._output.end(SHOWN_OUTPUT).decode(errors="replace")

    def close(self) -> None:
        """End the process and all that it started."""
        self._tell(END)
        self._process.join(timeout=END_SECONDS)
        if self._process.exitcode != 0:  # otherwise its keeper says that nothing is left
            self._end_what_a_killed_keeper_left()
        self._let_go()

    def _end_what_a_killed_keeper_left(self) -> None:
        if self._process.is_alive():
            self._process.kill()
        deadline = time.monotonic() + END_SECONDS
        while (left := writers(self._output.descriptor)) and time.monotonic() < deadline:
            send(signal.SIGKILL, left)
            time.sleep(1e-3)
        self._process.join(timeout=END_SECONDS)

    def _let_go(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
        for end in (self._pipe, self._orders, self._output):
            end.close()

    def _tell(self, order: bytes) -> None:
        """Give the keeper an order, if it still lives."""
        with contextlib.suppress(OSError):
            os.write(self._orders.fileno(), order)

    def _death(self) -> str:
        self._process.join(timeout=END_SECONDS)
        code = self._process.exitcode
        if code is None or code == _UNKNOWN_EXIT:
            return "its process ended by itself"
        if code >= 0:
            return f"its process ended by itself with exit code {code}"
        try:
            return f"its process was killed by {signal.Signals(-code).name}"
        except ValueError:
            return f"its process was killed by signal {-code}"


_UNKNOWN_EXIT = 255
"""Exit code that multiprocessing reports where the fork server cannot tell it any more, and the process may live."""


def _told_fault(answer: dict[str, Any]) -> Fault | None:
    """Return the fault that an answer tells, if it does.

    Raises:
        KeyError: if it tells it badly.
        ValueError: likewise.
    """
    if "fault" not in answer:
        return None
    outcome, reason, trace = Outcome(answer["fault"]), answer["reason"], answer["traceback"]
    if outcome not in FAULTS or not isinstance(reason, str) or not isinstance(trace, str):
        raise ValueError
    return Fault(outcome, reason, trace)


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _main_left_alone() -> Iterator[None]:
    """Keep a starting process from running the caller's script again.

    multiprocessing imports the main module in every child, which would measure again in a script that calls ``run``
    without asking for ``__name__ == "__main__"``.
    """
    main = sys.modules["__main__"]
    kept: dict[str, Any] = {name: main.__dict__[name] for name in ("__file__", "__spec__") if name in main.__dict__}
    main.__dict__.pop("__file__", None)
    main.__spec__ = None
    try:
        yield
    finally:
        main.__dict__.update(kept)
