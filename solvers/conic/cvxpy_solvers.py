"""Contact problems through cvxpy: the convex model, Coulomb friction by a fixed point over it, frictionless contact.

The same mathematics as ``clarabel_socp`` and ``clarabel_coulomb``, with cvxpy between problem and solver: any of its
solvers by name, at the price of compiling.
"""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact import ContactProblem
from ...problems.judge import Residual
from ...problems.model import Model
from ..interface import SolverError, described
from .clarabel_socp import obstacle
from .convex import PreparedConvex
from .cvxpy_program import CvxpyProgram, check_solver
from .fixed_point import PreparedFixedPoint, check_memory


def _program(solver: "CvxpySOCP | CvxpyCoulomb | CvxpyQP", problem: ContactProblem) -> tuple[Residual, CvxpyProgram]:
    reason = solver.supports(problem)
    if reason:
        raise SolverError(f"{solver.name} cannot treat {problem.name!r}: {reason}.")
    residual = Residual(problem)
    return residual, CvxpyProgram(problem, residual, solver.solver)


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
        return obstacle(problem, "delassus")

    def prepare(self, problem: ContactProblem) -> PreparedConvex:
        """Compile the program."""
        return PreparedConvex(problem, *_program(self, problem))


@dataclass(frozen=True)
class CvxpyCoulomb:
    """Exact Coulomb friction by De Saxcé's fixed point over the convex model in cvxpy.

    Attributes:
        solver: a conic solver that cvxpy has installed.
        memory: pairs that Anderson acceleration of the outer iteration remembers; 0 leaves it plain.

    Raises:
        SolverError: if cvxpy has no such solver, or for an option out of range.
    """

    solver: str = "CLARABEL"
    memory: int = 5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_solver(self.solver, cones=True)
        check_memory(self.memory)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem, "delassus")

    def prepare(self, problem: ContactProblem) -> PreparedFixedPoint:
        """Compile the program, once for all outer iterations."""
        return PreparedFixedPoint(problem, *_program(self, problem), self.memory)


@dataclass(frozen=True)
class CvxpyQP:
    """Frictionless contact as a quadratic program through cvxpy: minimise ½ ΛᵀGΛ + cᵀΛ over Λ ≥ 0.

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
        if problem.laws.is_friction.any():
            return "it has friction laws, and a quadratic program holds none of them"
        return obstacle(problem, "delassus")

    def prepare(self, problem: ContactProblem) -> PreparedConvex:
        """Compile the program."""
        return PreparedConvex(problem, *_program(self, problem))
