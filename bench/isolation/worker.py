"""Child processes that cases run in, and the conversation with them.

Cases are forked from a server that has everything loaded (``preload``), each under a supervisor that ends all it has
started, also when this process is gone (``supervisor``). What a case sends back is JSON and raw numbers, never
objects that could run code here, and is waited for no longer than the case's time (``pipe``).
"""

import contextlib
import os
import pickle
import re
import shutil
import socket
import tempfile
import time
import traceback
import weakref
from dataclasses import dataclass
from multiprocessing import spawn
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self
from uuid import uuid4

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.exchange.plugins.offers import registered
from ..errors import BenchError
from ..store.outcome import FAULTS, Outcome
from .child import Assignment
from .fork_server import fork_supervisor
from .pipe import NoMessageError, read_message, read_object, write_message
from .process_tree import (
    descendants,
    describe_exit,
    processor_seconds,
    running,
)
from .supervisor import END, GO_ON, STOP

REQUEST_SECONDS = 60.0
"""Default limit of the wall time of a request [s]."""

MEMORY_BYTES = 2**31
"""Default limit of the memory that a process may take beyond what the framework itself needs [bytes]."""

MAX_ANSWER_BYTES = 2**24
"""Bytes that the JSON of an answer may have."""

MAX_CONTENT_BYTES = 2**32
"""Bytes that may come with it."""

MAX_OUTPUT_LENGTH = 4000
"""Characters of captured output that are kept with a failed case."""

MAX_LIST_LENGTH = 16_000
"""Bytes that the list of extension modules may take, with which Python ends what it says of a deadly signal."""

_MODULES = re.compile(r"\n*Extension modules: [^\n]*")

END_SECONDS = 3.0
"""Wall time that a supervisor has to end its case."""


@dataclass
class Fault(Exception):  # noqa: N818 - the case is at fault, not the program
    """The failure of a case that gives no answer."""

    outcome: Outcome
    reason: str
    traceback: str = ""


NO_ANSWER = "its process sent something that is no answer"
"""Reason reported for a process whose answer cannot be read."""


def no_answer() -> Fault:
    """Return the fault of such a process."""
    return Fault(Outcome.MISBEHAVED, NO_ANSWER)


class Task(Protocol):
    """What a process does: answer requests. A task is pickled; plugin files are registered before it is unpickled."""

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Return a JSON object, and bytes that go with it."""
        ...


class Worker:
    """One case's process, seen from outside. Between requests it is stopped, with all its threads.

    Attributes:
        case_seconds: limit of the wall time of all requests together [s].
        busy_seconds: wall time that the case has used so far [s].
        peak_memory_bytes: most memory that it says it had.

    Raises:
        Fault: if the task cannot be pickled, or no process can be started.
        BenchError: if there is no room for temporary files.
    """

    def __init__(self, task: Task, case_seconds: float, memory_bytes: int) -> None:
        """Start the process, which may take ``memory_bytes`` beyond what the framework itself needs."""
        try:
            pickled = pickle.dumps(task)
        except Exception as error:
            reason = f"it cannot be sent to the process of its case: {error}"
            raise Fault(Outcome.MISBEHAVED, reason, traceback.format_exc()) from None
        self.case_seconds, self.busy_seconds, self.peak_memory_bytes = case_seconds, 0.0, 0
        self._memory_bytes = memory_bytes
        self._is_stopped = False
        try:
            self._output, self._folder = _output_file(), Path(tempfile.gettempdir(), f"proxbench-{uuid4()}")
        except OSError as error:
            raise BenchError(f"cannot make a temporary file: {error.strerror}; make room, or set TMPDIR.") from None
        assignment = Assignment(pickled, type(task).__module__, registered(), memory_bytes, self._folder, _setting())
        try:
            self._supervisor = fork_supervisor(assignment, self._output)
        except OSError as error:
            self._let_go()
            raise Fault(Outcome.CRASHED, f"its process could not be started: {error}") from None

    def ask(self, request: str, *arguments: Any, largest: int = MAX_CONTENT_BYTES) -> tuple[dict[str, Any], bytes]:
        """Send one request and wait for its answer: a JSON object, and what goes with it, ``largest`` bytes at most.

        Raises:
            Fault: if the case raises, misbehaves, dies, or its time is up.
        """
        began, pipe = time.monotonic(), self._supervisor.pipe.fileno()
        deadline = began + max(self.case_seconds - self.busy_seconds, 0.0)
        try:
            if self._is_stopped:
                self._supervisor.send(GO_ON)
            if _has_input(self._supervisor.pipe):
                raise NoMessageError("an answer without a request")
            write_message(pipe, pickle.dumps((request, arguments)))
            lifeline = self._supervisor.orders.fileno()
            answer = read_object(pipe, MAX_ANSWER_BYTES, deadline, lifeline)
            content = read_message(pipe, largest, deadline, lifeline)
            self.peak_memory_bytes = max(self.peak_memory_bytes, int(answer.get("peak_memory_bytes", 0)))
            fault = _reported_fault(answer)
        except TimeoutError:
            raise self._timeout() from None
        except (EOFError, OSError):
            raise self._death() from None
        except (NoMessageError, ValueError, TypeError, OverflowError, KeyError):
            raise no_answer() from None
        finally:
            self._supervisor.send(STOP)
            self._is_stopped = True
            self.busy_seconds += time.monotonic() - began
        if fault is not None:
            raise fault
        return answer, content

    def n_started(self) -> int:
        """Return how many processes run beside that of the case, whoever is their parent now."""
        return max(len(running(descendants(self._supervisor.process))) - 1, 0)

    @property
    def process(self) -> int:
        """Process id of the case, once it has answered a request; 0 if it is gone."""
        return next(iter(descendants(self._supervisor.process)), 0)

    def processor_seconds(self) -> float:
        """Return the processor time that the process of the case, and those that it keeps, have used [s]."""
        return sum(map(processor_seconds, descendants(self._supervisor.process)))

    def waited_seconds(self) -> float:
        """Return for how long the case was ready to run while others ran [s]; 0 where the system does not count it."""
        try:
            return 1e-9 * float(Path(f"/proc/{self.process}/schedstat").read_text().split()[1])
        except (OSError, ValueError, IndexError):
            return 0.0

    def output(self) -> str:
        """Return the end of what the case printed."""
        size, most = os.fstat(self._output).st_size, MAX_OUTPUT_LENGTH + MAX_LIST_LENGTH
        printed = os.pread(self._output, most, max(0, size - most)).decode(errors="replace")
        return _MODULES.sub("", printed)[-MAX_OUTPUT_LENGTH:]

    def dismiss(self) -> None:
        """Let the process end, without waiting for it; it answers no more."""
        self._supervisor.send(END)

    def close(self) -> None:
        """End the process and all that it started."""
        self.dismiss()
        if self._supervisor.ending(END_SECONDS)[0] is None:
            self._supervisor.kill()
        self._supervisor.close()
        self._let_go()

    def _let_go(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
        os.close(self._output)

    def _timeout(self) -> Fault:
        """End a case whose time is up, and return its fault, which is not its time where its memory is full."""
        self.dismiss()
        _, has_filled_memory = self._supervisor.ending(END_SECONDS)
        if has_filled_memory:
            reason = f"it filled its {self._megabytes} MB of memory and did not end in time"
            return Fault(Outcome.OUT_OF_MEMORY, reason)
        return Fault(Outcome.TIMEOUT, f"the case took longer than its {self.case_seconds:g} s")

    def _death(self) -> Fault:
        """Return the fault of a case that ended by itself, or that another program than the run has ended."""
        status, has_filled_memory = self._supervisor.ending(END_SECONDS)
        if status is None and not self._supervisor.is_gone:
            return Fault(Outcome.CRASHED, "its process closed its connection to the run")
        reason = "its process ended together with its supervisor" if status is None else describe_exit(status)
        if has_filled_memory and status is not None and os.WIFSIGNALED(status):
            return Fault(Outcome.OUT_OF_MEMORY, f"{reason} as its {self._megabytes} MB of memory were full")
        return Fault(Outcome.CRASHED, reason)

    @property
    def _megabytes(self) -> str:
        return f"{self._memory_bytes / 2**20:.0f}"


def numbers_of(content: bytes) -> FloatArray:
    """Return the array of float64 that came with an answer.

    Raises:
        Fault: if it is none.
    """
    if len(content) % np.dtype(np.float64).itemsize:
        raise no_answer()
    return np.frombuffer(content, dtype=np.float64)


def _reported_fault(answer: dict[str, Any]) -> Fault | None:
    """Return the fault that an answer reports, if it does; raise an error if the report is none."""
    if "fault" not in answer:
        return None
    outcome, reason, trace = Outcome(answer["fault"]), answer["reason"], answer["traceback"]
    if outcome not in FAULTS or not isinstance(reason, str) or not isinstance(trace, str):
        raise ValueError
    return Fault(outcome, reason, trace)


def _has_input(pipe: socket.socket) -> bool:
    """Return whether something has come before any request."""
    with contextlib.suppress(BlockingIOError):
        return bool(pipe.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT))
    return False


def _output_file() -> int:
    """Open a file without a name; the system removes it with the last process that has it open."""
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def _setting() -> dict[str, Any]:
    """Return what of this process's setting a case needs; its main script is not run again there."""
    known = spawn.get_preparation_data("case")
    return {key: known[key] for key in ("sys_path", "dir") if key in known}


class RenewedWorker:
    """One process after the other for one task: the first starts with the first request, the next one after a fault.

    Use it as a context manager, or ``close`` it; the process ends with the object at the latest.

    Attributes:
        seconds: wall time that each request may take [s].
    """

    def __init__(self, task: Task, seconds: float = REQUEST_SECONDS, memory_bytes: int = MEMORY_BYTES) -> None:
        """Note what to start; a process may take ``memory_bytes`` beyond what the framework itself needs."""
        self.seconds = seconds
        self._task, self._memory_bytes = task, memory_bytes
        self._running: list[Worker] = []
        weakref.finalize(self, _end, self._running)

    def ask(self, request: str, *arguments: Any, seconds: float | None = None) -> tuple[dict[str, Any], bytes]:
        """Return the answer to one request, which has the whole time limit to itself, or another one [s].

        Raises:
            Exception: what ``failure`` makes of the fault of a request that is not answered.
        """
        try:
            if not self._running:
                self._running.append(Worker(self._task, self.seconds, self._memory_bytes))
            worker = self._running[0]
            worker.case_seconds, worker.busy_seconds = self.seconds if seconds is None else seconds, 0.0
            return worker.ask(request, *arguments)
        except Fault as fault:
            self.close()
            raise self.failure(fault) from None

    def failure(self, fault: Fault) -> Exception:
        """Return what is raised for a fault: the fault, where nothing says more."""
        return fault

    def close(self) -> None:
        """End the process."""
        _end(self._running)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _end(running: list[Worker]) -> None:
    while running:
        running.pop().close()
