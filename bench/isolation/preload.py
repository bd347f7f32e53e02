"""Imported once by the server that processes of cases are forked from: libraries loaded, built-in kernels compiled.

A forked case then starts in milliseconds instead of importing and compiling everything again.
"""

import gc
import io
from collections.abc import Iterator

import numpy as np

from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Stop
from ...problems.exchange.catalog import load
from ...problems.exchange.storage import problem_bytes, read_problem
from ...solvers.registry import BUILT_IN, create
from . import supervisor

__all__ = ["supervisor"]


REAL = ("hard-no-motion", "hard-sticking-box", "woodpecker-beak-impact")
"""Problems of the library with contacts that share bodies, without friction, spatial and planar."""


def _problems() -> Iterator[ContactProblem]:
    """Yield tiny problems of each width, of one contact and as cases read them."""
    for dim in (1, 2, 3):
        directions = np.eye(6)[:, :dim]
        yield ContactProblem.from_factors(directions, np.ones(6), -np.ones(dim), 0.3, dim=dim)
    for name in REAL:
        yield read_problem(io.BytesIO(problem_bytes(load(name).anonymous())), name)


def _touch_kernels() -> None:
    """Solve these problems with each built-in solver, so that every kernel is in memory."""
    for problem in _problems():
        for name, module in BUILT_IN.items():
            if "cvxpy" in module:  # takes seconds to import, and few runs need it
                continue
            solver = create(name)
            if not solver.supports(problem):
                solver.prepare(problem.fresh()).solve(Stop(1e-8, max_iterations=200, max_seconds=0.1))


_touch_kernels()
gc.collect()
gc.freeze()  # a case that collects garbage need not look through all of this, and copy its pages by doing so
