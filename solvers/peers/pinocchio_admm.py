"""Pinocchio's alternating direction method of multipliers, called as it is."""

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ..iteration.method import Method, check_option
from .installed import check_installed, imported
from .pinocchio_problem import Contacts, obstacle, on_deep_stack
from .rounds import Call, InRounds, Round

PENALTY = 0.5
"""Its tolerance over the judge's, at first: in the units handed over both are nearly the same."""

STEP_SECONDS = 1e-9
"""Time of a Lanczos step for each row of G and each step before it, of which it becomes independent [s]."""

LANCZOS_SHARE = 0.5
"""Of the time limit that the Lanczos steps may take: nothing ends them."""

Update = Literal["constant", "linear", "osqp", "spectral"]


@dataclass(frozen=True)
class PinocchioADMM(Method):
    """ADMM on Coulomb friction in De Saxcé's form, of Pinocchio (Carpentier, Le Lidec & Montaut 2024).

    It factorises G with a penalty on its diagonal, sparse, and projects on the friction cones. Its own criterion is the
    largest primal and dual infeasibility and complementarity. Options default to its own.

    Attributes:
        anderson: iterates that Anderson acceleration remembers; 0 leaves it out.
        lanczos: steps of the Lanczos decomposition that estimates the spectrum of G; 0 takes as many as there are rows.
            Fewer are taken where these would not fit into half the time limit, as on thousands of contacts.
        update: rule by which the penalty changes.

    Raises:
        SolverError: if Pinocchio is not installed, or an option is out of range.
    """

    anderson: int = 0
    lanczos: int = 0
    update: Update = "osqp"

    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_installed("PinocchioADMM", "pinocchio")
        check_option("anderson", self.anderson, self.anderson >= 0, "an integer, 0 or more")
        check_option("lanczos", self.lanczos, self.lanczos == 0 or self.lanczos >= 2, "0, or an integer of 2 or more")
        check_option("update", self.update, self.update in get_args(Update), "one of " + ", ".join(get_args(Update)))

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedADMM":
        """Assemble G in units of its own, and the contacts."""
        self.check_supports(problem)
        return PreparedADMM(problem, self)


def lanczos_steps(wanted: int, n_rows: int, max_seconds: float) -> int:
    """Return how many Lanczos steps to take: those wanted, or as many as rows for 0, as far as the time limit allows.

    The time is estimated, not measured, so that solves with equal limits are equal. Two steps are always taken.

    Args:
        wanted: the option.
        n_rows: rows of G.
        max_seconds: time limit of the solve [s].
    """
    allowed = LANCZOS_SHARE * max_seconds / (STEP_SECONDS * max(n_rows, 1))
    steps = min(wanted or n_rows, n_rows)
    return steps if steps**2 <= allowed else max(2, int(allowed**0.5))


class PreparedADMM(InRounds):
    """ADMM made ready for one problem."""

    first_iterations, growth = 100, 10.0

    def __init__(self, problem: ContactProblem, options: PinocchioADMM) -> None:
        super().__init__(problem)
        self._options, self._contacts = options, Contacts.of(problem)

    def begin(self, max_seconds: float) -> Call:
        """Return the solver; the penalty it came to goes from one round to the next with its iterates."""
        pin, contacts, options = imported("pinocchio"), self._contacts, self._options
        solver, settings, result = pin.ADMMConstraintSolver(), pin.ADMMSolverSettings(), pin.ADMMSolverResult()
        settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0.0
        settings.anderson_capacity = options.anderson
        settings.admm_update_rule = getattr(pin.ADMMUpdateRule, options.update.upper())
        settings.lanczos_size = lanczos_steps(options.lanczos, self.problem.n_rows, max_seconds)
        operator = on_deep_stack(lambda: pin.DelassusOperatorSparse(contacts.matrix), self.problem.n_contacts)

        def call(impulses: FloatArray, tolerance: float, iterations: int) -> Round:
            settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = PENALTY * tolerance
            settings.max_iterations = iterations
            if result.isValid():
                result.setConstraintVelocityGuess(result.retrieveConstraintVelocities())
                settings.warmstart_rho_with_previous_result = True
            result.setConstraintImpulseGuess(contacts.theirs(impulses))
            arguments = operator, contacts.velocity, contacts.models, contacts.datas, settings, result
            is_converged = on_deep_stack(lambda: solver.solve(*arguments), self.problem.n_contacts)
            found = contacts.ours(result.retrieveConstraintImpulses())
            return Round(found, min(result.iterations, iterations), bool(is_converged))

        return call
