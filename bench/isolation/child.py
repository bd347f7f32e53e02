"""The process of a case: it redirects output, sets limits, and answers requests."""

import contextlib
import faulthandler
import json
import os
import pickle
import resource
import sys
import tempfile
import traceback
from dataclasses import dataclass
from multiprocessing import spawn
from pathlib import Path
from typing import Any

import psutil

from ...problems.errors import first_line
from ...problems.exchange.plugins.files import PluginFile
from ...problems.exchange.plugins.offers import Names, register
from ...solvers.native.native_solver import BrokenInterfaceError
from ..store.outcome import Outcome
from .pipe import read_message, write_message
from .process_tree import describe_exit, end_with_parent

IN_A_COPY = "in a copy"
"""Request to let a copy of the process answer another one, of which the process itself learns nothing."""

MAX_FILE_BYTES = 2**24
"""Bytes that a case may write to any file, its captured output included."""

MAX_TRACEBACK_LENGTH = 20_000
"""Characters of a traceback that are sent, its end."""

MAX_CAUSES = 100
"""Exceptions that are followed along a chain of causes: a plugin may link them in a circle."""


class MisbehaviourError(Exception):
    """A solver broke its contract; the text says how."""


def refuse(fault: str | None) -> None:
    """Raise ``MisbehaviourError`` if there is a fault."""
    if fault:
        raise MisbehaviourError(fault)


@dataclass
class Assignment:
    """What a case's process needs.

    Attributes:
        task: the pickled task.
        module: where its class is defined.
        plugin_files: the plugin files that it may refer to, with the names that they offer.
        memory_bytes: memory it may take beyond what the framework itself needs.
        folder: where its temporary files go; the supervisor makes and removes it.
        setting: working folder and import path, as multiprocessing describes them.
    """

    task: bytes
    module: str
    plugin_files: list[tuple[PluginFile, Names | None]]
    memory_bytes: int
    folder: Path
    setting: dict[str, Any]


def run_case(pipe: int, output: int, assignment: Assignment, supervisor: int) -> None:
    """Lead a session of its own and answer requests until none can come. Never returns.

    Args:
        pipe: where requests come from and answers go.
        output: where it prints.
        assignment: what to do.
        supervisor: process id of its parent.
    """
    code = 1
    try:
        os.setsid()
        end_with_parent(supervisor)
        for stream in (1, 2):
            os.dup2(output, stream)
        faulthandler.enable(2)  # the stack of a process killed by a signal is kept with its output
        os.environ["TMPDIR"] = tempfile.tempdir = str(assignment.folder)
        _limit(assignment.memory_bytes)
        _answer_requests(pipe, assignment)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        _flush()
        os._exit(code)


def _answer_requests(pipe: int, assignment: Assignment) -> None:
    own, is_copy, task = os.getpid(), False, None
    while True:
        try:
            request, arguments = pickle.loads(read_message(pipe))
        except (EOFError, OSError):
            return
        if request == IN_A_COPY:
            if not _fork_copy(pipe):
                continue
            request, arguments = arguments
            own, is_copy = os.getpid(), True
        numbers = b""
        try:
            if task is None:
                spawn.prepare(assignment.setting)
                for file, names in assignment.plugin_files:
                    register(file, names)
                task = pickle.loads(assignment.task)
            answer, numbers = task.answer(request, arguments)
        except (MisbehaviourError, BrokenInterfaceError) as error:
            answer = _fault(Outcome.MISBEHAVED, str(error))
        except BaseException as error:
            reason, limit = f"it raised {_one_line(error)}", f"{assignment.memory_bytes / 2**20:.0f} MB of memory"
            if _is_caused_by_memory(error):
                answer = _fault(Outcome.OUT_OF_MEMORY, f"{reason}, having wanted more than {limit}")
            else:
                answer = _fault(Outcome.CRASHED, reason)
        if os.getpid() != own:
            return  # a process that the solver forked and left: the answer is its parent's
        _flush()
        _answer(pipe, answer, numbers)
        if is_copy:
            return


def _answer(pipe: int, answer: dict[str, Any], numbers: bytes = b"") -> None:
    usage = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    write_message(pipe, json.dumps({**answer, "peak_memory_bytes": usage}).encode())
    write_message(pipe, numbers)


def _fork_copy(pipe: int) -> bool:
    """Fork; return at once in the copy, and in the process itself when that has ended, which says so if it failed."""
    own, copy = os.getpid(), os.fork()
    if copy == 0:
        end_with_parent(own)
        return True
    _, status = os.waitpid(copy, 0)
    if status:
        _answer(pipe, {"fault": Outcome.CRASHED.value, "reason": describe_exit(status), "traceback": ""})
    return False


def _is_caused_by_memory(error: BaseException) -> bool:
    """Return whether an exception was raised because of, or while handling, a MemoryError."""
    earlier: BaseException | None = error
    for _ in range(MAX_CAUSES):
        if earlier is None or isinstance(earlier, MemoryError):
            break
        earlier = earlier.__cause__ or (None if earlier.__suppress_context__ else earlier.__context__)
    return isinstance(earlier, MemoryError)


def _one_line(error: BaseException) -> str:
    """Return an exception in one line, whatever its __str__ does."""
    try:
        return first_line(error)
    except BaseException:
        return type(error).__name__


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()


def _fault(outcome: Outcome, reason: str) -> dict[str, Any]:
    try:
        trace = traceback.format_exc()[-MAX_TRACEBACK_LENGTH:]
    except BaseException:
        trace = ""
    return {"fault": outcome.value, "reason": reason, "traceback": trace}


def _limit(memory_bytes: int) -> None:
    """Limit files, and the address space to what is mapped now and ``memory_bytes`` more."""
    _, allowed = resource.getrlimit(resource.RLIMIT_FSIZE)
    largest = MAX_FILE_BYTES if allowed == resource.RLIM_INFINITY else min(MAX_FILE_BYTES, allowed)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    limit = psutil.Process().memory_info().vms + memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
