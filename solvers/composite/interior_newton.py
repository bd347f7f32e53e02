"""InteriorNewton: interior points for what happens to each contact, Newton's method for how much.

An interior point method finds from anywhere, in a few dozen factorisations, which contacts open, stick and slip. Its
last digits are slow where an answer is not strictly complementary, and its path may turn. So four methods take turns,
each from what the others have found:

    InteriorPoint       fast where the path goes straight down
    CentralPath         from the beginning, through the turns of the path
    SemismoothNewton    from where that ended: the last digits, least squares by its damping
    HybridNewton        sweeps from the best impulses, which rearrange contacts one by one where no path led

The last three come three times, each time with budgets of iterations for the path and the sweeps that are three times
as large and more. So no method keeps the others waiting for long, and what is done does not depend on the machine.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..interface import Observer, Prepared, Solution, Stop
from ..interior.central_path import CentralPath
from ..interior.interior_point import InteriorPoint
from ..interior.runs import SingleRun
from ..iteration.clock import Clock
from ..iteration.method import Method
from ..newton.semismooth_newton import SemismoothNewton
from .hybrid_newton import HybridNewton
from .relay import Relay, Turn

STRAIGHT, LAST_DIGITS = 80, 90
"""Most iterations of ``InteriorPoint`` and of ``SemismoothNewton``."""

THROUGH_TURNS, REARRANGING = (100, 300, 1000), (500, 2000)
"""Most iterations of ``CentralPath``, and of ``HybridNewton`` before the last time, in their turns."""

FEW_BODIES = 8
"""Rows for each degree of freedom from which on interior points factorise over bodies."""


@dataclass(frozen=True)
class InteriorNewton(Method):
    """Interior points, their path through its turns, Newton's method on the states found, and sweeps where all fail.

    One iteration is a Newton step, a factorisation of the path, or a sweep. Interior points factorise over bodies where
    there are far fewer of these than contacts, else over contacts.
    """

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return InteriorPoint().supports(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedInteriorNewton":
        """Prepare the first method; the others are prepared when their turn comes."""
        first = SingleRun(InteriorPoint(form=form_for(problem)))
        return PreparedInteriorNewton(problem, Residual(problem), {first.name: first.prepare(problem)})


@dataclass(frozen=True, eq=False)
class PreparedInteriorNewton:
    """The methods for one problem that have been prepared, by name."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    prepared: dict[str, Prepared] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Let the methods take turns until one solves the problem; see ``Prepared.solve``."""
        relay = Relay(self.problem, self.residual, self.prepared, stop, observe, Clock(stop.max_seconds))
        return taken_in_turn(relay, start)


def taken_in_turn(relay: Relay, start: FloatArray | None) -> Solution:
    """Let the methods take turns; the first begins at ``start``, shape (n_rows,), or at zero."""
    for turn in _turns(relay, start):
        solution = relay.take(turn)
        if solution is not None:
            return solution
    return relay.ended(relay.status, f"residual {relay.lowest:.1e}")


def form_for(problem: ContactProblem) -> Literal["delassus", "factors"]:
    """Return the form of interior points: over bodies where these are far fewer, else over contacts.

    Over bodies a step ends at a larger residual on redundant piles, because the contacts' velocities are differences
    of the bodies'.
    """
    factors = problem.factors
    return "factors" if factors is not None and FEW_BODIES * factors.n_dofs < problem.n_rows else "delassus"


def _turns(relay: Relay, start: FloatArray | None) -> Iterator[Turn]:
    problem, most = relay.problem, relay.stop.max_iterations
    zeros, form = np.zeros(problem.n_rows), form_for(problem)
    if InteriorPoint(form=form).supports(problem) is None:
        yield Turn(SingleRun(InteriorPoint(form=form)), zeros if start is None else start, STRAIGHT)
    path = SingleRun(CentralPath(form=form)) if CentralPath(form=form).supports(problem) is None else None
    for factorisations, sweeps in zip(THROUGH_TURNS, (*REARRANGING, most), strict=True):
        if path is not None:
            yield Turn(path, zeros, factorisations)
        # swept impulses may be better than the path's end, and know less of what happens to the contacts
        yield Turn(SemismoothNewton(), relay.latest, LAST_DIGITS)
        yield Turn(HybridNewton(), None, sweeps)
