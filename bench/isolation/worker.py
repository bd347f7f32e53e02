"""Child processes of cases, and the communication with them.

Cases are forked from a server with all libraries loaded (``preload``). Each case has a supervisor that ends all
processes of the case, even if this process has ended (``supervisor``). Within its time limit, a case answers with JSON
and raw numbers, never with objects that could run code here (``pipe``).
"""

import contextlib
import os
import pickle
import re
import shutil
import signal
import socket
import tempfile
import time
import traceback
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing import spawn
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self
from uuid import uuid4

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.exchange.plugins.offers import registered
from ...solvers.native.captured_output import output_size
from ..errors import BenchError
from ..store.outcome import FAULTS, Outcome
from .child import Assignment, exit_reason
from .fork_server import fork_supervisor
from .pipe import NoMessageError, read_message, read_object, write_message
from .process_tree import descendants, processor_seconds, running, send_signal, writers
from .supervisor import CONTINUE, END, STOP

REQUEST_SECONDS = 60.0
"""Default limit of the wall time of a request [s]."""

MEMORY_BYTES = 2**31
"""Default memory limit of a process, in addition to the memory that the framework needs [bytes]."""

MAX_ANSWER_BYTES = 2**24
"""Largest size of the JSON of an answer [bytes]."""

MAX_CONTENT_BYTES = 2**32
"""Largest size of the binary content of an answer [bytes]."""

MAX_OUTPUT_LENGTH = 4000
"""Largest number of characters of captured output that are kept with a failed case."""

MAX_LIST_LENGTH = 16_000
"""Largest size of the list of extension modules that Python prints after a fatal signal [bytes]."""

_MODULE_LIST = re.compile(r"\n*Extension modules: [^\n]*")
"""That list, which is removed from captured output."""

END_SECONDS = 3.0
"""Wall time limit for a supervisor to end its case [s]."""


@dataclass
class Fault(Exception):  # noqa: N818 - a failure of the case, not of the program
    """The failure of a case that returns no answer."""

    outcome: Outcome
    reason: str
    traceback: str = ""


INVALID_ANSWER = "its process sent an invalid answer"
"""Reason reported for a process whose answer cannot be read."""


def invalid_answer_fault() -> Fault:
    """Return the fault of a process whose answer cannot be read."""
    return Fault(Outcome.MISBEHAVED, INVALID_ANSWER)


class Task(Protocol):
    """The task of a process, which answers requests. Plugin files are registered before the task is unpickled."""

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Return a JSON object and binary content."""
        ...


class Worker:
    """The process of a case. Between requests, the process and its descendants are stopped.

    Attributes:
        case_seconds: wall time limit of all requests together [s].
        busy_seconds: wall time that the case has used [s].
        peak_memory_bytes: peak memory that the process reports [bytes].

    Raises:
        Fault: if the task cannot be pickled, or no process can be started.
        BenchError: if temporary files cannot be created.
    """

    def __init__(self, task: Task, case_seconds: float, memory_bytes: int, solvers: Sequence[str] = ()) -> None:
        """Start the process.

        Args:
            task: its task.
            case_seconds: wall time limit of all requests together [s].
            memory_bytes: memory limit, in addition to what the framework needs [bytes].
            solvers: names of built-in solvers whose kernels are loaded, or compiled, before the first request.
        """
        try:
            pickled = pickle.dumps(task)
        except Exception as error:
            reason = f"it cannot be sent to the process of its case: {error}"
            raise Fault(Outcome.MISBEHAVED, reason, traceback.format_exc()) from None
        self.case_seconds, self.busy_seconds, self.peak_memory_bytes = case_seconds, 0.0, 0
        self._memory_bytes = memory_bytes
        self._is_stopped = False
        self._output_before = 0  # bytes of output before the current request
        try:
            self._output, self._folder = _output_file(), Path(tempfile.gettempdir(), f"proxbench-{uuid4()}")
        except OSError as error:
            raise BenchError(
                f"cannot make a temporary file: {error.strerror}; free some space, or set TMPDIR."
            ) from None
        module, files = type(task).__module__, registered()
        assignment = Assignment(pickled, module, files, memory_bytes, self._folder, _setting(), tuple(solvers))
        try:
            self._supervisor = fork_supervisor(assignment, self._output)
        except OSError as error:
            self._release()
            raise Fault(Outcome.CRASHED, f"its process could not be started: {error}") from None

    def ask(self, request: str, *arguments: Any, largest: int = MAX_CONTENT_BYTES) -> tuple[dict[str, Any], bytes]:
        """Send one request and return its answer: a JSON object, and at most ``largest`` bytes of binary content.

        Raises:
            Fault: if the case raises, misbehaves, ends, or exceeds its time limit.
        """
        began, pipe = time.monotonic(), self._supervisor.pipe.fileno()
        deadline = began + max(self.case_seconds - self.busy_seconds, 0.0)
        self._output_before = output_size(self._output)
        try:
            if self._is_stopped:
                self._supervisor.send(CONTINUE)
            if _has_input(self._supervisor.pipe):
                raise NoMessageError("an answer without a request")
            write_message(pipe, pickle.dumps((request, arguments)))
            exit_descriptor = self._supervisor.orders.fileno()
            answer = read_object(pipe, MAX_ANSWER_BYTES, deadline, exit_descriptor)
            content = read_message(pipe, largest, deadline, exit_descriptor)
            self.peak_memory_bytes = max(self.peak_memory_bytes, int(answer.get("peak_memory_bytes", 0)))
            fault = _reported_fault(answer)
        except TimeoutError:
            raise self._timeout_fault() from None
        except (EOFError, OSError):
            raise self._exit_fault() from None
        except (NoMessageError, ValueError, TypeError, OverflowError, KeyError):
            raise invalid_answer_fault() from None
        finally:
            self._supervisor.send(STOP)
            self._is_stopped = True
            self.busy_seconds += time.monotonic() - began
        if fault is not None:
            raise fault
        return answer, content

    def n_started(self) -> int:
        """Return the number of processes, orphaned ones included, that the case has started and that have not ended."""
        return max(len(running(descendants(self._supervisor.process))) - 1, 0)

    @property
    def process(self) -> int:
        """Process id of the case after its first answer; 0 if it has ended."""
        return next(iter(descendants(self._supervisor.process)), 0)

    def processor_seconds(self) -> float:
        """Return the processor time that the process of the case and its descendants have used [s]."""
        return sum(map(processor_seconds, descendants(self._supervisor.process)))

    def output(self) -> str:
        """Return the end of the output of the case, without the list of extension modules."""
        size, max_bytes = os.fstat(self._output).st_size, MAX_OUTPUT_LENGTH + MAX_LIST_LENGTH
        text = os.pread(self._output, max_bytes, max(0, size - max_bytes)).decode(errors="replace")
        return _MODULE_LIST.sub("", text)[-MAX_OUTPUT_LENGTH:]

    def dismiss(self) -> None:
        """Ask the process to end without waiting for it; it answers no further requests."""
        self._supervisor.send(END)

    def close(self) -> None:
        """End the process and all processes that it started."""
        self.dismiss()
        if self._supervisor.wait_for_end(END_SECONDS)[0] is None:
            self._supervisor.kill()
            self._kill_orphans()
        self._supervisor.close()
        self._release()

    def _kill_orphans(self) -> None:
        """Kill the processes that a killed or stopped supervisor has left; they share the output file of the case."""
        deadline = time.monotonic() + END_SECONDS
        while (orphans := writers(self._output)) and time.monotonic() < deadline:
            send_signal(signal.SIGKILL, orphans)
            time.sleep(1e-3)

    def _release(self) -> None:
        """Remove the temporary folder, and close the output file."""
        shutil.rmtree(self._folder, ignore_errors=True)
        os.close(self._output)

    def _timeout_fault(self) -> Fault:
        """End a case at its time limit, and return its fault: a timeout, or out of memory if its memory is full."""
        self.dismiss()
        _, has_filled_memory = self._supervisor.wait_for_end(END_SECONDS)
        if has_filled_memory:
            reason = f"it used all its {self._mebibytes} MiB of memory and did not end in time"
            return Fault(Outcome.OUT_OF_MEMORY, reason)
        return Fault(Outcome.TIMEOUT, f"the case took longer than its {self.case_seconds:g} s")

    def _exit_fault(self) -> Fault:
        """Return the fault of a case that exited, was killed, or closed its connection."""
        status, has_filled_memory = self._supervisor.wait_for_end(END_SECONDS)
        if status is None and not self._supervisor.is_gone:
            return Fault(Outcome.CRASHED, "its process closed its connection to the run")
        if status is None:
            return Fault(Outcome.CRASHED, "its process ended together with its supervisor")
        reason = exit_reason(status, self._output, self._output_before)
        if has_filled_memory and os.WIFSIGNALED(status):
            return Fault(Outcome.OUT_OF_MEMORY, f"{reason} when its {self._mebibytes} MiB of memory were full")
        return Fault(Outcome.CRASHED, reason)

    @property
    def _mebibytes(self) -> str:
        """The memory limit in MiB, as text."""
        return f"{self._memory_bytes / 2**20:.0f}"


def numbers_of(content: bytes) -> FloatArray:
    """Return the array of float64 that came with an answer.

    Raises:
        Fault: if the content is not such an array.
    """
    if len(content) % np.dtype(np.float64).itemsize:
        raise invalid_answer_fault()
    return np.frombuffer(content, dtype=np.float64)


def _reported_fault(answer: dict[str, Any]) -> Fault | None:
    """Return the fault that an answer reports, or None.

    Raises:
        ValueError, KeyError: if the report is invalid.
    """
    if "fault" not in answer:
        return None
    outcome, reason, trace = Outcome(answer["fault"]), answer["reason"], answer["traceback"]
    if outcome not in FAULTS or not isinstance(reason, str) or not isinstance(trace, str):
        raise ValueError
    return Fault(outcome, reason, trace)


def _has_input(pipe: socket.socket) -> bool:
    """Return whether data have arrived without a request."""
    with contextlib.suppress(BlockingIOError):
        return bool(pipe.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT))
    return False


def _output_file() -> int:
    """Open a file without a name, which the system removes when the last process closes it."""
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def _setting() -> dict[str, Any]:
    """Return the settings of this process that a case needs; the case does not run the main script again."""
    data = spawn.get_preparation_data("case")
    return {key: data[key] for key in ("sys_path", "dir") if key in data}


class RenewedWorker:
    """A process for one task that starts with the first request, and is replaced after a fault.

    Use it as a context manager, or call ``close``; otherwise the process ends when the object is deleted.

    Attributes:
        seconds: default wall time limit of a request [s].
    """

    def __init__(
        self,
        task: Task,
        seconds: float = REQUEST_SECONDS,
        memory_bytes: int = MEMORY_BYTES,
        solvers: Sequence[str] = (),
    ) -> None:
        """Store the arguments, see ``Worker``; ``seconds`` is the default wall time limit of a request [s]."""
        self.seconds = seconds
        self._task, self._memory_bytes, self._solvers = task, memory_bytes, solvers
        self._workers: list[Worker] = []
        weakref.finalize(self, _close_all, self._workers)

    def ask(self, request: str, *arguments: Any, seconds: float | None = None) -> tuple[dict[str, Any], bytes]:
        """Return the answer to one request, within ``seconds`` or the default limit [s].

        Raises:
            Exception: the one that ``failure`` returns, if the request gets no answer.
        """
        try:
            if not self._workers:
                self._workers.append(Worker(self._task, self.seconds, self._memory_bytes, self._solvers))
            worker = self._workers[0]
            worker.case_seconds, worker.busy_seconds = self.seconds if seconds is None else seconds, 0.0
            return worker.ask(request, *arguments)
        except Fault as fault:
            self.close()
            raise self.failure(fault) from None

    def failure(self, fault: Fault) -> Exception:
        """Return the exception to raise for a fault, by default the fault itself."""
        return fault

    def reject_answer(self) -> Exception:
        """End the process, and return the exception to raise for an answer that cannot be read."""
        self.close()
        return self.failure(invalid_answer_fault())

    def close(self) -> None:
        """End the process."""
        _close_all(self._workers)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _close_all(workers: list[Worker]) -> None:
    """Close the workers, and empty the list."""
    while workers:
        workers.pop().close()
