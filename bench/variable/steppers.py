"""Steppers of variable step size by name, as the command line and result files write them."""

import inspect
from abc import ABC, abstractmethod
from dataclasses import dataclass

from ...problems.errors import ProblemError, suggestion
from ...problems.mechanics.system import System
from ...problems.names import check_options, described, read_name
from ...problems.stepping.extrapolation import Extrapolation
from ...problems.stepping.extrapolation import StepDoubling as DoublingScheme
from ...problems.stepping.moreau import ContactSolver
from ...problems.stepping.switching import Anticipating, LastStepOnly, NestedIntervals, Search
from ...problems.stepping.variable_step import Scheme, VariableStep
from ...solvers.interface import Stop
from ..errors import BenchError
from ..simulation.plan import FIXED

SEARCHES: dict[str, type[Search]] = {"anticipating": Anticipating, "nested": NestedIntervals, "last": LastStepOnly}
"""Searches for switching points by name."""


class Stepper(ABC):
    """A stepper with its options; those of every one are the attributes here.

    Subclasses are frozen dataclasses, so that ``described`` writes their names.

    Attributes:
        tolerance: relative error of one step.
        min_step: to which switching points are located [s].
        max_step: longest step [s]; the scene's if None.
        search: how switching points are located: "anticipating", "nested" intervals or "last" step only.
    """

    tolerance: float
    min_step: float
    max_step: float | None
    search: str

    def __post_init__(self) -> None:
        if self.search not in SEARCHES:
            raise ProblemError(f"there is no search {self.search!r}{suggestion(self.search, SEARCHES)}")

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    @abstractmethod
    def scheme(self) -> Scheme:
        """Return how smooth steps are taken."""

    def over(self, system: System, solver: ContactSolver, stop: Stop, max_step: float) -> VariableStep:
        """Return what takes the steps; ``max_step`` [s] is the scene's, which an own one replaces.

        Raises:
            ProblemError: for an option out of range.
        """
        longest, search = max_step if self.max_step is None else self.max_step, SEARCHES[self.search]
        return VariableStep(system, solver, stop, self.tolerance, self.min_step, longest, self.scheme(), search)


@dataclass(frozen=True)
class Extrapolated(Stepper):
    """Moreau's rule, extrapolated between switching points.

    Attributes:
        levels: most sequences of one extrapolation.
    """

    tolerance: float = 1e-7
    min_step: float = 1e-9
    max_step: float | None = None
    levels: int = 4
    search: str = "anticipating"

    def scheme(self) -> Scheme:
        """Return the extrapolation."""
        return Extrapolation(self.levels)


@dataclass(frozen=True)
class StepDoubling(Stepper):
    """The paper's stepper: one step against two halves, and nested intervals."""

    tolerance: float = 1e-5
    min_step: float = 1e-7
    max_step: float | None = None
    search: str = "nested"

    def scheme(self) -> Scheme:
        """Return the one step against two."""
        return DoublingScheme()


STEPPERS: dict[str, type[Stepper]] = {"Extrapolated": Extrapolated, "StepDoubling": StepDoubling}
"""Variable steppers by name."""


def make_stepper(text: str) -> Stepper:
    """Return a stepper: ``make_stepper("Extrapolated(tolerance=1e-8)")``.

    Raises:
        BenchError: for an unknown name or option, with the nearest one, a value of the wrong kind, or a fixed step.
    """
    written = read_name(text, "stepper", "Extrapolated(tolerance=1e-8)", BenchError)
    name, options = written.plain, written.options
    if name == FIXED:
        raise BenchError(
            f"{text} is no variable stepper; ask for a fixed step by --stepper {FIXED} and its size by --step-size, or "
            f"name {' or '.join(STEPPERS)}."
        )
    if name not in STEPPERS:
        raise BenchError(f"there is no stepper {name!r}{suggestion(name, [FIXED, *STEPPERS])}")
    check_options(name, options, inspect.signature(STEPPERS[name]).parameters, BenchError)
    for option, value in options.items():
        wanted = str if option == "search" else int if option == "levels" else float
        if not isinstance(value, (int, float) if wanted is float else wanted) or isinstance(value, bool):
            kind = {str: "a name", int: "a whole number", float: "a number"}[wanted]
            raise BenchError(f"{option} of {name} must be {kind}, got {value!r}.")
    return STEPPERS[name](**options)
