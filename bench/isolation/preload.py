"""Libraries and kernels that the fork server loads before it forks a case.

The case then starts in milliseconds instead of importing and compiling everything again.
"""

import io
from collections.abc import Iterable

import scipy.sparse.csgraph  # noqa: F401  solvers import it and scipy.sparse.linalg only when needed

from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Stop
from ...problems.exchange.catalog import load
from ...problems.exchange.files.problem_file import problem_bytes, read_problem
from ...solvers.registry import create
from . import supervisor
from .process_state import exempt_from_collection

__all__ = ["load_kernels_of", "supervisor"]

PROBLEMS = ("hard-no-motion", "hard-sticking-box", "woodpecker-beak-impact", "hard-counterexample", "hard-mixed-laws")
"""Small problems: frictionless, spatial, planar, with G instead of its factors, and with several kinds of laws."""

_loaded: set[str] = set()
"""Solvers whose kernels this process has loaded."""


def load_kernels_of(solvers: Iterable[str]) -> None:
    """Compile most kernels of solvers, or load them from the cache, by solving ``PROBLEMS``; once for each solver.

    Args:
        solvers: names of built-in solvers, without options.
    """
    missing = [name for name in solvers if name not in _loaded]
    if not missing:
        return
    problems = [_load_as_case(name) for name in PROBLEMS]
    for name in missing:
        solver = create(name)
        for problem in problems:
            if not solver.supports(problem):
                solver.prepare(problem.fresh()).solve(Stop(1e-8, max_iterations=200, max_seconds=0.1))
    _loaded.update(missing)
    exempt_from_collection()  # a garbage collection in a forked case would copy the memory pages of all objects


def _load_as_case(name: str) -> ContactProblem:
    """Return a problem as a case reads it, from its file content and without name and answer."""
    return read_problem(io.BytesIO(problem_bytes(load(name).anonymous())), name)
