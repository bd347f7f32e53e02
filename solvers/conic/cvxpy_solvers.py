"""Contact problems through cvxpy: the convex model, Coulomb friction by a fixed point over it, frictionless contact.

The same mathematics as ``clarabel_socp`` and ``clarabel_coulomb``, with cvxpy between problem and solver: any of its
solvers by name, at the price of compiling.
"""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.judge import ModelResidual, Residual
from ...problems.contact.laws import LawKind
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..interface import SolverError
from ..iteration.correction import BeginCorrection, NoCorrection
from .clarabel_socp import obstacle
from .convex import PreparedConvex
from .cvxpy_program import CvxpyProgram, check_solver, takes_cones
from .fixed_point import PreparedFixedPoint, check_memory


def _refuse_unsupported(solver: "CvxpySOCP | CvxpyCoulomb | CvxpyQP", problem: ContactProblem) -> None:
    reason = solver.supports(problem)
    if reason:
        raise SolverError(f"{solver.name} cannot treat {problem.name!r}: {reason}.")


def _prepared_convex(solver: "CvxpySOCP | CvxpyQP", problem: ContactProblem) -> PreparedConvex:
    _refuse_unsupported(solver, problem)
    residual = ModelResidual(problem, Model.CONVEX)
    return PreparedConvex(problem, residual, CvxpyProgram(problem, solver.solver))


MOST_CONTACTS = 2500
"""Contacts beyond which compiling takes gigabytes: 0.5 GB at 1000, 1.4 GB at 2000."""


def _obstacle(problem: ContactProblem) -> str | None:
    """Say why ``problem`` is no cone program, or too large a one to compile, or None."""
    if problem.n_contacts > MOST_CONTACTS:
        return f"it has {problem.n_contacts} contacts, and cvxpy takes gigabytes to compile more than {MOST_CONTACTS}"
    return obstacle(problem, "delassus")


@dataclass(frozen=True)
class CvxpySOCP:
    """The convex model through cvxpy.

    Attributes:
        solver: a conic solver that cvxpy has installed.

    Raises:
        SolverError: if cvxpy has no such solver.
    """

    solver: str = "CLARABEL"

    model: ClassVar[Model] = Model.CONVEX
    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_solver(self.solver, cones=True)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return _obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedConvex:
        """Compile the program."""
        return _prepared_convex(self, problem)


@dataclass(frozen=True)
class CvxpyCoulomb:
    """Exact Coulomb friction by De Saxcé's fixed point over the convex model in cvxpy.

    Planar friction is a quadratic program in each outer iteration, which quadratic solvers take as well; spatial
    friction needs second-order cones.

    Attributes:
        solver: a conic or quadratic solver that cvxpy has installed.
        memory: pairs that Anderson acceleration of the outer iteration remembers; 0 leaves it plain.

    Raises:
        SolverError: if cvxpy has no such solver, or for an option out of range.
    """

    solver: str = "CLARABEL"
    memory: int = 5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_solver(self.solver, cones=False)
        check_memory(self.memory)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        if (problem.laws.kind == LawKind.SPATIAL_FRICTION).any() and not takes_cones(self.solver):
            return f"it has spatial friction, and {self.solver} does not take second-order cones"
        return _obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedFixedPoint:
        """Compile the program, once for all outer iterations."""
        return self.prepare_corrected(problem, NoCorrection)

    def prepare_corrected(self, problem: ContactProblem, begin: BeginCorrection) -> PreparedFixedPoint:
        """See ``iteration.correction``."""
        _refuse_unsupported(self, problem)
        program = CvxpyProgram(problem, self.solver)
        return PreparedFixedPoint(problem, Residual(problem), program, self.memory, begin)


@dataclass(frozen=True)
class CvxpyQP:
    """Complementarity where it is convex, a quadratic program through cvxpy: minimise ½ ΛᵀGΛ + cᵀΛ over Λ_N ≥ 0.

    Planar friction with fixed bounds, ‖Λ_T‖ ≤ a, is part of it; Coulomb friction is not convex.

    Attributes:
        solver: a quadratic solver that cvxpy has installed.

    Raises:
        SolverError: if cvxpy has no such solver.
    """

    solver: str = "OSQP"

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_solver(self.solver, cones=False)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        laws = problem.laws
        if laws.friction_coefficient.any():
            return "it has Coulomb friction, whose complementarity problem is not convex"
        if (laws.kind == LawKind.SPATIAL_FRICTION).any():
            return "it has spatial friction, whose disc is no set of a quadratic program"
        return _obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedConvex:
        """Compile the program."""
        return _prepared_convex(self, problem)
