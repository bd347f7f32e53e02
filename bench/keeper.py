"""The two processes of a case: one that runs the plugin, and its keeper, which ends whatever the plugin has started.

    run ── fork server ── keeper ── case ── (what the plugin starts)

The keeper never runs a line of a plugin. It adopts what its descendants leave behind, in whatever session they hide,
and when the case ends, when the run says so or when the run itself is gone, it kills them all, removes the folder of
their temporary files, and ends as the case did. It also stops the case while others are measured, so that threads
and processes left running do not take the processor from them.
"""

import contextlib
import ctypes
import json
import os
import pickle
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait
from types import FrameType
from typing import Any

import psutil

from ..problems.plugin_files import PluginFile
from ..problems.plugins import register
from .measure import MisbehaviourError
from .messages import write_message
from .outcome import Outcome
from .shared_file import SharedFile

END, STOP, GO_ON = signal.SIGTERM, signal.SIGUSR1, signal.SIGUSR2
"""What a keeper is told: end the case, stop it, let it go on."""

_HEARD = (END, STOP, GO_ON, signal.SIGCHLD)

LARGEST_OUTPUT = 2**24
"""Bytes that a case may write to any file, its captured output included."""


@dataclass
class Assignment:
    """What a case's process is to do.

    Attributes:
        task: the pickled task.
        plugin_files: the plugin files that it may refer to.
        memory_bytes: memory it may take beyond what the framework itself needs.
        output: where it prints.
    """

    task: bytes
    plugin_files: list[PluginFile]
    memory_bytes: int
    output: SharedFile


def keep(pipe: Connection, assignment: Assignment) -> None:
    """Fork the case's process, watch over it, and end as it does. Never returns."""
    os.setsid()
    _adopt_orphans()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    folder = tempfile.mkdtemp(prefix="proxbench-")
    ears = _listening()
    keeper, case = os.getpid(), os.fork()
    if case == 0:
        _be_the_case(pipe, assignment, folder, keeper, ears)
    pipe.close()
    status = _watched(case, ears[0])
    shutil.rmtree(folder, ignore_errors=True)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        with contextlib.suppress(OSError, ValueError):
            signal.signal(number, signal.SIG_DFL)
        os.kill(keeper, number)
    os._exit(os.waitstatus_to_exitcode(status) if os.WIFEXITED(status) else 1)


def _listening() -> tuple[int, int]:
    """Return a pipe, (out, in), into which the system writes the number of every signal in ``_HEARD``."""
    ears = os.pipe()
    os.set_blocking(ears[1], False)
    signal.set_wakeup_fd(ears[1], warn_on_full_buffer=False)
    for number in _HEARD:
        signal.signal(number, _heard)
    return ears


def _deafened(ears: tuple[int, int]) -> None:
    """Take back what ``_listening`` did."""
    signal.set_wakeup_fd(-1)
    for number in _HEARD:
        signal.signal(number, signal.SIG_DFL)
    for end in ears:
        os.close(end)


def _watched(case: int, woken: int) -> int:
    """Wait until the case has ended or shall end; end all that is left of it; return its wait status."""
    parent = parent_process()
    run = parent.sentinel if parent is not None else woken
    while True:
        ended, status = os.waitpid(case, os.WNOHANG)
        if ended:
            return _end_descendants(case, status)
        ready = wait([woken, run])
        orders = os.read(woken, 4096) if woken in ready else bytes([END])
        for order in orders:
            if order in (STOP, GO_ON):
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(case, signal.SIGSTOP if order == STOP else signal.SIGCONT)
            if order == END:
                return _end_descendants(case, signal.SIGKILL)


def _heard(number: int, frame: FrameType | None) -> None:
    """Do nothing: the number is in the pipe that wakes the keeper."""


def _end_descendants(case: int, status: int) -> int:
    """Kill every descendant until there is none; return the wait status of the case."""
    while True:
        with contextlib.suppress(psutil.Error):
            for descendant in psutil.Process().children(recursive=True):
                with contextlib.suppress(psutil.Error):
                    descendant.kill()
        try:
            ended, its_status = os.waitpid(-1, 0)
        except ChildProcessError:
            return status
        if ended == case:
            status = its_status


def _be_the_case(pipe: Connection, assignment: Assignment, folder: str, keeper: int, ears: tuple[int, int]) -> None:
    """Be a session and answer requests until nobody asks. Never returns."""
    code = 1
    try:
        _deafened(ears)
        os.setsid()
        _die_with(keeper)
        _capture_output(assignment.output)
        os.environ["TMPDIR"] = tempfile.tempdir = folder
        _limit_memory(assignment.memory_bytes)
        _answer_requests(pipe, assignment)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            _flush()
        os._exit(code)


def _answer_requests(pipe: Connection, assignment: Assignment) -> None:
    task: Any = None
    while True:
        try:
            request, arguments = pipe.recv()
        except EOFError:
            return
        numbers = b""
        try:
            if task is None:
                for file in assignment.plugin_files:
                    register(file)
                task = pickle.loads(assignment.task)
            answer, numbers = task.answer(request, arguments)
        except MisbehaviourError as error:
            answer = _fault(Outcome.MISBEHAVED, str(error))
        except MemoryError:
            limit = assignment.memory_bytes / 2**20
            answer = _fault(Outcome.OUT_OF_MEMORY, f"it wanted more than {limit:.0f} MB of memory")
        except BaseException as error:
            line = str(error).splitlines()[0][:200] if str(error) else ""
            answer = _fault(Outcome.CRASHED, f"it raised {type(error).__name__}{': ' + line if line else ''}")
        with contextlib.suppress(OSError, ValueError):
            _flush()
        usage = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
        write_message(pipe.fileno(), json.dumps({**answer, "peak_memory_bytes": usage}).encode())
        write_message(pipe.fileno(), numbers)


def _flush() -> None:
    sys.stdout.flush()
    sys.stderr.flush()


def _fault(outcome: Outcome, reason: str) -> dict[str, Any]:
    return {"fault": outcome.value, "reason": reason, "traceback": traceback.format_exc()[-20_000:]}


def _adopt_orphans() -> None:
    """Ask Linux to make this process the parent of all that its descendants leave behind."""
    if sys.platform == "linux":
        set_child_subreaper = 36
        ctypes.CDLL(None).prctl(set_child_subreaper, 1)


def _die_with(parent: int) -> None:
    """Ask Linux to kill this process when its parent goes; elsewhere the closed pipe ends it."""
    if sys.platform == "linux":
        set_death_signal = 1
        ctypes.CDLL(None).prctl(set_death_signal, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def _capture_output(output: SharedFile) -> None:
    os.dup2(output.descriptor, 1)
    os.dup2(output.descriptor, 2)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_OUTPUT, LARGEST_OUTPUT))


def _limit_memory(memory_bytes: int) -> None:
    """Limit the address space to what is mapped now and ``memory_bytes`` more."""
    limit = psutil.Process().memory_info().vms + memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
