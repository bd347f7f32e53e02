"""PinocchioADMM: the alternating direction method of multipliers of Pinocchio."""

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ..iteration.method import Method, check_option
from .installed import check_installed
from .pinocchio_problem import Contacts, call_with_stack, pinocchio, unsupported_reason
from .rounds import Call, PreparedRounds, Round

TOLERANCE_RATIO = 0.5
"""Pinocchio's first tolerance, relative to that of the solve; in scaled units, both measure nearly the same."""

STEP_SECONDS = 1e-9
"""Time of a Lanczos step per row of G and per earlier step [s]; vectors are orthogonalised against all earlier ones."""

LANCZOS_SHARE = 0.5
"""Largest share of the time limit for Lanczos steps, which cannot be interrupted."""

Update = Literal["constant", "linear", "osqp", "spectral"]


@dataclass(frozen=True)
class PinocchioADMM(Method):
    """Pinocchio's ADMM for Coulomb friction in De Saxcé's form (Carpentier, Le Lidec & Montaut 2024).

    It factorises sparse G with a penalty on the diagonal and projects onto the friction cones. Its own criterion is the
    largest of primal infeasibility, dual infeasibility and complementarity. The options have Pinocchio's defaults.

    Attributes:
        anderson: number of iterates that Anderson acceleration keeps, 0 for no acceleration.
        lanczos: number of steps of the Lanczos decomposition that estimates the spectrum of G; 0 means one per row. The
            number is reduced if the steps would take more than half the time limit, as on thousands of contacts.
        update: rule for changes of the penalty.

    Raises:
        SolverError: if Pinocchio is not installed, or an option is out of range.
    """

    anderson: int = 0
    lanczos: int = 0
    update: Update = "osqp"

    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_installed("PinocchioADMM", "pinocchio", "peers")
        is_valid = type(self.anderson) is int and self.anderson >= 0
        check_option("anderson", self.anderson, is_valid, "an integer, 0 or more")
        is_valid = type(self.lanczos) is int and (self.lanczos == 0 or self.lanczos >= 2)
        check_option("lanczos", self.lanczos, is_valid, "0, or an integer of 2 or more")
        check_option("update", self.update, self.update in get_args(Update), "one of " + ", ".join(get_args(Update)))

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or unsupported_reason(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedADMM":
        """Assemble scaled G and the contacts."""
        self.check_supports(problem)
        return PreparedADMM(problem, self)


def lanczos_steps(requested: int, n_rows: int, max_seconds: float) -> int:
    """Return the number of Lanczos steps: the option, at most one per row, reduced to the time limit but not below two.

    The time is estimated, not measured, so that solves with equal limits have equal results.

    Args:
        requested: the option; 0 means one per row.
        n_rows: rows of G.
        max_seconds: time limit of the solve [s].
    """
    max_squared_steps = LANCZOS_SHARE * max_seconds / (STEP_SECONDS * max(n_rows, 1))
    steps = min(requested or n_rows, n_rows)
    return steps if steps**2 <= max_squared_steps else max(2, int(max_squared_steps**0.5))


class PreparedADMM(PreparedRounds):
    """ADMM prepared for one problem."""

    first_iterations, growth = 100, 10.0

    def __init__(self, problem: ContactProblem, options: PinocchioADMM) -> None:
        super().__init__(problem)
        self._options, self._contacts = options, Contacts.of(problem)

    def begin(self, max_seconds: float) -> Call:
        """Return the solver; its penalty and its iterates persist from one round to the next."""
        pin, contacts, options = pinocchio(), self._contacts, self._options
        solver, settings, result = pin.ADMMConstraintSolver(), pin.ADMMSolverSettings(), pin.ADMMSolverResult()
        settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0.0
        settings.anderson_capacity = options.anderson
        settings.admm_update_rule = getattr(pin.ADMMUpdateRule, options.update.upper())
        settings.lanczos_size = lanczos_steps(options.lanczos, self.problem.n_rows, max_seconds)
        operator = call_with_stack(lambda: pin.DelassusOperatorSparse(contacts.matrix), self.problem.n_contacts)

        def call(impulses: FloatArray, tolerance: float, iterations: int) -> Round:
            settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = TOLERANCE_RATIO * tolerance
            settings.max_iterations = iterations
            if result.isValid():
                result.setConstraintVelocityGuess(result.retrieveConstraintVelocities())
                settings.warmstart_rho_with_previous_result = True
            result.setConstraintImpulseGuess(contacts.to_pinocchio(impulses))
            arguments = operator, contacts.velocity, contacts.models, contacts.datas, settings, result
            is_converged = call_with_stack(lambda: solver.solve(*arguments), self.problem.n_contacts)
            solution = contacts.from_pinocchio(result.retrieveConstraintImpulses())
            return Round(solution, min(result.iterations, iterations), bool(is_converged))

        return call
