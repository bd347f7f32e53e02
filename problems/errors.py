"""Errors that users can cause, and the suggestions in their messages."""

from collections.abc import Iterable
from difflib import get_close_matches


class ProxbenchError(Exception):
    """A user error, whose message states what is wrong, where, and what to do.

    The message names options as in Python, between backticks: ```run_id```, ```force=True```. The command line replaces
    them with ``--run-id`` and ``--force``.
    """


class ProblemError(ProxbenchError, ValueError):
    """A contact problem or its name is not valid."""


class IndefiniteError(ProblemError):
    """A matrix that must be positive semidefinite has a negative eigenvalue."""


class InsufficientMemoryError(ProxbenchError, MemoryError):
    """An array needs more memory than is available; it has not been allocated."""


class PluginError(ProxbenchError, ValueError):
    """A plugin is missing, fails to import, uses a name that is taken, or breaks its contract."""


MAX_NAMES = 12
"""Largest number of known names that a message lists."""

MIN_SIMILARITY = 0.6
"""Smallest similarity by difflib for a name to be suggested."""

LIST_PROBLEMS_COMMAND = "proxbench list problems --suite all"
"""The command that lists all problems."""


def suggestion(name: str, known: Iterable[str], listed_by: str = "") -> str:
    """Return a clause that suggests a valid name, to be appended to an error message.

    It is ``"; did you mean 'X'?"`` for the known name most similar to ``name``. Otherwise it lists the known names if
    there are few, or states their number.

    Args:
        name: the name given.
        known: the valid names.
        listed_by: the command that lists the valid names if there are many.
    """
    names = sorted(known)
    lowered = {candidate.lower(): candidate for candidate in names}
    close = get_close_matches(name.lower(), lowered, n=1, cutoff=MIN_SIMILARITY)
    if close:
        return f"; did you mean {lowered[close[0]]!r}?"
    if len(names) > MAX_NAMES:
        return f"; {len(names)} are known{listed_by and f', and {listed_by} lists them'}."
    return f"; known are {', '.join(names)}." if names else "; none are known."


def error_text(failure: BaseException) -> str:
    """Return the text of an error in one line, without the full stop."""
    what = str(failure) if isinstance(failure, ProxbenchError) else f"{type(failure).__name__}: {failure}"
    return " ".join(what.split()).rstrip(".")


def first_line(failure: BaseException) -> str:
    """Return the type of an error and the first line of its text, without the full stop."""
    lines = str(failure).strip().splitlines()
    return type(failure).__name__ + (f": {lines[0][:200].rstrip('.')}" if lines else "")
