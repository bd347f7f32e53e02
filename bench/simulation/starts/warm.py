"""Start from the impulses of the last step, contact by contact."""

from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Prepared
from .step_solver import StepSolver


class Warm(StepSolver):
    """Each solve starts from the last impulses of the contacts that persist, and from zero for new ones."""

    name = "warm"

    def _prepared(self, problem: ContactProblem) -> Prepared:
        return self.solver.prepare(problem)
