"""The child process of a case: it redirects output, sets limits, and answers requests."""

import contextlib
import faulthandler
import json
import os
import pickle
import resource
import sys
import tempfile
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing import spawn
from pathlib import Path
from typing import Any

import psutil

from ...problems.errors import InsufficientMemoryError, error_text, first_line, raised_at
from ...problems.exchange.plugins.files import PluginFile
from ...problems.exchange.plugins.offers import Names, register
from ...solvers.native.captured_output import last_line, output_size
from ...solvers.native.native_solver import BrokenInterfaceError
from ..store.outcome import Outcome
from .pipe import read_message, write_message
from .process_tree import describe_exit, end_with_parent

FORK_REQUEST = "in a copy"
"""Request to fork the process; its arguments are another request, which the fork answers."""

MAX_FILE_BYTES = 2**24
"""Largest size of a file that a case may write, including its captured output [bytes]."""

MAX_TRACEBACK_LENGTH = 20_000
"""Largest number of characters that are sent from the end of a traceback."""

MAX_CAUSES = 100
"""Largest number of causes of an exception to follow, because a plugin may link them in a cycle."""


class MisbehaviourError(Exception):
    """A solver violated its contract; the message states how."""


def raise_fault(fault: str | None) -> None:
    """Raise ``MisbehaviourError`` if there is a fault."""
    if fault:
        raise MisbehaviourError(fault)


@dataclass
class Assignment:
    """The task of a child process and its environment.

    Attributes:
        task: the pickled task.
        module: module that defines the class of the task.
        plugin_files: plugin files that the task may refer to, with the names that they provide.
        memory_bytes: memory limit, in addition to the memory that the framework needs [bytes].
        folder: folder of the temporary files of the case, created and removed by the supervisor.
        setting: working folder and import path, in the form that multiprocessing uses.
        solvers: names of built-in solvers whose kernels the fork server loads first.
    """

    task: bytes
    module: str
    plugin_files: list[tuple[PluginFile, Names | None]]
    memory_bytes: int
    folder: Path
    setting: dict[str, Any]
    solvers: Sequence[str] = ()


def run_case(pipe: int, output: int, assignment: Assignment, supervisor: int) -> None:
    """Start a new session and answer requests until the pipe is closed. This function never returns.

    Args:
        pipe: file descriptor of requests and answers.
        output: file descriptor of standard output and standard error.
        assignment: the task and its environment.
        supervisor: process id of the parent.
    """
    code = 1
    try:
        os.setsid()
        end_with_parent(supervisor)
        for stream in (1, 2):
            os.dup2(output, stream)
        faulthandler.enable(2)  # the stack of a process killed by a signal is kept with its output
        os.environ["TMPDIR"] = tempfile.tempdir = str(assignment.folder)
        _limit_resources(assignment.memory_bytes)
        _answer_requests(pipe, assignment)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        _flush()
        os._exit(code)


def _answer_requests(pipe: int, assignment: Assignment) -> None:
    """Answer requests until the pipe is closed; a copy of the process answers only one."""
    own_id, is_copy, task = os.getpid(), False, None
    while True:
        try:
            request, arguments = pickle.loads(read_message(pipe))
        except (EOFError, OSError):
            return
        if request == FORK_REQUEST:
            if not _fork_copy(pipe):
                continue
            request, arguments = arguments
            own_id, is_copy = os.getpid(), True
        content = b""
        try:
            if task is None:
                spawn.prepare(assignment.setting)
                for file, names in assignment.plugin_files:
                    register(file, names)
                task = pickle.loads(assignment.task)
            answer, content = task.answer(request, arguments)
        except (MisbehaviourError, BrokenInterfaceError) as error:
            answer = _fault_answer(Outcome.MISBEHAVED, str(error).removesuffix("."))
        except BaseException as error:
            reason, limit = f"it raised {_one_line(error)}", f"{assignment.memory_bytes / 2**20:.0f} MiB of memory"
            if isinstance(error, InsufficientMemoryError):
                answer = _fault_answer(Outcome.OUT_OF_MEMORY, error_text(error))
            elif _is_caused_by_memory(error):
                answer = _fault_answer(Outcome.OUT_OF_MEMORY, f"{reason} when it requested more than {limit}")
            else:
                answer = _fault_answer(Outcome.CRASHED, f"{reason}{raised_at(error)}")
        if os.getpid() != own_id:
            return  # a process that the solver forked: only its parent answers
        _flush()
        _send_answer(pipe, answer, content)
        if is_copy:
            return


def _send_answer(pipe: int, answer: dict[str, Any], content: bytes = b"") -> None:
    """Send an answer with the peak memory of this process, then its binary content."""
    write_message(pipe, json.dumps({**answer, "peak_memory_bytes": peak_memory(resource.RUSAGE_SELF)}).encode())
    write_message(pipe, content)


def peak_memory(who: int) -> int:
    """Return a peak resident memory [bytes].

    Args:
        who: ``RUSAGE_SELF`` for this process, ``RUSAGE_CHILDREN`` for the largest child that it has waited for.
    """
    return resource.getrusage(who).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _fork_copy(pipe: int) -> bool:
    """Fork, and return whether this process is the copy. The original waits for the copy, and reports its failure."""
    output_before = output_size(2)
    original, copy = os.getpid(), os.fork()
    if copy == 0:
        end_with_parent(original)
        return True
    _, status = os.waitpid(copy, 0)
    if status:
        reason = exit_reason(status, 2, output_before)
        _send_answer(pipe, {"fault": Outcome.CRASHED.value, "reason": reason, "traceback": ""})
    return False


def exit_reason(status: int, output: int, start: int) -> str:
    """Return how a process ended; if it exited, with the last line of its output.

    After a signal, the output ends with a stack instead.

    Args:
        status: its wait status.
        output: file descriptor of its standard output and standard error.
        start: size of the output before the request that it was answering [bytes].
    """
    line = last_line(output, start) if os.WIFEXITED(status) else ""
    return describe_exit(status) + (f"; the last line of its output is {line!r}" if line else "")


def _is_caused_by_memory(error: BaseException) -> bool:
    """Return whether an exception was raised because of, or while handling, a MemoryError."""
    cause: BaseException | None = error
    for _ in range(MAX_CAUSES):
        if cause is None or isinstance(cause, MemoryError):
            break
        cause = cause.__cause__ or (None if cause.__suppress_context__ else cause.__context__)
    return isinstance(cause, MemoryError)


def _one_line(error: BaseException) -> str:
    """Return a one-line description of an exception, even if its __str__ raises."""
    try:
        return first_line(error)
    except BaseException:
        return type(error).__name__


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()


def _fault_answer(outcome: Outcome, reason: str) -> dict[str, Any]:
    """Return the answer that reports a fault, with the traceback of the current exception."""
    try:
        trace = traceback.format_exc()[-MAX_TRACEBACK_LENGTH:]
    except BaseException:
        trace = ""
    return {"fault": outcome.value, "reason": reason, "traceback": trace}


def _limit_resources(memory_bytes: int) -> None:
    """Limit the size of files, and the address space to its current size plus ``memory_bytes``."""
    _, hard_limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    max_file_bytes = MAX_FILE_BYTES if hard_limit == resource.RLIM_INFINITY else min(MAX_FILE_BYTES, hard_limit)
    resource.setrlimit(resource.RLIMIT_FSIZE, (max_file_bytes, max_file_bytes))
    limit = psutil.Process().memory_info().vms + memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
