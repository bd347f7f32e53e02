"""Imported once by the server that processes of cases are forked from: libraries loaded, built-in kernels compiled.

A forked case then starts in milliseconds instead of importing and compiling everything again.
"""

import gc

import numpy as np

from ...problems.contact.problem import ContactProblem
from ...solvers.interface import Stop
from ...solvers.registry import BUILT_IN, create
from . import supervisor

__all__ = ["supervisor"]


def _touch_kernels() -> None:
    """Solve one tiny problem of each width with each built-in solver, so that every kernel is in memory."""
    for dim in (1, 2, 3):
        directions = np.eye(6)[:, :dim]
        problem = ContactProblem.from_factors(directions, np.ones(6), -np.ones(dim), 0.3, dim=dim)
        for name, module in BUILT_IN.items():
            if "cvxpy" in module:  # takes seconds to import, and few runs need it
                continue
            solver = create(name)
            if not solver.supports(problem):
                solver.prepare(problem.fresh()).solve(Stop(1e-3, max_iterations=3))


_touch_kernels()
gc.collect()
gc.freeze()  # a case that collects garbage need not look through all of this, and copy its pages by doing so
