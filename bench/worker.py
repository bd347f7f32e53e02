"""Child processes that cases run in, and the conversation with them.

Cases are forked from a server that has everything loaded (``preload``). Each is the leader of a session of its own, so
that it can be killed with all it has started; it dies with the server, which dies with this process. What a case sends
back is JSON and raw numbers, never objects that could run code here.
"""

import contextlib
import json
import os
import pickle
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import psutil

from ..problems.laws import FloatArray
from ..problems.plugin_files import PluginFile
from ..problems.plugins import register, registered
from .measure import MisbehaviourError
from .outcome import Outcome

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB_MAXIMUM", "RAYON")}
"""Environment that pins every numerical library to one thread."""

LARGEST_OUTPUT = 2**24
"""Bytes that a case may write to any file, its captured output included."""

SHOWN_OUTPUT = 4000
"""Characters of captured output that are kept with a failed case."""


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
    """One case's process, seen from outside.

    Attributes:
        busy_seconds: wall time that the case has used so far [s].

    Raises:
        Fault: if the task cannot be pickled.
    """

    def __init__(
        self, task: Task, case_seconds: float, memory_bytes: int, folder: Path, with_main: bool = False
    ) -> None:
        """Start the process.

        Args:
            task: what it does.
            case_seconds: limit of the wall time of all requests together [s].
            memory_bytes: memory it may take beyond what the framework itself needs.
            folder: where its output is captured.
            with_main: whether the task needs the caller's main script, which is then run again in the process.
        """
        try:
            pickled = pickle.dumps(task)
        except Exception as error:
            reason = f"it cannot be sent to the process of its case: {error}"
            raise Fault(Outcome.MISBEHAVED, reason, traceback.format_exc()) from None
        self.busy_seconds = 0.0
        self._case_seconds = case_seconds
        self._output = folder / f"output-{os.getpid()}-{id(self)}"
        context = get_context("forkserver")
        context.set_forkserver_preload([f"{__package__}.preload"])
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(theirs, pickled, registered(), memory_bytes, str(self._output)), daemon=True
        )
        with _environment(ONE_THREAD), contextlib.nullcontext() if with_main else _main_left_alone():
            self._process.start()
        theirs.close()
        self.peak_memory_bytes = 0

    def ask(self, request: str, *arguments: Any) -> tuple[dict[str, Any], FloatArray]:
        """Send one request and wait for its answer: a JSON object and an array, which may be empty.

        Raises:
            Fault: if the case raises, misbehaves, dies, or its time is up.
        """
        began = time.perf_counter()
        try:
            self._pipe.send((request, arguments))
            if not self._pipe.poll(max(self._case_seconds - self.busy_seconds, 0.0)):
                raise Fault(Outcome.TIMEOUT, f"the case took longer than its {self._case_seconds:g} s")
            answer = json.loads(self._pipe.recv_bytes(LARGEST_OUTPUT))
            numbers = np.frombuffer(self._pipe.recv_bytes(2**32), dtype=np.float64)
        except (EOFError, ConnectionError, BrokenPipeError):
            raise Fault(Outcome.CRASHED, self._death()) from None
        except (ValueError, OSError):
            raise Fault(Outcome.MISBEHAVED, "its process sent something that is no answer") from None
        finally:
            self.busy_seconds += time.perf_counter() - began
        self.peak_memory_bytes = max(self.peak_memory_bytes, int(answer.get("peak_memory_bytes", 0)))
        if "fault" in answer:
            raise Fault(Outcome(answer["fault"]), answer["reason"], answer["traceback"])
        return answer, numbers

    def output(self) -> str:
        """Return the end of what the case printed."""
        try:
            with open(self._output, "rb") as file:
                file.seek(max(0, os.path.getsize(self._output) - SHOWN_OUTPUT))
                return file.read().decode(errors="replace")
        except OSError:
            return ""

    def close(self) -> None:
        """End the process and all that it started."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if self._process.pid is not None:
                os.killpg(self._process.pid, signal.SIGKILL)
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()
        self._process.join(timeout=5.0)
        self._pipe.close()
        self._output.unlink(missing_ok=True)

    def _death(self) -> str:
        self._process.join(timeout=5.0)
        code = self._process.exitcode
        if code is not None and code < 0:
            return f"its process was killed by {signal.Signals(-code).name}"
        return f"its process ended by itself with exit code {code}"


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


def _serve(pipe: Connection, pickled: bytes, plugin_files: list[PluginFile], memory_bytes: int, output: str) -> None:
    """Answer requests until the other end of the pipe closes."""
    os.setsid()
    _die_with_parent()
    _capture_output(output)
    _limit_memory(memory_bytes)
    task: Task | None = None
    while True:
        try:
            request, arguments = pipe.recv()
        except EOFError:
            return
        numbers = b""
        try:
            if task is None:
                for file in plugin_files:
                    register(file)
                task = pickle.loads(pickled)
            answer, numbers = task.answer(request, arguments)
        except MisbehaviourError as error:
            answer = _fault(Outcome.MISBEHAVED, str(error))
        except MemoryError:
            answer = _fault(Outcome.OUT_OF_MEMORY, f"it wanted more than {memory_bytes / 2**20:.0f} MB of memory")
        except (Exception, SystemExit, KeyboardInterrupt) as error:
            line = str(error).splitlines()[0][:200] if str(error) else ""
            answer = _fault(Outcome.CRASHED, f"it raised {type(error).__name__}{': ' + line if line else ''}")
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        usage = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
        pipe.send_bytes(json.dumps({**answer, "peak_memory_bytes": usage}).encode())
        pipe.send_bytes(numbers)


def _fault(outcome: Outcome, reason: str) -> dict[str, Any]:
    return {"fault": outcome.value, "reason": reason, "traceback": traceback.format_exc()[-20_000:]}


def _die_with_parent() -> None:
    """Ask Linux to kill this process when the fork server goes; elsewhere the closed pipe ends it."""
    if sys.platform == "linux":
        import ctypes

        set_death_signal = 1
        ctypes.CDLL(None).prctl(set_death_signal, signal.SIGKILL)


def _capture_output(path: str) -> None:
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(file, 1)
    os.dup2(file, 2)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_OUTPUT, LARGEST_OUTPUT))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _limit_memory(memory_bytes: int) -> None:
    """Limit the address space to what is mapped now and ``memory_bytes`` more."""
    limit = psutil.Process().memory_info().vms + memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def working_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder for captured output that removes itself."""
    return tempfile.TemporaryDirectory(prefix="proxbench-")
