"""Module that the fork server imports once, to load libraries and compile the built-in kernels.

A forked case then starts in milliseconds instead of importing and compiling everything again.
"""

import io

import scipy.sparse.csgraph  # noqa: F401  solvers import it and scipy.sparse.linalg late

from ...problems.contact.solver import Stop
from ...problems.exchange.catalog import load
from ...problems.exchange.files.problem_file import problem_bytes, read_problem
from ...solvers.registry import BUILT_IN, create
from . import supervisor
from .process_state import exempt_from_collection

__all__ = ["supervisor"]

PROBLEMS = ("hard-no-motion", "hard-sticking-box", "woodpecker-beak-impact", "hard-counterexample", "hard-mixed-laws")
"""Small problems: frictionless, spatial, planar, with G instead of its factors, and with several kinds of laws."""


def _touch_kernels() -> None:
    """Solve ``PROBLEMS`` with each built-in solver, to compile most kernels or load them from the cache."""
    for name in PROBLEMS:
        problem = read_problem(io.BytesIO(problem_bytes(load(name).anonymous())), name)
        for solver_name, module in BUILT_IN.items():
            if "cvxpy" in module:  # slow to import, and rarely needed
                continue
            solver = create(solver_name)
            if not solver.supports(problem):
                solver.prepare(problem.fresh()).solve(Stop(1e-8, max_iterations=200, max_seconds=0.1))


_touch_kernels()
exempt_from_collection()  # a garbage collection in a forked case would copy the memory pages of all objects
