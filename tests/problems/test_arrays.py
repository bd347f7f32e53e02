"""Copies of arrays keep every number, or the error names the one that would change."""

from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError, judge
from proxbench.problems.arrays import check_number, frozen


@pytest.mark.parametrize("value", [256, -129, 0.7, np.nan, np.inf])
def test_a_number_that_an_integer_type_cannot_hold_is_reported(value: float) -> None:
    with pytest.raises(ProblemError, match=r"kind\[1\] = .* must be a whole number from -128 to 127"):
        frozen([0, value], np.int8, "kind")


@pytest.mark.parametrize("place", ["G", "W", "M⁻¹", "c", "friction", "impulses"])
def test_a_masked_entry_is_refused_because_its_number_would_be_used(place: str) -> None:
    G, c, mu = np.eye(3), np.array([-1.0, 0.5, 0.2]), np.array([0.3])
    values = {"G": G, "W": G, "M⁻¹": np.ones(3), "c": c, "friction": mu, "impulses": np.zeros(3)}
    masked: dict[str, Any] = {**values, place: np.ma.masked_array(values[place], mask=np.zeros(values[place].shape))}
    solved(**masked)
    masked[place].mask.flat[-1] = True
    last = ", ".join(str(length - 1) for length in values[place].shape)
    with pytest.raises(ProblemError, match=rf"^{place}\[{last}\] is masked; fill it with a number"):
        solved(**masked)


@pytest.mark.parametrize(
    ("values", "place"),
    [
        (np.ma.masked, "G"),
        (np.ma.masked_array(0.5, mask=True), "G"),
        ([1.0, np.ma.masked], r"G\[1\]"),
        ((np.zeros(2), np.ma.masked_array([1.0, 2.0], mask=[False, True])), r"G\[1, 1\]"),
        ([[[1.0]], [[np.ma.masked]]], r"G\[1, 0, 0\]"),
    ],
)
def test_a_masked_entry_in_a_list_or_alone_is_refused(values: Any, place: str) -> None:
    with pytest.raises(ProblemError, match=rf"^{place} is masked; fill it with a number"):
        frozen(values, np.float64, "G")


def test_arrays_with_masks_that_mask_nothing_are_accepted_in_lists() -> None:
    rows = [np.ma.masked_array([1.0, 2.0], mask=[False, False]), [3.0, 4.0]]
    assert frozen(rows, np.float64).tolist() == [[1.0, 2.0], [3.0, 4.0]]


def test_a_list_that_contains_itself_is_refused() -> None:
    values: list[Any] = [1.0]
    values.append(values)
    with pytest.raises(ProblemError, match="must be an array of real numbers"):
        frozen(values, np.float64)


def solved(**values: Any) -> None:
    """Make both forms of a problem, and judge impulses."""
    c, friction = values["c"], values["friction"]
    for problem in (
        ContactProblem.from_delassus(values["G"], c, friction),
        ContactProblem.from_factors(values["W"], values["M⁻¹"], c, friction),
    ):
        judge(problem, values["impulses"])


def test_whole_numbers_of_any_real_type_become_integers() -> None:
    for values in ([0, 3], [0.0, 3.0], np.array([0, 3], dtype=np.uint64), [False, True]):
        array = frozen(values, np.int8)
        assert array.dtype == np.int8
        assert array.tolist() == np.asarray(values).astype(int).tolist()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [9.81, 3, 10**300, np.float32(9.81), np.float16(1e4), np.longdouble(2.0), np.int8(1)])
def test_a_finite_number_of_any_real_type_is_accepted(value: object) -> None:
    check_number("mass", value)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "value", [np.inf, -np.inf, np.nan, np.float32("inf"), np.float32("-inf"), np.float32("nan"), 10**400, "1", 1j, None]
)
def test_what_is_not_a_finite_number_is_refused(value: object) -> None:
    with pytest.raises(ProblemError, match="mass must be a finite number, got"):
        check_number("mass", value)
