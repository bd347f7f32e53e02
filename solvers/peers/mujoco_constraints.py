"""MuJoCo: the constraint solvers of MuJoCo, on the cone program of a contact problem or of a captured step."""

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import residual_under
from ..iteration.method import Method, check_option
from .installed import check_installed
from .mujoco_problem import TESTED_VERSION, ConstraintStage
from .mujoco_program import program_of, unsupported_reason
from .rounds import Call, PreparedRounds, Round

Algorithm = Literal["Newton", "CG", "PGS"]

FIRST_TOLERANCE, TIGHTENING = 1e-2, 1e-3
"""MuJoCo's tolerance of the cost in the first round, and the factor that reduces it after each round that meets it.

They do not depend on the tolerance of the solve, so that a solve with a smaller tolerance has the same iterates.
"""


@dataclass(frozen=True)
class MuJoCo(Method):
    """The solvers of MuJoCo for its constraints, called separately: ``mj_fwdConstraint`` (Todorov 2014).

    They minimise ½ Λᵀ (G + R) Λ + Λᵀ c over the friction cones, with R = (1 − d)/d α for the largest diagonal entry α
    of a contact. MuJoCo's default d is 0.9 to 0.95, and 0.99 and more in models with hard contacts. This
    is the convex model with compliance: the smaller R, the harder the contacts, and the slower the solvers.

    In a captured step they solve the program of the engine, with the A, R, b and cones that the problem holds, and
    ``impedance`` has no effect. The model is ``Model.ENGINE``, so that a claim of success there refers to this program.

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
        check_option("impedance", self.impedance, 0.0 < self.impedance < 1.0, "between 0 and 1")

    @property
    def model(self) -> Model:
        """The program of the engine in a captured step, the convex model of any other problem."""
        return Model.ENGINE

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return unsupported_reason(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedMuJoCo":
        """Build a model with the same numbers of coordinates and rows, and fill in the problem."""
        self.check_supports(problem)
        return PreparedMuJoCo(problem, self)


class PreparedMuJoCo(PreparedRounds):
    """MuJoCo's constraint stage prepared for one problem."""

    first_iterations, growth = 100, 10.0

    def __init__(self, problem: ContactProblem, options: MuJoCo) -> None:
        super().__init__(problem)
        self.residual = residual_under(problem, Model.ENGINE)
        self._stage = ConstraintStage(program_of(problem, options.impedance), options.algorithm)

    def begin(self, max_seconds: float) -> Call:
        """Return the call; Newton and CG start from the accelerations of given impulses, PGS from zero."""
        stage, own = self._stage, FIRST_TOLERANCE

        def call(impulses: FloatArray, tolerance: float, iterations: int) -> Round:
            nonlocal own
            stage.start(impulses)
            stage.run(own, iterations)
            done = stage.iterations
            own *= TIGHTENING if done < iterations else 1.0
            return Round(stage.impulses, max(done, 1), done < iterations)

        return call
