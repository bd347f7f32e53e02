"""Sequences of contact problems, which are the consecutive steps of one motion.

The provenance of a step names the previous step (``BEFORE``), and ``ContactProblem.keys`` name its contacts. A warm
start copies the impulses of each contact from the previous step, as steppers do, and is zero for a new contact.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arrays import FloatArray, IntArray
from ..contact.problem import ContactProblem

BEFORE = "before"
"""Entry of the provenance of a step: the name of the previous step of the sequence."""

STEP = "step"
"""Entry of the provenance of a step: its number, one more than that of the previous step."""

START_DIGITS = 16
"""Number of hexadecimal digits of a start digest."""


def warm_start_impulses(previous: ContactProblem, impulses: FloatArray, problem: ContactProblem) -> FloatArray:
    """Return initial impulses for ``problem`` from the impulses of the previous step.

    Args:
        previous: the previous step.
        impulses: Λ of the previous step [N s], shape (previous.n_rows,).
        problem: the next step.

    Returns:
        Λ [N s], shape (problem.n_rows,): the impulses of the contact with the same key and the same number of rows in
        the previous step, zero for other contacts.
    """
    return np.append(impulses, 0.0)[_continued_rows(previous, problem)]  # row −1 is the appended zero


def start_digest(steps: Sequence[ContactProblem], problem: ContactProblem) -> str:
    """Return a digest of the data outside a problem that determine the warm start of a solver.

    A solver computes a start by solving the steps in turn, and its impulses depend on the tolerance. The digest
    therefore covers the numbers of the steps, and which rows of the previous step each row continues, but no impulses.

    Args:
        steps: the steps before the problem, beginning with the first.
        problem: the problem.

    Returns:
        ``START_DIGITS`` hexadecimal digits; an empty string without steps.
    """
    if not steps:
        return ""
    sha = hashlib.sha256(b"proxbench warm start 1")
    for previous, following in pairwise([*steps, problem]):
        sha.update(previous.digest.encode())
        sha.update(_continued_rows(previous, following).tobytes())
    return sha.hexdigest()[:START_DIGITS]


def _continued_rows(previous: ContactProblem, problem: ContactProblem) -> IntArray:
    """Return, for each row, the row of the previous step that it continues, shape (problem.n_rows,); −1 for none."""
    previous_rows = _rows_by_key(previous)
    continued = np.full(problem.n_rows, -1, dtype=np.int64)
    for key, rows in _rows_by_key(problem).items():
        old_rows = previous_rows.get(key)
        if old_rows is not None and len(old_rows) == len(rows):
            continued[rows] = old_rows
    return continued


@dataclass(frozen=True)
class Predecessors:
    """The steps of a sequence that precede a problem.

    Attributes:
        steps: the steps, beginning with the first; empty if the problem follows no step, or if one is not available.
        missing: a clause that states why ``steps`` is empty; its subject is the problem or its steps.
    """

    steps: tuple[ContactProblem, ...] = ()
    missing: str = "it follows no step of a sequence, so there is no warm start"


NO_PREDECESSORS = Predecessors()
"""The predecessors of a problem that follows no step."""


def predecessors(problem: ContactProblem, find: Callable[[str], ContactProblem | None]) -> Predecessors:
    """Return the steps before ``problem`` in its sequence.

    Args:
        problem: the problem.
        find: returns the problem with a name, or None if it is not available.

    Returns:
        The steps, or the reason why one of them is not available or two are not consecutive.
    """
    steps, step = list[ContactProblem](), problem
    while name := step.provenance.get(BEFORE):
        previous = find(str(name))
        if previous is None:
            return Predecessors(missing=f"it follows {name}, which is not available; add it to the run or generate it")
        if not (previous.keys and step.keys and _step_number(previous) == _step_number(step) - 1):
            reason = f"{name} and {step.name} are not consecutive steps, or their contacts have no keys"
            return Predecessors(missing=reason)
        steps.insert(0, previous)
        step = previous
    return Predecessors(tuple(steps)) if steps else NO_PREDECESSORS


def _step_number(problem: ContactProblem) -> int:
    number = problem.provenance.get(STEP)
    return number if isinstance(number, int) else -2  # differs by more than 1 from every step number


def _rows_by_key(problem: ContactProblem) -> dict[str, IntArray]:
    """Return the rows of each contact by its key; empty if contacts have no keys."""
    contact_of_row = problem.layout.contact_of_row
    order = np.argsort(contact_of_row, kind="stable")
    ends = np.cumsum(np.bincount(contact_of_row, minlength=problem.n_contacts))
    return dict(zip(problem.keys, np.split(order, ends[:-1]), strict=True)) if problem.keys else {}
