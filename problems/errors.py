"""Errors that users can cause, and the suggestions in their messages."""

import re
import sysconfig
import traceback
from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path


class ProxbenchError(Exception):
    """A user error, whose message states what is wrong, where, and what to do.

    The message names options as in Python, between backticks: ```run_id```, ```force=True```. The command line replaces
    them with ``--run-id`` and ``--force``.
    """

    def __str__(self) -> str:
        return re.sub(r"\s*\n\s*", " ", super().__str__())  # a rejected array, for example, has several lines

    def __reduce__(self) -> tuple[object, ...]:
        # the default calls the class with the message alone, but subclasses build it from other arguments
        return _rebuilt, (type(self), self.args), vars(self)


def _rebuilt(kind: type[ProxbenchError], arguments: tuple[object, ...]) -> ProxbenchError:
    """Return an error without calling its class; ``MemoryError``, a base of one kind, has another ``__new__``."""
    return Exception.__new__(kind, *arguments)


class ProblemError(ProxbenchError, ValueError):
    """A contact problem or its name is not valid."""


class IndefiniteError(ProblemError):
    """A matrix that must be positive semidefinite has a negative eigenvalue."""


class InsufficientMemoryError(ProxbenchError, MemoryError):
    """An array needs more memory than is available; it has not been allocated."""


class PluginError(ProxbenchError, ValueError):
    """A plugin is missing, fails to import, offers a name in use, or breaks its contract."""


MAX_NAMES = 12
"""Largest number of known names that a message lists."""

MIN_SIMILARITY = 0.7
"""Smallest similarity by difflib for a name to be suggested; 'nope' and 'hopper' have 0.6."""

MIN_SIMILARITY_OF_SAME_INITIAL = 0.6
"""Smallest similarity for a name to be suggested if it begins with the first letter of the unknown name."""

LIST_PROBLEMS_COMMAND = "proxbench list problems --suite all"
"""The command that lists all problems."""


def suggestion(name: str, known: Iterable[str], listed_by: str = "") -> str:
    """Return a clause that suggests a valid name, to be appended to an error message.

    The clause is ``"; did you mean 'X'?"`` for the known name most similar to ``name``. If none is similar, it lists
    the known names if there are few, or states their number.

    Args:
        name: the unknown name.
        known: the valid names.
        listed_by: the command that lists the valid names if there are many.
    """
    names = sorted(known)
    lowered = {candidate.lower(): candidate for candidate in names}
    near = _nearest(name.lower(), lowered)
    if near is not None:
        return f"; did you mean {lowered[near]!r}?"
    if len(names) > MAX_NAMES:
        return f"; {len(names)} are known{listed_by and f', and {listed_by} lists them'}."
    return f"; known are {', '.join(names)}." if names else "; none are known."


def _nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is most similar to ``name``; None if none is similar enough."""
    names = list(known)
    for candidate in get_close_matches(name, names, n=len(names) + 1, cutoff=MIN_SIMILARITY_OF_SAME_INITIAL):
        if candidate[:1] == name[:1] or SequenceMatcher(None, candidate, name).ratio() >= MIN_SIMILARITY:
            return candidate
    return None


def error_text(failure: BaseException) -> str:
    """Return the text of an error on one line, without the final full stop."""
    text = str(failure) if isinstance(failure, ProxbenchError) else f"{type(failure).__name__}: {failure}"
    return " ".join(text.split()).rstrip(".")


def first_line(failure: BaseException) -> str:
    """Return the type of an error and the first line of its text, without the final full stop."""
    lines = str(failure).strip().splitlines()
    return type(failure).__name__ + (f": {lines[0][:200].rstrip('.')}" if lines else "")


_LIBRARIES = tuple(Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib", "purelib", "platlib"))

_FRAMEWORK = tuple(Path(__file__).parents[1] / package for package in ("problems", "solvers", "bench"))


def raised_at(failure: BaseException) -> str:
    """Return ``" (line 18 of wrapped.py)"`` for the deepest line of the author's files in a traceback.

    The result is empty if the traceback has only lines of libraries and Proxbench.
    """
    for frame, line in reversed(list(traceback.walk_tb(failure.__traceback__))):
        file = Path(frame.f_code.co_filename)
        is_generated = str(file).startswith("<")
        if not is_generated and not any(file.is_relative_to(folder) for folder in (*_LIBRARIES, *_FRAMEWORK)):
            return f" (line {line} of {file.name})"
    return ""
