"""Lemke's method on the complementarity problem of contact: exact planar friction, pyramids for spatial friction.

If contacts affect each other only within groups, the matrix is block diagonal, and each block is solved separately. The
work then grows with the cube of the size of the largest group, not of the whole problem.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.coupling import components
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import ModelResidual
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop, start_impulses
from ..iteration.loop import infeasible_solution
from ..iteration.method import SLIDING, Method
from ..iteration.stopping import Clock
from .formulation import Complementarity, check_sides, complementarity, unknowns_of_laws
from .pivoting import SMALLEST_PIVOTS, Ending, Tableau

MAX_GROUP_SIZE = 6000
"""Largest number of unknowns of a group; a larger tableau needs more than 300 MB and hours of pivoting."""

PIVOTS_BETWEEN_CHECKS = 20
"""Number of pivots between two checks of the clock."""


@dataclass(frozen=True)
class Lemke(Method):
    """Complementary pivoting with the lexicographic rule; exact up to rounding for any tolerance.

    Attributes:
        sides: k, the number of sides of the friction pyramid of a spatial contact; at least 3.

    Raises:
        SolverError: if ``sides`` is less than 3.
    """

    sides: int = 8

    has_iterates: ClassVar[bool] = False
    law_kinds: ClassVar[frozenset[int]] = SLIDING

    def __post_init__(self) -> None:
        check_sides(self.sides)

    @property
    def model(self) -> Model:
        """The pyramid of ``sides`` sides."""
        return Model.pyramid(self.sides)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        reason = super().supports(problem)
        if reason:
            return reason
        unknowns = unknowns_of_laws(problem.laws, self.sides)
        if unknowns.sum() <= MAX_GROUP_SIZE:
            return None
        layout = problem.layout
        unknowns_per_contact = np.bincount(layout.contact_of_row[problem.laws.first_row], unknowns, layout.n_blocks)
        largest = int(np.bincount(components(problem), unknowns_per_contact).max())
        if largest > MAX_GROUP_SIZE:
            return f"a group of {largest} unknowns is coupled, and pivoting takes hours beyond {MAX_GROUP_SIZE}"
        return None

    def prepare(self, problem: ContactProblem) -> "PreparedLemke":
        """Formulate the problem and find its groups."""
        self.check_supports(problem)
        residual = ModelResidual(problem, self.model)
        formulated = complementarity(problem, residual, self.sides)
        return PreparedLemke(problem, residual, formulated, _groups(formulated.matrix))


def _groups(matrix: sp.csr_array) -> list[IntArray]:
    """Return the indices of each connected group of unknowns."""
    from scipy.sparse.csgraph import connected_components  # imported here because the import takes 0.1 s

    count, label = connected_components(matrix, directed=False)
    order = np.argsort(label, kind="stable")
    return [np.sort(group) for group in np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])]


@dataclass(frozen=True, eq=False)
class PreparedLemke:
    """The linear complementarity problem of one contact problem, in groups."""

    problem: ContactProblem
    residual: ModelResidual = field(repr=False)
    formulated: Complementarity = field(repr=False)
    groups: list[IntArray] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Pivot through all groups; ``iterations`` counts pivots, and start and observer are ignored."""
        check_stop(stop)
        start_impulses(start, self.problem.n_rows)  # raises an error if the start is invalid
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        unknowns, pivots, rays, proofs = np.zeros(len(self.formulated.vector)), 0, 0, 0
        clock = Clock(stop.max_seconds)
        limit: Status | None = None
        for group in self.groups:
            matrix, vector = self.formulated.matrix[group][:, group].toarray(), self.formulated.vector[group]
            for smallest in SMALLEST_PIVOTS:
                tableau = Tableau(matrix, vector, smallest)
                limit = _advance(tableau, stop.max_iterations - pivots, clock)
                pivots += tableau.pivots
                if tableau.ending is not Ending.RAY or tableau.proves_infeasibility():
                    break
            if limit is not None:
                break
            if tableau.ending is Ending.RAY:
                rays += 1
                proofs += tableau.proves_infeasibility()
            else:
                unknowns[group] = tableau.solution()
        impulses = self.formulated.impulses(unknowns)
        residual = self.residual.judged(self.problem, impulses)
        progress = f"residual {residual:.1e} after {pivots} pivots"
        if residual <= stop.tolerance:
            return Solution(impulses, Status.SOLVED, pivots)
        if limit is not None:
            return Solution(impulses, limit, pivots, progress)
        if proofs and not self.problem.laws.friction_coefficient.any():
            reason = "pivoting ended on a secondary ray, which proves infeasibility without Coulomb friction"
            return Solution(impulses, Status.INFEASIBLE, pivots, reason)
        reason = "pivoting ended on a secondary ray" if rays else "rounding limits the accuracy"
        return Solution(impulses, Status.STALLED, pivots, f"{reason}, {progress}")


def _advance(tableau: Tableau, max_pivots: int, clock: Clock) -> Status | None:
    """Pivot to the end, to ``max_pivots`` or to the deadline; return the limit that was reached, if any."""
    while tableau.ending is Ending.UNFINISHED:
        if tableau.pivots >= max_pivots:
            return Status.ITERATION_LIMIT
        if clock.has_expired:
            return Status.TIME_LIMIT
        tableau.advance(min(PIVOTS_BETWEEN_CHECKS, max_pivots - tableau.pivots))
    return None
