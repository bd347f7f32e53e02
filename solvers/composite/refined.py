"""Refined: a solver whose iterates are refined by Newton steps on the states that they identify.

An interior point method soon identifies which contacts are open, stick or slip. Its impulses, however, follow the
central path, and their error is about the square root of its tolerance. Once the states are right, the problem is a
system of equations, the projection equations of ``linearised`` (Alart & Curnier 1991; Burke & Moré 1988 prove that
projections identify the states). It is linear except for the direction of slip, so a few Newton steps solve it. A step
that does not reduce the judge's residual is discarded, because it started from wrong states.
"""

from dataclasses import dataclass, replace
from functools import partial

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import SolverError
from ..conic.fixed_point import Correction, FixedPointMethod, PreparedFixedPoint
from ..iteration.method import Method
from ..iteration.stopping import Clock
from ..newton.linearised import Equations
from ..newton.steps import LINE_SEARCH, THOROUGH, NewtonMethod, NewtonSettings

REFINEMENT = NewtonSettings(damping=1e-12, max_steps=4, patience=1)
"""Settings on identified states: each step must reduce the residual, and halve it if another step is to follow."""

SUCCESS = 0.1
"""If a refinement reduces the residual to less than this fraction, the next iterate is refined too."""

MAX_WAIT_ITERATIONS = 8
"""Largest number of iterations between a failed refinement and the next one."""

FIRST_SEARCH = 4
"""Iteration of a phase at which Newton's method first uses a line search. For each later line search, the number of the
iteration doubles."""


@dataclass(frozen=True)
class Refined(Method):
    """A fixed-point iteration over cone programs, with Newton steps from its iterates: ``Refined(ClarabelCoulomb)``.

    Attributes:
        solver: ``ClarabelCoulomb`` or ``CvxpyCoulomb`` with any options; one iteration is an iteration of this solver.

    Raises:
        SolverError: if the solver is not one of these two.
    """

    solver: FixedPointMethod

    def __post_init__(self) -> None:
        solver: object = self.solver
        if not isinstance(solver, FixedPointMethod):
            shown = getattr(solver, "name", repr(solver))
            raise SolverError(
                f"Refined cannot refine {shown}, which does not offer its iterates; "
                "use ClarabelCoulomb or CvxpyCoulomb."
            )

    @property
    def name(self) -> str:
        """Class name with the name of the solver."""
        return f"{type(self).__name__}({self.solver.name})"

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return self.solver.supports(problem)

    def prepare(self, problem: ContactProblem) -> PreparedFixedPoint:
        """Prepare the solver."""
        return replace(self.solver.prepare(problem), correction=partial(Refinement, problem, Residual(problem)))


class Refinement(Correction):
    """Newton steps from the iterates of one solve: less often after failures, and always at the end of a phase."""

    def __init__(self, problem: ContactProblem, residual: Residual, clock: Clock, tolerance: float) -> None:
        super().__init__(clock, tolerance)
        self._problem, self._residual = problem, residual
        self._newton: NewtonMethod | None = None
        self.begin_phase()

    def begin_phase(self) -> None:
        """See ``Correction``."""
        self._n_iterates, self._wait_iterations, self._next_refinement, self._next_search = 0, 1, 2, FIRST_SEARCH

    def correct(self, impulses: FloatArray, residual: float, is_last: bool) -> tuple[FloatArray, float]:
        """See ``Correction``."""
        self._n_iterates += 1
        if residual <= self.tolerance:
            return impulses, residual
        if is_last:
            return self._refine(THOROUGH, impulses, residual)
        if self._n_iterates >= self._next_search:
            self._next_search = 2 * self._n_iterates
            return self._refine((LINE_SEARCH,), impulses, residual)
        if self._n_iterates < self._next_refinement:
            return impulses, residual
        refined, refined_residual = self._refine((REFINEMENT,), impulses, residual)
        is_success = refined_residual < SUCCESS * residual
        self._wait_iterations = 1 if is_success else min(2 * self._wait_iterations, MAX_WAIT_ITERATIONS)
        self._next_refinement = self._n_iterates + self._wait_iterations
        return refined, refined_residual

    def _refine(
        self, attempts: tuple[NewtonSettings, ...], impulses: FloatArray, residual: float
    ) -> tuple[FloatArray, float]:
        if self._newton is None:  # created late, because the equations assemble G
            self._newton = NewtonMethod(Equations(self._problem, self._residual), self.clock, self.tolerance)
        best, lowest = impulses, residual
        for settings in attempts:
            if lowest <= self.tolerance or self.clock.has_expired:
                break
            refined, refined_residual = self._newton.run(
                settings, impulses, residual, lambda _: not self.clock.has_expired
            )
            if refined_residual < lowest:
                best, lowest = refined, refined_residual
        return best, lowest
