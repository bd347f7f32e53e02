"""Solvers of contact problems: one interface, and one file per method."""

from ..problems.contact.model import Model
from ..problems.contact.solver import Observer, Prepared, Solution, Solver, SolverError, Status, Stop, shows_iterates
from ..problems.names import name_with_options
from .iteration.loop import iterate
from .registry import available, create, solve

__all__ = [
    "Model",
    "Observer",
    "Prepared",
    "Solution",
    "Solver",
    "SolverError",
    "Status",
    "Stop",
    "available",
    "create",
    "iterate",
    "name_with_options",
    "shows_iterates",
    "solve",
]
