"""How problems are solved: one interface, and one file for each method."""

from ..problems.model import Model
from .interface import Observer, Prepared, Solution, Solver, SolverError, Status, Stop
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
    "solve",
]
