"""Start from the impulses of the last step, and start again from zero where that does not converge."""

from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Prepared
from ....solvers.composite.fallback import Fallback
from .step_solver import StepSolver

WARM_ITERATIONS = 500
"""Iterations from the last impulses, which may lead nowhere in a pile at rest, before the start from zero."""


class WarmThenCold(StepSolver):
    """Each solve has 500 iterations from the last impulses, and the rest from zero if they do not converge."""

    name = "warm-then-cold"

    def _prepared(self, problem: ContactProblem) -> Prepared:
        return Fallback(self.solver, warm_iterations=WARM_ITERATIONS).prepare(problem)
