"""A trial import of a plugin file, in a process of its own, before the process of the run imports it.

No exception tells of an import that ends its process, never ends, keeps its process from ending, or replaces a part of
the framework: the judge of all solvers runs where plugin files are imported.
"""

import atexit
import contextlib
import faulthandler
import gc
import json
import os
import pickle
import signal
import sys
import threading
import time
from importlib import import_module

from ...problems.catalog.plugin_files import PluginFile, make_importable, told
from ...problems.errors import PluginError
from ...solvers.contract import made
from .linux import adopt_orphans, die_with
from .pipe import NoMessageError, read_object, write_message
from .process_state import Surroundings
from .process_tree import descendants, send

TRIAL_SECONDS = 60.0
"""Wall time that the import may take, and the making of each solver [s]."""

END_SECONDS = 5.0
"""Wall time that the process may take to end after that [s]."""

_LARGEST = 2**16

_WATCHED = ("measure.runner", "store.frames", "report.tables")
"""Modules that are loaded before the trial, with all that they import: only what is there is seen to be replaced."""

_REMEDY = "a plugin file must only define things."

_SHARED = {
    "the working folder",
    "the mask of file modes",
    "numpy's error state",
    "the standard streams",
    "signal handlers",
    "the alarm clock",
    "the recursion limit",
    "garbage collection",
}
"""State that the run itself depends on."""


def try_import(file: PluginFile, seconds: float = TRIAL_SECONDS) -> None:
    """Import a plugin file and make its solvers in a forked process, in silence.

    What the import raises there, as exceptions do, is left to the import that follows.

    Raises:
        PluginError: if the process does not come back from that or does not end, or if something is changed or left
            behind that the run depends on.
    """
    for module in _WATCHED:
        import_module(f"..{module}", __package__)
    reading, writing = os.pipe()
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _import_and_leave(file, writing, parent)
    os.close(writing)
    try:
        fault = _told_fault(child, reading, seconds)
    finally:
        os.close(reading)
        _end(child)
    if fault:
        raise PluginError(f"{file.source} {fault}; {_REMEDY}")


def _told_fault(child: int, reading: int, seconds: float) -> str:
    """Return what is wrong with the import, or nothing."""
    try:
        fault = str(read_object(reading, _LARGEST, time.monotonic() + seconds).get("fault", ""))
    except TimeoutError:
        return f"does not come back within {seconds:g} s from its import and the making of its solvers"
    except (EOFError, NoMessageError):
        return f"fails to import: {_ending(_waited(child, END_SECONDS))}"
    if fault:
        return fault
    if _waited(child, END_SECONDS) is None:
        return "keeps its process from ending, by a thread, a destructor or what it has registered with atexit"
    return ""


def _waited(child: int, seconds: float) -> int | None:
    """Wait until a child has ended; return its wait status, None if it has not by then. It stays to be reaped."""
    deadline = time.monotonic() + seconds
    while (ended := os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT)) is None:
        if time.monotonic() > deadline:
            return None
        time.sleep(1e-3)
    return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status


def _end(child: int) -> None:
    """Kill a child and all that it has started."""
    left = [child, *descendants(child)]
    send(signal.SIGSTOP, left)
    send(signal.SIGKILL, {*left, *descendants(child)})
    os.waitpid(child, 0)


def _import_and_leave(file: PluginFile, writing: int, parent: int) -> None:
    """Be the process of the trial. Never returns."""
    try:
        os.setsid()
        adopt_orphans()
        die_with(parent)
        faulthandler.disable()  # how it ends is told in a sentence
        atexit._clear()  # what the run has registered is not this process's to do
        silence = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(silence, stream)
        before = Surroundings.now()
        own = os.getpid()
        fault = _imported(file)
        if os.getpid() != own:
            return  # a process that the file forked: the answer is its parent's
        fault = fault or _disturbance(before)
        write_message(writing, json.dumps({"fault": fault}).encode())
        send(signal.SIGKILL, descendants(os.getpid()))
        if not fault:
            _finish(file)
    finally:
        os._exit(0)


def _imported(file: PluginFile) -> str:
    """Import the file and make what it offers; return a fault that the import after this one would not survive."""
    try:
        make_importable(file)
        for name, factory in file.solvers().items():
            with contextlib.suppress(Exception):
                pickle.dumps(made(name, file.source, factory, {}))
    except (Exception, SystemExit):
        pass
    except BaseException as error:
        return f"fails to import: {told(error)}"
    return ""


def _disturbance(before: Surroundings) -> str:
    """Return what the import has changed or left behind, or nothing."""
    replaced = before.replaced()
    if replaced:
        return f"replaces {replaced[0]}{' and more' if replaced[1:] else ''} when it is imported"
    changed = [what for what in before.changed() if what in _SHARED]
    if changed:
        return f"changes {' and '.join(changed)} when it is imported"
    processes = [what for what in before.left() if "process" in what]
    return f"leaves {processes[0]} behind when it is imported" if processes else ""


def _finish(file: PluginFile) -> None:
    """Do what Python does at the end of a process, which a plugin may keep from ending."""
    with contextlib.suppress(BaseException):
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        module = sys.modules.pop(file.module_name, None)
        names = vars(module) if module is not None else {}
        for name in sorted(names, key=lambda name: not name.startswith("_")):  # in the order in which Python does it
            if name != "__builtins__":
                names[name] = None
        gc.collect()


def _ending(status: int | None) -> str:
    if status is None:
        return "it closes what connects its process to others"
    if status >= 0:
        return f"it ends the process with exit code {status}"
    known = {int(one): one.name for one in signal.Signals}
    return f"it ends the process with {known.get(-status, f'signal {-status}')}"
