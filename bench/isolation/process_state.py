"""The global state of a process, and its changes.

A plugin shares its process with the framework. If it replaces a function of the framework, of ``time`` or of NumPy,
or changes a setting of the interpreter, times and residuals can be silently wrong.
"""

import _thread
import gc
import locale
import os
import random
import resource
import signal
import sys
import tracemalloc
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from types import FunctionType, ModuleType
from typing import Any, Self

import numpy as np

_FRAMEWORK = f"{__name__.partition('.')[0]}."

_REQUIRED_MODULES = ("builtins", "time", "os", "math", "json", "pickle", "numpy", "numpy.linalg")
"""Modules that the framework relies on."""

_CLASS_CACHES = {
    "__slotnames__",
    "__protocol_attrs__",
    "__non_callable_proto_members__",
    "__annotations__",
    "_abc_impl",
}
"""Attributes that Python itself adds to classes."""

_N_MONITORING_TOOLS = 6
"""Number of identifiers of tools in ``sys.monitoring``."""

_LIMITS = tuple(getattr(resource, name) for name in sorted(dir(resource)) if name.startswith("RLIMIT_"))
"""Resource limits that the system supports."""


@dataclass(frozen=True)
class ProcessState:
    """The state of a process at one time.

    Attributes:
        modules: names of the loaded modules.
        names: objects by name, for each module of the framework and those that it relies on.
        settings: global settings of the process, by description.
        n_threads: number of Python threads besides the main one, including those unknown to ``threading``.
    """

    modules: frozenset[str]
    names: dict[str, dict[str, object]]
    settings: dict[str, Any]
    n_threads: int

    @staticmethod
    def now() -> "ProcessState":
        """Return the current state of this process."""
        return ProcessState(
            frozenset(sys.modules),
            {
                name: _objects_by_name(name)
                for name in sys.modules
                if name in _REQUIRED_MODULES or f"{name}.".startswith(_FRAMEWORK)
            },
            {name: _read_setting(read) for name, read in _SETTINGS.items()},
            _thread._count(),
        )

    def after_imports(self) -> Self:
        """Return this state. If modules were imported since, update the settings that libraries change on import."""
        if self.modules.issuperset(sys.modules):
            return self
        return replace(
            self, settings=self.settings | {name: _read_setting(_SETTINGS[name]) for name in _IMPORT_SETTINGS}
        )

    def replaced_names(self) -> list[str]:
        """Return the names that were replaced or removed, and those added to modules and classes of the framework."""
        replaced: list[str] = []
        for module, before in self.names.items():
            now = _objects_by_name(module)
            names = before if module in _REQUIRED_MODULES else before | now
            replaced += [
                f"{module}.{name}" for name in names if now.get(name, _NOTHING) is not before.get(name, _NOTHING)
            ]
        return replaced

    def changed_settings(self) -> list[str]:
        """Return the descriptions of changed settings."""
        return self._changed(_SETTINGS)

    def changed_timing_settings(self) -> list[str]:
        """Return the descriptions of changed settings that affect timing."""
        return self._changed(_TIMING_SETTINGS)

    def _changed(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if _read_setting(_SETTINGS[name]) != self.settings[name]]


_NOTHING = object()
"""Stands for the object of a name that does not exist."""


def _objects_by_name(module_name: str) -> dict[str, object]:
    """Return the objects of a module by name; none if it is not loaded.

    For a module of the framework, these include members of classes and code of functions. For one of
    ``_REQUIRED_MODULES``, they are its callable objects only.
    """
    module, objects = sys.modules.get(module_name), dict[str, object]()
    for key, value in list(vars(module).items()) if module else ():
        if module_name in _REQUIRED_MODULES:
            if callable(value):
                objects[key] = value
            continue
        if key.startswith("__") or isinstance(value, ModuleType):
            continue
        objects[key] = value
        if getattr(value, "__module__", None) != module_name:
            continue
        if isinstance(value, type):
            objects |= {f"{key}.{name}": member for name, member in vars(value).items() if name not in _CLASS_CACHES}
        elif isinstance(value, FunctionType):
            objects[f"{key}.__code__"] = value.__code__
    return objects


def _read_setting(read: Callable[[], Any]) -> Any:
    """Return the value of a setting, or the error as text if it cannot be read."""
    try:
        return read()
    except (OSError, ValueError) as error:
        return repr(error)  # a removed folder, a closed stream


def _numpy_random() -> tuple[Any, ...]:
    kind, key, *rest = np.random.get_state()  # noqa: NPY002 - detects whether a solver used it
    return kind, np.asarray(key).tobytes(), *rest


def _monitoring_tools() -> list[str | None]:
    """Return the tools that monitor events of the interpreter (Python 3.12 and later)."""
    monitoring = getattr(sys, "monitoring", None)
    return [] if monitoring is None else [monitoring.get_tool(number) for number in range(_N_MONITORING_TOOLS)]


def _scheduling() -> tuple[int, int | None]:
    """Return the priority of this process, and its scheduling policy if the system has several."""
    policy = os.sched_getscheduler(0) if hasattr(os, "sched_getscheduler") else None
    return os.getpriority(os.PRIO_PROCESS, 0), policy


def _streams() -> list[tuple[int, bool]]:
    """Return the identity of each standard stream, and whether it is closed."""
    return [(id(stream), getattr(stream, "closed", True)) for stream in (sys.stdin, sys.stdout, sys.stderr)]


def exempt_from_collection() -> None:
    """Exempt all existing objects from later garbage collections."""
    gc.collect()
    gc.freeze()


def replacement_text(before: ProcessState) -> str:
    """Return a sentence that names a replaced object and the remedy; empty if nothing was replaced since ``before``."""
    replaced = before.replaced_names()
    more = " and more" if replaced[1:] else ""
    return f"it replaced {replaced[0]}{more}; do not modify other modules" if replaced else ""


_IMPORT_SETTINGS: dict[str, Callable[[], Any]] = {
    "the warning filters": lambda: list(warnings.filters),
    "callbacks of the garbage collector": lambda: [id(callback) for callback in gc.callbacks],
}
"""Settings that libraries change when they are imported."""

_TIMING_SETTINGS: dict[str, Callable[[], Any]] = _IMPORT_SETTINGS | {
    "numpy's error state": np.geterr,
    "numpy's buffer size": np.getbufsize,
    "the locale": lambda: locale.setlocale(locale.LC_ALL),
    "the trace function": sys.gettrace,
    "the profile function": lambda: (sys.getprofile(), _monitoring_tools()),
    "memory tracing": tracemalloc.is_tracing,
    "the settings of the garbage collector": lambda: (gc.isenabled(), gc.get_threshold()),
    "the recursion limit": sys.getrecursionlimit,
    "the switch interval": sys.getswitchinterval,
    "signal handlers": lambda: {number: signal.getsignal(number) for number in signal.Signals},
    "the alarm clock": lambda: bool(signal.getitimer(signal.ITIMER_REAL)[0]),
    "the hooks of the interpreter": lambda: (sys.excepthook, sys.displayhook, sys.unraisablehook, sys.breakpointhook),
    "the scheduling of its process": _scheduling,
    "the resource limits of its process": lambda: [resource.getrlimit(number) for number in _LIMITS],
}
"""Settings that a measurement depends on."""

_SETTINGS: dict[str, Callable[[], Any]] = _TIMING_SETTINGS | {
    "the working folder": os.getcwd,
    "the environment": lambda: dict(os.environ),
    "numpy's global random state": _numpy_random,
    "the random state of Python": random.getstate,
    "the import path": lambda: list(sys.path),
    "the standard streams": _streams,
}
"""Global settings of a process, by description."""
