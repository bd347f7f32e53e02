"""Sequences: consecutive steps of one motion, each a contact problem.

A step names the one before it (``BEFORE`` in its provenance) and its contacts (``ContactProblem.keys``). A warm start
takes the impulses of the step before, contact by contact, as steppers do, and zero for a new contact.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arrays import FloatArray, IntArray
from ..contact.problem import ContactProblem

BEFORE = "before"
"""Entry of the provenance of a step: the name of the step before it in its sequence."""

STEP = "step"
"""Entry of the provenance of a step: its number, one more than that of the step before."""

START_DIGITS = 16
"""Number of hexadecimal digits of the digest of a start."""


def continued_impulses(before: ContactProblem, impulses: FloatArray, problem: ContactProblem) -> FloatArray:
    """Return the impulses of the step ``before`` as a start of ``problem``.

    Args:
        before: the step before.
        impulses: its Λ [N s], shape (before.n_rows,).
        problem: the next step.

    Returns:
        Λ [N s], shape (problem.n_rows,): that of the contact with the same key and number of rows, zero elsewhere.
    """
    return np.append(impulses, 0.0)[_continued_rows(before, problem)]  # -1 takes the zero


def start_digest(steps: Sequence[ContactProblem], problem: ContactProblem) -> str:
    """Return a digest of everything outside a problem that determines the warm start of a solver; empty without steps.

    Starts at several tolerances differ, and each is the solver's answer to the same steps. The digest therefore covers
    the numbers of the steps and the rows that each step continues, not the impulses.

    Args:
        steps: the steps before the problem, from the first on.
        problem: the problem.
    """
    if not steps:
        return ""
    sha = hashlib.sha256(b"proxbench warm start 1")
    for before, following in pairwise([*steps, problem]):
        sha.update(before.digest.encode())
        sha.update(_continued_rows(before, following).tobytes())
    return sha.hexdigest()[:START_DIGITS]


def _continued_rows(before: ContactProblem, problem: ContactProblem) -> IntArray:
    """Return the row of ``before`` that each row continues, shape (problem.n_rows,); -1 for none."""
    rows_before = _rows_by_key(before)
    continued = np.full(problem.n_rows, -1, dtype=np.int64)
    for key, rows in _rows_by_key(problem).items():
        known = rows_before.get(key)
        if known is not None and len(known) == len(rows):
            continued[rows] = known
    return continued


@dataclass(frozen=True)
class Predecessors:
    """The steps of a sequence that precede a problem.

    Attributes:
        steps: the steps from the first on; empty for a problem that follows no step.
        missing: why there are none, as a sentence about the problem.
    """

    steps: tuple[ContactProblem, ...] = ()
    missing: str = "it follows no step of a sequence from which to start"


NO_PREDECESSORS = Predecessors()


def predecessors(problem: ContactProblem, find: Callable[[str], ContactProblem | None]) -> Predecessors:
    """Return the steps before ``problem`` in its sequence.

    Args:
        problem: the problem.
        find: returns a problem by name, or None.
    """
    steps, step = list[ContactProblem](), problem
    while name := step.provenance.get(BEFORE):
        found = find(str(name))
        if found is None:
            return Predecessors(missing=f"it follows {name}, which is not available; add it to the run or generate it")
        if not (found.keys and step.keys and _number(found) == _number(step) - 1):
            return Predecessors(missing=f"{name} and {step.name} are not consecutive steps with keys of their contacts")
        steps.insert(0, found)
        step = found
    return Predecessors(tuple(steps)) if steps else NO_PREDECESSORS


def _number(problem: ContactProblem) -> int:
    number = problem.provenance.get(STEP)
    return number if isinstance(number, int) else -2  # the successor of no step


def _rows_by_key(problem: ContactProblem) -> dict[str, IntArray]:
    """Return the rows of each contact, by its key."""
    contact_of_row = problem.layout.contact_of_row
    order = np.argsort(contact_of_row, kind="stable")
    ends = np.cumsum(np.bincount(contact_of_row, minlength=problem.n_contacts))
    return dict(zip(problem.keys, np.split(order, ends[:-1]), strict=True)) if problem.keys else {}
