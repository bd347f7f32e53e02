"""Warm: a solver that ``proxbench run`` starts from the solver's own solution of the previous step."""

from dataclasses import dataclass

from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Prepared, Solver, draws_randomly, shows_iterates, threads_of


@dataclass(frozen=True)
class Warm:
    """A solver with a warm start, which its name shows: ``Warm(SORprox)``.

    ``proxbench run`` first solves the steps that precede the problem with the solver itself, outside the measured time.
    Each solve of the problem then starts from the last solution. Without ``Warm``, the solver starts from zero. A
    problem without a previous step is reported as unsupported. Outside ``proxbench run``, ``Warm`` has no effect.

    Attributes:
        solver: the solver.
    """

    solver: Solver

    starts_warm = True
    """Whether a run starts the solver from its solution of the previous step."""

    @property
    def name(self) -> str:
        """Class name with the name of the solver."""
        return warm_name(self.solver.name)

    @property
    def model(self) -> Model:
        """The model of the solver."""
        return self.solver.model

    @property
    def has_iterates(self) -> bool:
        """Whether the solver passes its iterates to the observer."""
        return shows_iterates(self.solver)

    @property
    def is_randomised(self) -> bool:
        """Whether the solver declares that its results differ between repeats."""
        return draws_randomly(self.solver)

    @property
    def threads(self) -> int:
        """The number of threads of the solver."""
        return threads_of(self.solver)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return self.solver.supports(problem)

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Prepare the solver."""
        return self.solver.prepare(problem)


def warm_name(solver: str) -> str:
    """Return the name of a solver with a warm start: ``"Warm(SORprox)"``."""
    return f"{Warm.__name__}({solver})"
