"""The elements of a conformance test."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Generic, TypeVar

from ...problems.contact.solver import Solver, shows_iterates

Subject = TypeVar("Subject")


class Violation(AssertionError):  # noqa: N818 - the failure of a test, not of the program
    """A requirement is violated; the message gives the problem and the measured values."""


class NotApplicable(Exception):  # noqa: N818 - not an error
    """A test does not apply to its subject; the message gives the reason."""


@dataclass(frozen=True)
class Check(Generic[Subject]):
    """One conformance test.

    Attributes:
        name: its name in tables.
        promise: the requirement, as a sentence.
        run: raises ``Violation`` if the requirement is violated, and ``NotApplicable`` if it does not apply; other
            exceptions come from the subject.
    """

    name: str
    promise: str
    run: Callable[[Subject], None]

    def __str__(self) -> str:
        return self.name


def requires_iterates(test: Callable[[Solver], None]) -> Callable[[Solver], None]:
    """Restrict a test to solvers with observable iterates."""

    @wraps(test)
    def run(solver: Solver) -> None:
        if not shows_iterates(solver):
            raise NotApplicable("it has no observable iterates (has_iterates is False)")
        test(solver)

    return run


def checks(**tests: Callable[[Subject], None]) -> tuple[Check[Subject], ...]:
    """Return one check per test: the keyword, with spaces for "_", is its name, and the docstring its requirement."""
    return tuple(Check(name.replace("_", " "), (test.__doc__ or "").strip(), test) for name, test in tests.items())
