"""NSGS: nonsmooth Gauss–Seidel, contact by contact, each solved exactly (Jean & Moreau's method), by ``sweeps.blocks``.

Normal and tangential direction of a contact are never at odds, which is what makes single laws in turn cycle at high
friction.
"""

from dataclasses import dataclass

from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method
from ..sweeps.blocks import BlockIterates, BlockSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import check_relaxation


@dataclass(frozen=True)
class NSGS(Method):
    """Nonsmooth (block) Gauss–Seidel: every contact is solved exactly, to rounding, with all others held still.

    Contacts of high friction may oscillate among each other; ω is cut at those that do (``sweeps.safeguarded``).

    Attributes:
        relaxation: ω; a contact moves to Λ + ω(Λ* − Λ), projected onto its cone, where Λ* solves it.

    Raises:
        SolverError: for an option out of range.
    """

    relaxation: float = 1.0

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G."""
        sweep = BlockSweep.over(problem, self.relaxation)
        return PreparedIteration(
            problem, Residual(problem), lambda start: SafeguardedIterates(BlockIterates(sweep, start))
        )
