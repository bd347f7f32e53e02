"""Tolerances are shown with all their digits."""

import pytest
from proxbench.bench.store.fields import accuracy_tag, exponent


@pytest.mark.parametrize(
    ("tolerance", "tag", "short"),
    [
        (1e-4, "1e-04", "1e-4"),
        (2.4e-4, "2.4e-04", "2.4e-4"),
        (1.23456e-10, "1.23456e-10", "1.23456e-10"),
        (0.1 * 3, "3e-01", "3e-1"),
    ],
)
def test_a_tolerance_is_shown_with_its_digits_and_without_rounding_errors(
    tolerance: float, tag: str, short: str
) -> None:
    assert (accuracy_tag(tolerance), exponent(tolerance)) == (tag, short)


def test_different_tolerances_have_different_texts() -> None:
    tolerances = [1.2e-4, 1.4e-4, 1.23451e-4, 1.23452e-4]
    assert len(set(map(accuracy_tag, tolerances))) == len(set(map(exponent, tolerances))) == len(tolerances)
