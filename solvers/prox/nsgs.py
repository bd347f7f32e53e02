"""NSGS: nonsmooth Gauss–Seidel, which solves one contact at a time; see ``sweeps.blocks``.

Source: M. Jean, The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Engrg. 177 (1999).

The normal and tangential impulses of a contact are always consistent. In methods that visit single laws, they may be
inconsistent, and such methods may cycle at high friction.
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
    """Nonsmooth (block) Gauss–Seidel: each contact is solved up to rounding with all other impulses fixed.

    Contacts of high friction may still oscillate against each other; their ω is then reduced (``sweeps.safeguarded``).

    Attributes:
        relaxation: ω > 0; a contact moves to Λ + ω(Λ* − Λ), projected onto its cone, where Λ* is its solution.

    Raises:
        SolverError: if an option is out of range.
    """

    relaxation: float = 1.0

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G."""
        self.check_supports(problem)
        sweep = BlockSweep.over(problem, self.relaxation)
        return PreparedIteration(
            problem, Residual(problem), lambda start: SafeguardedIterates(BlockIterates(sweep, start))
        )
