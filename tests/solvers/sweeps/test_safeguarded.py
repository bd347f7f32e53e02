"""Steps are reduced only if successive increments of a sweep oppose each other."""

from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem
from proxbench.solvers.sweeps.safeguarded import INTERVALS, STEP_REDUCTION, SafeguardedIterates

FIRST = INTERVALS[0]
"""Number of sweeps before the first comparison."""


class Scripted:
    """Iterates of one frictionless contact, each sweep of which adds the next number."""

    def __init__(self, increments: list[float]) -> None:
        self.layout = ContactProblem.from_delassus(np.eye(1), [-1.0], dim=1).layout
        self.padded, self.step_sizes = np.ones(1), np.ones((1, 1))
        self.increments, self.cuts = increments, 0

    def sweep(self, count: int) -> None:
        for _ in range(count):
            self.padded += self.increments.pop(0)

    def scale_steps(self, fraction: np.ndarray) -> None:
        self.cuts += 1
        assert fraction == pytest.approx(STEP_REDUCTION**self.cuts)


def swept(increments: list[float], **scripted: Any) -> Scripted:
    iterates = Scripted(list(increments))
    SafeguardedIterates(iterates).sweep(len(increments))  # type: ignore[arg-type]
    return iterates


@pytest.mark.parametrize(
    ("last_two", "cuts"),
    [
        ((1.0, -1.0), 1),  # opposed, and as large as before
        ((1.0, -0.95), 1),
        ((1.0, -0.85), 0),  # opposed, but it shrinks
        ((1.0, 1.0), 0),
        ((1e-15, -1e-15), 0),  # rounding of an impulse of 1
    ],
)
def test_a_step_is_cut_where_the_last_two_increments_oppose_each_other_and_do_not_shrink(
    last_two: tuple[float, float], cuts: int
) -> None:
    assert swept([0.0] * (FIRST - 2) + list(last_two)).cuts == cuts


def test_increments_are_compared_less_often_while_no_step_is_reduced() -> None:
    """An oscillation between two comparisons is not detected; a lasting one is reduced at each of them."""
    assert swept([0.0] * (FIRST - 3) + [1.0, -1.0, 0.0]).cuts == 0
    assert swept([0.0] * (FIRST + INTERVALS[1] - 2) + [1.0, -1.0]).cuts == 1
    assert swept([(-1.0) ** k for k in range(3 * FIRST)]).cuts == 3


@pytest.mark.parametrize("at", [FIRST - 1, FIRST - 2])
def test_an_external_change_of_the_impulses_is_not_an_increment(at: int) -> None:
    iterates = Scripted([1.0] * 2 * FIRST)
    safeguarded = SafeguardedIterates(iterates)  # type: ignore[arg-type]
    safeguarded.sweep(at)
    safeguarded.padded -= 2.0
    safeguarded.note_jump()
    safeguarded.sweep(FIRST - at + 1)
    assert iterates.cuts == 0
