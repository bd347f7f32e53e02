"""Curves of observables are drawn in a unit in which their values are readable."""

import numpy as np
import pytest
from proxbench.bench.recordings.scene_recorder import scaled_label, unit_exponent


@pytest.mark.parametrize(
    ("largest", "exponent"),
    [(20.0, 0), (1e-3, 0), (9.9e-4, -6), (2e-6, -6), (9e-7, -9), (1e-9, -9), (9e-10, -9), (1e-17, -9), (0.0, -9)],
)
def test_small_values_are_scaled_to_units_down_to_a_billionth(largest: float, exponent: int) -> None:
    assert unit_exponent(np.array([np.nan, -largest, 0.5 * largest])) == exponent


def test_axis_label_shows_the_power_of_ten_of_its_unit() -> None:
    assert scaled_label("gap [m]", -6) == "gap [10⁻⁶ m]"
    assert scaled_label("gap [m]", 0) == "gap [m]"
