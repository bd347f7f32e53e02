"""Refined: a solver whose iterates are taken further by Newton steps on the states that they identify.

An interior point method knows early which contacts are open, stick and slip, but its impulses keep an error of about
the square root of its tolerance, because they follow the central path. Once the states are right nothing but a linear
system is left of the problem, the projection equations of ``linearised`` (Alart & Curnier 1991; that a projection
identifies the states: Burke & Moré 1988). One Newton step solves it up to the curvature of slip, whose direction the
next steps correct. Where a step does not lower the judge's residual the states were not right, and the impulses stay
as they were.
"""

from dataclasses import dataclass
from functools import partial

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Prepared, SolverError
from ..iteration.clock import Clock
from ..iteration.correction import Correctable
from ..iteration.method import Method
from ..newton.linearised import Equations
from ..newton.steps import SEARCHING, THOROUGH, Attempt, Newton
from ..newton.work import Work

CLOSE = Attempt(damping=1e-12, most_steps=4, patience=1)
"""What is tried on identified states: each step has to lower the residual, and by half to be followed by another."""

JUMP = 0.1
"""A refinement to below this share of the residual is a success: the next iterate is refined too."""

LONGEST_WAIT = 8
"""Most iterations from a refinement without success to the next one."""

FIRST_SEARCH = 4
"""Iterations of a phase before Newton's method searches from one; then after twice as many, and so on."""


@dataclass(frozen=True)
class Refined(Method):
    """A fixed point over cone programs with Newton steps from its iterates: ``Refined(ClarabelCoulomb)``.

    Attributes:
        solver: what iterates, ``ClarabelCoulomb`` or ``CvxpyCoulomb`` with any options; one iteration is one of its.

    Raises:
        SolverError: if it does not offer its iterates.
    """

    solver: Correctable

    def __post_init__(self) -> None:
        if not isinstance(self.solver, Correctable) or self.solver.model != Model.COULOMB:
            raise SolverError(
                f"{self.solver.name} does not offer its iterates to a refinement; ClarabelCoulomb and CvxpyCoulomb do."
            )

    @property
    def name(self) -> str:
        """Class name with that of the solver."""
        return f"{type(self).__name__}({self.solver.name})"

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return self.solver.supports(problem)

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Do what the solver does."""
        return self.solver.prepare_corrected(problem, partial(Refinement, problem, Residual(problem)))


class Refinement:
    """Newton steps from the iterates of one solve: after failures less and less often, at the end by all means."""

    def __init__(self, problem: ContactProblem, residual: Residual, clock: Clock, tolerance: float) -> None:
        self._problem, self._residual, self._clock, self._tolerance = problem, residual, clock, tolerance
        self._newton: Newton | None = None
        self.begin_phase()

    def begin_phase(self) -> None:
        """See ``iteration.correction``."""
        self._seen, self._wait, self._next, self._search = 0, 1, 2, FIRST_SEARCH

    def corrected(self, impulses: FloatArray, residual: float, is_last: bool) -> tuple[FloatArray, float]:
        """See ``iteration.correction``."""
        self._seen += 1
        if residual <= self._tolerance:
            return impulses, residual
        if is_last:
            return self._tried(THOROUGH, impulses, residual)
        if self._seen >= self._search:
            self._search = 2 * self._seen
            return self._tried((SEARCHING,), impulses, residual)
        if self._seen < self._next:
            return impulses, residual
        found, reached = self._tried((CLOSE,), impulses, residual)
        self._wait = 1 if reached < JUMP * residual else min(2 * self._wait, LONGEST_WAIT)
        self._next = self._seen + self._wait
        return found, reached

    def _tried(self, attempts: tuple[Attempt, ...], impulses: FloatArray, residual: float) -> tuple[FloatArray, float]:
        if self._newton is None:  # assembles G, which is not needed if nothing is refined
            equations = Equations(self._problem, self._residual)
            work = Work(equations.entries)
            self._newton = Newton(self._problem, self._residual, equations, self._clock, self._tolerance, work)
        best, lowest = impulses, residual
        for attempt in attempts:
            if lowest <= self._tolerance or self._clock.is_up:
                break
            found, reached = self._newton.followed(attempt, impulses, residual, lambda _: not self._clock.is_up)
            if reached < lowest:
                best, lowest = found, reached
        return best, lowest
