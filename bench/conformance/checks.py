"""What a conformance test is."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Generic, TypeVar

from ...problems.contact.solver import Solver, shows_iterates

Subject = TypeVar("Subject")


class Violation(AssertionError):  # noqa: N818 - of a promise, and a failed test where tests run
    """A promise is broken; the text says how, on which problem, and what was measured."""


class NotApplicable(Exception):  # noqa: N818 - no error
    """A test does not apply to its subject; the text gives the reason."""


@dataclass(frozen=True)
class Check(Generic[Subject]):
    """One conformance test.

    Attributes:
        name: what tables call it.
        promise: what it requires, a sentence.
        run: raises ``Violation`` if the promise is broken, ``NotApplicable`` if it does not concern the subject;
            whatever else it raises comes from the subject.
    """

    name: str
    promise: str
    run: Callable[[Subject], None]

    def __str__(self) -> str:
        return self.name


def of_iterates(test: Callable[[Solver], None]) -> Callable[[Solver], None]:
    """Restrict a test to solvers that show iterates."""

    @wraps(test)
    def run(solver: Solver) -> None:
        if not shows_iterates(solver):
            raise NotApplicable("it has no iterates to show (has_iterates is False)")
        test(solver)

    return run


def checks(**tests: Callable[[Subject], None]) -> tuple[Check[Subject], ...]:
    """Return tests with the names of the arguments, "_" for a space; the docstring of each is its promise."""
    return tuple(Check(name.replace("_", " "), (test.__doc__ or "").strip(), test) for name, test in tests.items())
