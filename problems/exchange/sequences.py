"""Sequences: consecutive steps of one motion, each a contact problem.

A step names the one before it (``BEFORE`` in its provenance) and its contacts (``ContactProblem.keys``). A warm start
takes the impulses of the step before, contact by contact, as steppers do, and zero for a new contact.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray, IntArray
from ..contact.problem import ContactProblem

BEFORE = "before"
"""Entry of the provenance of a step: the name of the step before it in its sequence."""

STEP = "step"
"""Entry of the provenance of a step: its number, one more than that of the step before."""


def continued_impulses(before: ContactProblem, impulses: FloatArray, problem: ContactProblem) -> FloatArray:
    """Return the impulses of the step ``before`` as a start of ``problem``.

    Args:
        before: the step before.
        impulses: its Λ [N s], shape (before.n_rows,).
        problem: the next step.

    Returns:
        Λ [N s], shape (problem.n_rows,): that of the contact with the same key and number of rows, zero elsewhere.
    """
    rows_before = _rows_by_key(before)
    start = np.zeros(problem.n_rows)
    for key, rows in _rows_by_key(problem).items():
        known = rows_before.get(key)
        if known is not None and len(known) == len(rows):
            start[rows] = impulses[known]
    return start


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
