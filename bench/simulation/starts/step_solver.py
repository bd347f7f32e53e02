"""What steppers ask for: the named solver, with the impulses that a solve starts from."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Prepared, Solver
from ...errors import BenchError


class UnsupportedStepError(BenchError):
    """The solver cannot treat the contact problem of a step."""


@dataclass(frozen=True)
class StepSolver(ABC):
    """A solver with a start, as steppers take it.

    Attributes:
        solver: the solver, which runs alone.
        name: what the start is called.
    """

    solver: Solver
    name: ClassVar[str]

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Prepare ``problem``.

        Raises:
            UnsupportedStepError: if the solver cannot treat it.
        """
        reason = self.solver.supports(problem)
        if reason:
            raise UnsupportedStepError(f"it cannot treat this step: {reason}")
        return self._prepared(problem)

    @abstractmethod
    def _prepared(self, problem: ContactProblem) -> Prepared:
        """Return the prepared solver, whose ``solve`` gets the impulses of the last step as its start."""
