"""Imported once by the server that case processes are forked from: libraries loaded, built-in kernels compiled.

A forked case then starts in milliseconds instead of importing and compiling everything again.
"""

import gc

import numpy as np

from ...problems.contact.problem import ContactProblem
from ...solvers.interface import Stop
from ...solvers.registry import solve
from ..isolation import supervisor
from . import protocol
from .plan import DEFAULT_SOLVERS

__all__ = ["protocol", "supervisor"]


def _touch_kernels() -> None:
    """Solve one tiny problem of each width with each default solver, so that every kernel is in memory."""
    for dim in (1, 2, 3):
        directions = np.eye(6)[:, :dim]
        problem = ContactProblem.from_factors(directions, np.ones(6), -np.ones(dim), 0.3, dim=dim)
        for solver in DEFAULT_SOLVERS:
            stop = Stop(1e-3, max_iterations=3)
            solve(problem.fresh(), solver, stop.tolerance, max_iterations=stop.max_iterations)


_touch_kernels()
gc.collect()
gc.freeze()  # a case that collects garbage need not look through all of this, and copy its pages by doing so
