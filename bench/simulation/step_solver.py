"""How the steps of a simulation are solved: from the impulses of the last step, else from zero."""

from dataclasses import dataclass

from ...problems.contact.problem import ContactProblem
from ...solvers.composite.fallback import Fallback
from ...solvers.interface import Prepared, Solver
from ..errors import BenchError


class UnsupportedStepError(BenchError):
    """The solver cannot treat the contact problem of a step."""


@dataclass(frozen=True)
class StepSolver:
    """A solver as ``Moreau`` wants it.

    Attributes:
        solver: a ``Fallback``, or a solver that is tried as the only part of one.
    """

    solver: Solver

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Prepare ``problem``.

        Raises:
            UnsupportedStepError: if the solver cannot treat it.
        """
        solver = self.solver if isinstance(self.solver, Fallback) else Fallback(self.solver)
        reason = solver.supports(problem)
        if reason:
            raise UnsupportedStepError(f"it cannot treat this step: {reason}")
        return solver.prepare(problem)
