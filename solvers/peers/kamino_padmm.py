"""KaminoPADMM: the proximal alternating direction method of multipliers of Kamino."""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ..iteration.method import Method, check_option
from .installed import check_installed
from .kamino_problem import TESTED_VERSION, DualSolver, unsupported_reason
from .rounds import Call, PreparedRounds, Round


@dataclass(frozen=True)
class KaminoPADMM(Method):
    """Kamino's proximal ADMM for Coulomb friction in De Saxcé's form (Tsounis, Grandia & Bächer 2025).

    Kamino is a part of the library Newton. The solver runs on the processor in single precision. The smallest residuals
    are therefore about 1e-6. It factorises dense G with a penalty on the diagonal. Its own criterion is the largest of
    its primal, dual and complementarity residuals. The options have Kamino's defaults.

    Attributes:
        acceleration: whether steps are accelerated as in fast ADMM (Goldstein et al. 2014).
        penalty: ρ, which stays constant; the scaled G has a diagonal of about 1.

    Raises:
        SolverError: if Newton is not installed or its version is not supported, or an option is out of range.
    """

    acceleration: bool = True
    penalty: float = 1.0

    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_installed("KaminoPADMM", "newton", "kamino", TESTED_VERSION)
        check_option("acceleration", self.acceleration, isinstance(self.acceleration, bool), "True or False")
        is_valid = isinstance(self.penalty, int | float) and 0.0 < self.penalty < float("inf")
        check_option("penalty", self.penalty, is_valid, "positive")

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or unsupported_reason(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedPADMM":
        """Fill Kamino's arrays, and compile its kernels for problems of this size."""
        self.check_supports(problem)
        return PreparedPADMM(problem, self)


class PreparedPADMM(PreparedRounds):
    """Proximal ADMM prepared for one problem."""

    first_iterations, growth = 100, 10.0

    def __init__(self, problem: ContactProblem, options: KaminoPADMM) -> None:
        super().__init__(problem)
        self._solver = DualSolver(problem, options.acceleration, options.penalty) if problem.n_rows else None

    def begin(self, max_seconds: float) -> Call:
        """Return the solver; a round starts from the impulses of the previous round and their velocities."""

        def call(impulses: FloatArray, tolerance: float, iterations: int) -> Round:
            assert self._solver is not None  # without rows, the first impulses are the solution
            return Round(*self._solver.solve(impulses, tolerance, iterations))

        return call
