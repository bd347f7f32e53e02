"""Contact problems through cvxpy: the convex model, Coulomb friction by a fixed point over it, frictionless contact.

The same mathematics as ``clarabel_socp`` and ``clarabel_coulomb``, with cvxpy between problem and solver: any of its
solvers by name, at the price of compiling.
"""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.laws import LawKind
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from .convex import ConvexMethod
from .cvxpy_program import CvxpyProgram, check_solver, takes_cones
from .fixed_point import FixedPointMethod, check_memory
from .programs import obstacle

MOST_CONTACTS = 2500
"""Contacts beyond which compiling takes gigabytes: 0.5 GB at 1000, 1.4 GB at 2000."""


def _obstacle(problem: ContactProblem) -> str | None:
    """Say why ``problem`` is no cone program, or too large a one to compile, or None."""
    if problem.n_contacts > MOST_CONTACTS:
        return f"it has {problem.n_contacts} contacts, and cvxpy takes gigabytes to compile more than {MOST_CONTACTS}"
    return obstacle(problem, "delassus")


@dataclass(frozen=True)
class CvxpySOCP(ConvexMethod):
    """The convex model through cvxpy.

    Attributes:
        solver: a conic solver that cvxpy has installed.

    Raises:
        SolverError: if cvxpy has no such solver.
    """

    solver: str = "CLARABEL"

    model: ClassVar[Model] = Model.CONVEX

    def __post_init__(self) -> None:
        check_solver(self.solver, cones=True)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return _obstacle(problem)

    def program(self, problem: ContactProblem) -> CvxpyProgram:
        """Return the program, compiled."""
        return CvxpyProgram(problem, self.solver)


@dataclass(frozen=True)
class CvxpyCoulomb(FixedPointMethod):
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

    def __post_init__(self) -> None:
        check_solver(self.solver, cones=False)
        check_memory(self.memory)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        if (problem.laws.row_count > 1).any() and not takes_cones(self.solver):
            return f"it has {_discs(problem)}, and {self.solver} does not take second-order cones"
        return _obstacle(problem)

    def program(self, problem: ContactProblem) -> CvxpyProgram:
        """Return the program, compiled."""
        return CvxpyProgram(problem, self.solver)


@dataclass(frozen=True)
class CvxpyQP(ConvexMethod):
    """Complementarity where it is convex, a quadratic program through cvxpy: minimise ½ ΛᵀGΛ + cᵀΛ over Λ_N ≥ 0.

    Planar friction with fixed bounds, ‖Λ_T‖ ≤ a, is part of it; Coulomb friction is not convex.

    Attributes:
        solver: a quadratic solver that cvxpy has installed.

    Raises:
        SolverError: if cvxpy has no such solver.
    """

    solver: str = "OSQP"

    def __post_init__(self) -> None:
        check_solver(self.solver, cones=False)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        laws = problem.laws
        if laws.friction_coefficient.any():
            return "it has Coulomb friction, whose complementarity problem is not convex"
        if (laws.row_count > 1).any():
            return f"it has {_discs(problem)}, whose disc is no set of a quadratic program"
        return _obstacle(problem)

    def program(self, problem: ContactProblem) -> CvxpyProgram:
        """Return the program, compiled."""
        return CvxpyProgram(problem, self.solver)


def _discs(problem: ContactProblem) -> str:
    """Return what messages call the friction of ``problem`` that has two directions or more."""
    is_spatial = (problem.laws.kind == LawKind.SPATIAL_FRICTION).any()
    return "spatial friction" if is_spatial else "rolling friction about several axes"
