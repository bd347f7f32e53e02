"""Whether the library of an outside solver is installed; nothing is imported to find out."""

import importlib
from importlib.util import find_spec
from typing import Any

from ...problems.contact.solver import SolverError

INSTALL = 'pip install ".[peers]"'
"""The command that installs the libraries of all outside solvers."""


def missing(module: str) -> str:
    """Say what is missing and how it is installed; empty if the module is there."""
    return "" if find_spec(module) is not None else f"{module} is not installed; run {INSTALL} in a clone of proxbench"


def check_installed(solver: str, module: str) -> None:
    """Raise ``SolverError`` unless a module is installed."""
    reason = missing(module)
    if reason:
        raise SolverError(f"{solver} cannot be used: {reason}")


def imported(module: str) -> Any:
    """Return a module, imported when it is first needed: solvers of others work in children only."""
    return importlib.import_module(module)
