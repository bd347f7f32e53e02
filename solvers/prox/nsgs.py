"""NSGS: nonsmooth Gauss–Seidel, contact by contact, each solved exactly (Jean & Moreau's method), by ``sweeps.blocks``.

Normal and tangential direction of a contact are never at odds, which is what makes single laws in turn cycle at high
friction.
"""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.judge import Residual
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..iteration.loop import PreparedIteration
from ..sweeps.blocks import BlockIterates, BlockSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import check_relaxation


@dataclass(frozen=True)
class NSGS:
    """Nonsmooth (block) Gauss–Seidel: every contact is solved exactly, to rounding, with all others held still.

    Contacts of high friction may oscillate among each other; ω is cut at those that do (``iteration.safeguard``).

    Attributes:
        relaxation: ω; a contact moves to Λ + ω(Λ* − Λ), projected onto its cone, where Λ* solves it.

    Raises:
        SolverError: for an option out of range.
    """

    relaxation: float = 1.0

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G."""
        sweep = BlockSweep.over(problem, self.relaxation)
        return PreparedIteration(
            problem, Residual(problem), lambda start: SafeguardedIterates(BlockIterates(sweep, start))
        )
