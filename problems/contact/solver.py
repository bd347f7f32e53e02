"""What a solver is: one interface for every method.

``Solver.prepare`` does once what depends on the problem alone (assemble, factorise, compile), and is timed apart;
``Prepared.solve`` iterates until the judge's residual reaches the tolerance, or says why it does not.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

import numpy as np

from ..arrays import FloatArray
from ..errors import ProxbenchError
from ..representation import counted, html_table
from .model import Model
from .problem import ContactProblem

Observer = Callable[[int, FloatArray], None]
"""``observe(iteration, impulses)``, called once per iteration with a read-only view of Λ over rows."""


class SolverError(ProxbenchError, ValueError):
    """A solver or one of its options does not exist, or cannot be used in this way."""


class Status(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    ITERATION_LIMIT = "iteration limit"
    TIME_LIMIT = "time limit"
    STALLED = "stalled"
    OSCILLATING = "oscillating"
    DIVERGED = "diverged"
    INFEASIBLE = "infeasible"
    UNSUPPORTED = "unsupported"

    @property
    def sentence(self) -> str:
        """What the status means, as a sentence."""
        return _SENTENCES[self]


_SENTENCES = {
    Status.SOLVED: "The tolerance was reached.",
    Status.ITERATION_LIMIT: "The iteration limit came before the tolerance.",
    Status.TIME_LIMIT: "The time limit came before the tolerance.",
    Status.STALLED: "No further iteration can lower the residual.",
    Status.OSCILLATING: "The iterates repeat themselves in a cycle without coming closer to a solution.",
    Status.DIVERGED: "The iterates grow without bound.",
    Status.INFEASIBLE: "The problem has no solution.",
    Status.UNSUPPORTED: "The solver cannot treat this problem.",
}


@dataclass(frozen=True)
class Stop:
    """When to stop.

    A residual that does not fall ends no solve, for it may fall after a million sweeps. So what ends one that reaches
    no tolerance is the first of the two limits, and both have defaults; with both infinite it may go on for ever.

    Attributes:
        tolerance: the judge's residual to reach, dimensionless, positive.
        max_iterations: largest number of iterations.
        max_seconds: largest wall time [s], preparing excluded.

    Raises:
        SolverError: if a limit is not positive.
    """

    tolerance: float = 1e-6
    max_iterations: int = 10_000
    max_seconds: float = 60.0

    def __post_init__(self) -> None:
        if not self.tolerance > 0:
            raise SolverError(f"tolerance must be positive, got {self.tolerance}.")
        if not self.max_iterations >= 0:
            raise SolverError(f"max_iterations must not be negative, got {self.max_iterations}.")
        if not self.max_seconds > 0:
            raise SolverError(f"max_seconds must be positive, got {self.max_seconds}.")


@dataclass(frozen=True, eq=False)
class Solution:
    """What a solver returns: the best finite iterate it has, and how it ended.

    Attributes:
        impulses: Λ [N s], shape (n_rows,).
        status: how the solve ended.
        iterations: number of iterations done.
        message: the reason behind the status, in words; may be empty.
    """

    impulses: FloatArray
    status: Status
    iterations: int
    message: str = ""

    def __repr__(self) -> str:
        counts = f"{counted(len(self.impulses), 'row')}, {counted(self.iterations, 'iteration')}"
        return f"<Solution {self.status}: {counts}{self.message and f'; {self.message}'}>"

    def _repr_html_(self) -> str:
        largest = float(np.abs(self.impulses).max(initial=0.0))
        facts = {"rows": len(self.impulses), "iterations": self.iterations, "largest impulse [N s]": largest}
        return html_table(f"Solution: {self.status}", {**facts, **({"message": self.message} if self.message else {})})


class Prepared(Protocol):
    """A solver made ready for one problem.

    One whose work goes on elsewhere when ``solve`` returns, on a GPU say, has a method ``synchronise()`` beside, which
    waits until the impulses stand in the array of the solution; it is called before the clock stops.
    """

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve from ``start`` (zeros if None), calling ``observe`` once per iteration if given."""
        ...


@runtime_checkable
class Solver(Protocol):
    """A method with its options.

    A plugin may leave ``has_iterates`` out, which means True; ``shows_iterates`` reads it. One that draws random
    numbers says ``is_randomised = True``; of any other, answers that differ between repeats are shown as such.
    """

    @property
    def has_iterates(self) -> bool:
        """Whether ``observe`` is called; False for a solver without meaningful inner iterates."""
        ...

    @property
    def name(self) -> str:
        """Unique name, with the options that differ from the defaults: ``"SORprox(relaxation=1.5)"``."""
        ...

    @property
    def model(self) -> Model:
        """The model that is solved, which need not be Coulomb friction."""
        ...

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None if it can."""
        ...

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Do what depends on the problem alone."""
        ...


def shows_iterates(solver: Solver) -> bool:
    """Whether ``solver`` calls its observer once per iteration."""
    return bool(getattr(solver, "has_iterates", True))


def draws_randomly(solver: Solver) -> bool:
    """Whether ``solver`` declares that its answers differ between repeats."""
    return bool(getattr(solver, "is_randomised", False))
