"""MuJoCo's constraint solvers, applied to the cone program of a contact problem or of a captured step."""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal, get_args

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import residual_under
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop
from ..iteration.loop import infeasible_solution, initial_impulses
from ..iteration.method import Method, check_option
from ..iteration.stopping import Clock
from .installed import check_installed
from .mujoco_problem import TESTED_VERSION, ConstraintStage
from .mujoco_program import program_of, unsupported_reason
from .rounds import TIME_SHARE

Algorithm = Literal["Newton", "CG", "PGS"]

OWN_TOLERANCES = (*(10.0**-digits for digits in range(2, 17)), 1e-30)
"""Values of MuJoCo's own tolerance, on the cost, in successive calls; the last one is met only owing to rounding."""

FIRST_ITERATIONS, GROWTH = 100, 10
"""Iteration limit of the first call, and factor of the limit after a call that does not meet MuJoCo's tolerance."""


@dataclass(frozen=True)
class MuJoCo(Method):
    """MuJoCo's constraint solvers, called through ``mj_fwdConstraint`` alone (Todorov 2014).

    They minimise ½ Λᵀ (G + R) Λ + Λᵀ c over the friction cones, with R = (1 − d)/d α, where α is the largest diagonal
    entry of G for a contact. MuJoCo's default d is 0.9 to 0.95; models with hard contacts use 0.99 or more. This is the
    convex model with compliance: the smaller R is, the harder the contacts are, and the slower the solvers converge.

    In a captured step they solve the program of the engine, with the A, R, b and cones that the problem holds, and
    ``impedance`` has no effect. The model is ``Model.ENGINE``, so that a claim of success there refers to this program.

    A solve calls ``mj_fwdConstraint`` from the same start with successively smaller values of MuJoCo's own tolerance,
    until the judge's residual reaches the tolerance of the solve. ``proxbench run`` counts only the time of the call
    that reaches this tolerance.

    Attributes:
        algorithm: ``"Newton"``, ``"CG"`` or ``"PGS"``.
        impedance: d, between 0 and 1.

    Raises:
        SolverError: if MuJoCo is not installed, or an option is out of range.
    """

    algorithm: Algorithm = "Newton"
    impedance: float = 0.95

    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_installed("MuJoCo", "mujoco", "mujoco", TESTED_VERSION)
        known = get_args(Algorithm)
        check_option("algorithm", self.algorithm, self.algorithm in known, "one of " + ", ".join(known))
        is_valid = isinstance(self.impedance, int | float) and 0.0 < self.impedance < 1.0
        check_option("impedance", self.impedance, is_valid, "between 0 and 1")

    @property
    def model(self) -> Model:
        """The program of the engine in a captured step, the convex model of any other problem."""
        return Model.ENGINE

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or unsupported_reason(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedMuJoCo":
        """Return the solver with a MuJoCo model that has as many coordinates and rows as the problem, and its data."""
        self.check_supports(problem)
        return PreparedMuJoCo(problem, self)


@dataclass(frozen=True)
class _Result:
    """The result of one call, or the start of a solve.

    Attributes:
        impulses: Λ [N s], shape (n_rows,).
        residual: the judge's residual in the model of the solver.
        iterations: iterations of the call; for the start of a solve, those of the last call.
        seconds: wall time of ``mj_fwdConstraint`` [s]; None for a start.
    """

    impulses: FloatArray
    residual: float
    iterations: int = 0
    seconds: float | None = None


class PreparedMuJoCo:
    """MuJoCo's constraint stage prepared for one problem.

    Attributes:
        problem: the problem.
        residual: its residual in the model of the solver.
        library_seconds: wall time of ``mj_fwdConstraint`` in the call whose result the last solve returned [s]; None if
            that is the start of the solve.
    """

    def __init__(self, problem: ContactProblem, options: MuJoCo) -> None:
        self.problem, self.residual = problem, residual_under(problem, Model.ENGINE)
        self.library_seconds: float | None = None
        self._stage = ConstraintStage(program_of(problem, options.impedance), options.algorithm)
        self._stage.run(OWN_TOLERANCES[0], iterations=1)  # the first call maps the memory of the stage

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve until the judge's residual reaches the tolerance; the observer is ignored.

        Newton and CG start from the accelerations that the impulses ``start`` cause; PGS starts from zero.
        """
        check_stop(stop)
        self.library_seconds = None
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        first = initial_impulses(self.problem, self.residual, start)
        best, status = self._search(stop, _Result(first, self.residual.judged(self.problem, first)))
        self.library_seconds = best.seconds
        reason = "" if status is Status.SOLVED else f"residual {best.residual:.1e}"
        if status is Status.STALLED:
            reason = f"its own tolerance {OWN_TOLERANCES[-1]:.0e} is met, but the residual is {best.residual:.1e}"
        return Solution(best.impulses, status, best.iterations, reason)

    def _search(self, stop: Stop, start: _Result) -> tuple[_Result, Status]:
        """Return the best result of calls with successively smaller tolerances, and the status of the solve."""
        clock, best, index = Clock(stop.max_seconds), start, 0
        iteration_limit, seconds_per_iteration = FIRST_ITERATIONS, 0.0
        while best.residual > stop.tolerance:
            if index == len(OWN_TOLERANCES):
                return best, Status.STALLED
            count = min(iteration_limit, stop.max_iterations)
            if seconds_per_iteration > 0.0:
                count = min(count, int(TIME_SHARE * clock.remaining / seconds_per_iteration))
            if count < 1:
                return best, Status.TIME_LIMIT if stop.max_iterations else Status.ITERATION_LIMIT
            result, seconds_per_iteration = self._call(start.impulses, OWN_TOLERANCES[index], count)
            if not np.isfinite(result.impulses).all():
                return best, Status.DIVERGED
            if result.residual < best.residual:
                best = result
            elif best is start:
                best = start = replace(start, iterations=result.iterations)
            if result.iterations < count:
                index += 1
            elif count < stop.max_iterations:
                iteration_limit *= GROWTH
            elif best.residual > stop.tolerance:
                return best, Status.ITERATION_LIMIT
        return best, Status.SOLVED

    def _call(self, start: FloatArray, tolerance: float, iterations: int) -> tuple[_Result, float]:
        """Return the result of one call from ``start`` to MuJoCo's ``tolerance``, and the time of an iteration [s]."""
        stage = self._stage
        stage.start(start)
        seconds = stage.run(tolerance, iterations)
        impulses, done = stage.impulses, max(stage.iterations, 1)
        return _Result(impulses, self.residual.judged(self.problem, impulses), done, seconds), seconds / done
