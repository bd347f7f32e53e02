"""Known solutions match their problem, and errors are distances to them."""

from typing import Any

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.contact.answer import Answer

SUM = {"functionals": np.array([[1.0, 1.0, 0.0]]), "values": np.array([3.0])}


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"functionals": SUM["functionals"]}, "belong together"),
        ({"values": SUM["values"]}, "belong together"),
        (SUM | {"values": np.ones(2)}, r"answer.functionals must have shape \(len\(values\), 3\), got \(1, 3\)"),
        (SUM | {"functionals": np.ones((1, 4))}, r"got \(1, 4\)"),
        ({"impulses": (np.ones(3), np.ones(2))}, r"answer.impulses\[1\] must have shape \(3,\), got \(2,\)"),
        ({"velocity": np.ones(4)}, "answer.velocity"),
        ({"witness": np.ones((1, 3))}, "answer.witness"),
    ],
)
def test_inconsistent_parts_of_an_answer_are_refused(known: dict[str, Any], words: str) -> None:
    Answer(impulses=(np.ones(3),), velocity=np.ones(3), witness=np.ones(3), **SUM).check(3)
    with pytest.raises(ProblemError, match=words):
        Answer(**known).check(3)


def test_the_error_is_that_to_the_nearest_solution_or_else_of_the_known_sums() -> None:
    several = Answer(impulses=(np.zeros(3), np.array([1.0, 1.0, 1.0])))
    assert several.impulse_error([1.0, 1.25, 1.0]) == 0.25
    assert Answer(**SUM).impulse_error([1.0, 1.5, 7.0]) == 0.5
    assert Answer().impulse_error([1.0, 1.5, 7.0]) is None


@pytest.mark.parametrize("sensitivity", [0.0, -1.0, np.inf, np.nan, 1j, np.complex128(1.0), "1", None])
def test_a_sensitivity_that_is_not_a_positive_finite_number_is_refused(sensitivity: Any) -> None:
    with pytest.raises(ProblemError, match=r"answer\.sensitivity must be a positive, finite number"):
        Answer(sensitivity=sensitivity)
