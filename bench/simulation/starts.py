"""Starts of the solve of a step: warm (from the last impulses), scaled (from a fraction of them), cold (from zero)."""

from dataclasses import dataclass

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Observer, Prepared, Solution, Solver, Stop
from ...problems.errors import suggestion
from ...problems.motion.stepping.stepper import Stepper
from ...solvers.composite.fallback import Fallback
from ..errors import BenchError

WARM, COLD, WARM_THEN_COLD, SCALED = STARTS = ("warm", "cold", "warm-then-cold", "scaled")
"""Names of starts."""

DEFAULT_START = WARM
"""The default start, which needs the fewest sweeps on most scenes and tolerances."""

WARM_ITERATIONS = 500
"""Iterations from the last impulses before "warm-then-cold" starts from zero: in a pile at rest they may stall."""


class UnsupportedStepError(BenchError):
    """The solver does not support the contact problem of a step."""


def default_start(stepper: Stepper) -> str:
    """Return the default start of a stepper, which is cold if the stepper provides no impulses."""
    return DEFAULT_START if stepper.uses_last_impulses else COLD


def check_start(name: str) -> None:
    """Check the name of a start.

    Raises:
        BenchError: if the name is unknown, with the nearest name.
    """
    if not isinstance(name, str) or name not in STARTS:
        raise BenchError(f"there is no start {name!r:.60}{suggestion(str(name), STARTS)}")


@dataclass(frozen=True)
class StepSolver:
    """A solver with a start, in the form that steppers require.

    Attributes:
        solver: the solver.
        start: one of ``STARTS``.
    """

    solver: Solver
    start: str

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Prepare ``problem``; ``solve`` of the result receives the impulses of the last step.

        Raises:
            UnsupportedStepError: if the solver does not support the problem.
        """
        reason = self.solver.supports(problem)
        if reason:
            raise UnsupportedStepError(f"its solver does not support this step: {reason}")
        if self.start == WARM_THEN_COLD:
            return Fallback(self.solver, warm_iterations=WARM_ITERATIONS).prepare(problem)
        prepared = self.solver.prepare(problem)
        if self.start == SCALED:
            return _FromScaled(prepared, problem)
        return _FromZero(prepared) if self.start == COLD else prepared


@dataclass(frozen=True)
class _FromZero:
    """A prepared solver that ignores the given start."""

    prepared: Prepared

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        return self.prepared.solve(stop, None, observe)


@dataclass(frozen=True)
class _FromScaled:
    """A prepared solver that starts from a fraction of the given impulses."""

    prepared: Prepared
    problem: ContactProblem

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        scaled = None if start is None else scaled_start(self.problem, start)
        return self.prepared.solve(stop, scaled, observe)


def scaled_start(problem: ContactProblem, impulses: FloatArray) -> FloatArray:
    """Return s Λ with the s in [0, 1] that minimizes the energy, shape (n_rows,); Λ itself if ΛᵀGΛ is not positive.

    Of all multiples of Λ, s = −Λᵀc / ΛᵀGΛ minimizes the energy ½ s² ΛᵀGΛ + s Λᵀc. Without friction, the solution
    minimizes the energy over all admissible impulses. At rest the last impulses almost solve the next step, and s is
    near 1; after impacts s is small. All sets of admissible impulses contain s Λ if they contain Λ.

    Args:
        problem: the problem.
        impulses: Λ [N s], shape (n_rows,).
    """
    curvature = float(impulses @ (problem.relative_velocity(impulses) - problem.free_velocity))
    if not curvature > 0.0:
        return impulses
    factor = -float(impulses @ problem.free_velocity) / curvature
    return min(max(factor, 0.0), 1.0) * impulses
