"""What a conformance test is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

Subject = TypeVar("Subject")


class Violation(AssertionError):  # noqa: N818 - of a promise, and a failed test where tests run
    """A promise is broken; the text says how, on which problem, and what was seen."""


class NotApplicable(Exception):  # noqa: N818 - no error
    """A test has nothing to say about its subject; the text says why."""


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
