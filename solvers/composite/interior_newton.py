"""InteriorNewton: interior points for what happens to each contact, sweeps and Newton's method for how much.

An interior point method finds from anywhere, in a few dozen factorisations, which contacts open, stick and slip. Its
last digits are slow where an answer is not strictly complementary, and its path may turn. Sweeps with momentum find
these digits mostly in a few hundred sweeps, which take less time than two factorisations. So these take turns:

    InteriorPoint      fast where the path goes straight down
    NesterovSORprox    from where that ended, the last digits
    CentralPath        from the beginning, through the turns of the path
    NesterovSORprox    from where that ended
    ProximalPoint      from there too: Newton's method, regular however many contacts are redundant
    HybridNewton       sweeps from the best impulses, which rearrange contacts one by one where no path led

The last four come five times, with budgets of iterations for the path and the sweeps that grow. The path goes on where
it was left. Where it has ended, and in the fourth turn, it is followed from the beginning with series of another order,
which lead on where the first ones go in circles. So no method keeps the others waiting for long, and what is done does
not depend on the speed of the machine.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.matrices.pieces import Pieces
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Prepared, Solution, Stop
from ..interior.central_path import CentralPath, PathInTurns
from ..interior.interior_point import InteriorPoint
from ..interior.runs import SingleRun
from ..iteration.clock import Clock
from ..iteration.method import Method
from ..newton.proximal_point import ProximalPoint
from .hybrid_newton import HybridNewton
from .relay import Relay, Turn
from .sweeping import last_digits_for

STRAIGHT, LAST_SWEEPS, LAST_STEPS = 80, 500, 40
"""Most iterations of ``InteriorPoint``, of the sweeps after it and after the path, and of ``ProximalPoint``."""

THROUGH_TURNS = ((6, 100), (6, 200), (6, 400), (10, 1000), (6, 1000))
"""Orders and most iterations of ``CentralPath`` in its turns."""

REARRANGING = (500, 1000, 2000, 2000)
"""Most iterations of ``HybridNewton`` in its turns before the last."""

REDUNDANT = 2
"""Rows for each degree of freedom from which on interior points factorise over bodies, if pairs are held more than once
too."""


@dataclass(frozen=True)
class InteriorNewton(Method):
    """Interior points, their path through its turns, sweeps and Newton's method for the last digits, in turn.

    One iteration is a Newton step, a factorisation of the path, or a sweep. Interior points factorise over bodies where
    several contacts of the same two over-determine how these move, else over contacts.
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
    """Return the form of interior points: over bodies where contacts of the same two over-determine how these move.

    The contacts of a pair of bodies, or of a body and the ground, then say the same several times, in a dense block of
    G for each two of them. Elsewhere a step over bodies ends at a larger residual, because the contacts' velocities are
    differences of the bodies', and saves little.
    """
    if problem.factors is None or problem.n_rows <= REDUNDANT * problem.factors.n_dofs:
        return "delassus"
    pieces = problem.factor_pieces()
    return "factors" if problem.n_rows > pieces.length * _n_pairs(pieces) else "delassus"


def _n_pairs(pieces: Pieces) -> int:
    """Return how many different sets of bodies contacts touch, each counted by its first and last one."""
    block = np.repeat(np.arange(pieces.n_blocks), np.diff(pieces.starts))
    first, last = np.full(pieces.n_blocks, pieces.n_chunks), np.full(pieces.n_blocks, -1)
    is_body = pieces.chunks < pieces.n_chunks
    np.minimum.at(first, block[is_body], pieces.chunks[is_body])
    np.maximum.at(last, block[is_body], pieces.chunks[is_body])
    return len(np.unique(first * (pieces.n_chunks + 1) + last))


def _turns(relay: Relay, start: FloatArray | None) -> Iterator[Turn]:
    problem, most = relay.problem, relay.stop.max_iterations
    zeros, form = np.zeros(problem.n_rows), form_for(problem)
    yield relay.turn(SingleRun(InteriorPoint(form=form)), zeros if start is None else start, STRAIGHT)
    sweeps, end = last_digits_for(problem), relay.latest
    yield relay.turn(sweeps, end, LAST_SWEEPS)
    methods = [CentralPath(order, form) for order, _ in THROUGH_TURNS]
    paths = {path.order: PathInTurns(path, problem) for path in methods if path.supports(problem) is None}
    for (order, factorisations), rearranging in zip(THROUGH_TURNS, (*REARRANGING, most), strict=True):
        path = paths.get(order) or next(iter(paths.values()), None)
        if path is not None:
            yield Turn(path.method.name, path, zeros, factorisations)
            end = relay.latest
            if path.has_ended:
                del paths[path.method.order]
            yield relay.turn(sweeps, end, LAST_SWEEPS)
        # swept impulses may be better than the path's end, and know less of what happens to the contacts
        yield relay.turn(ProximalPoint(), end, LAST_STEPS)
        yield relay.turn(HybridNewton(), None, rearranging)
