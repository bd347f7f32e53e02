"""The midpoint rule converges to each closed form with the expected order."""

import os

import convergence_orders
import numpy as np
import pytest
from convergence_orders import EXACT, STOP, Case

CASES = {case.name: case for case in convergence_orders.cases()}

MARKS = {
    "tipping_box": pytest.mark.weekly,
    **dict.fromkeys(("four_bar", "spinning_top, on a joint", "pendulum"), pytest.mark.slow),
}
"""The marks of scenes that take half a second and more."""


@pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, ())) for name in CASES])
def test_the_error_of_a_scene_falls_with_its_order(name: str) -> None:
    case: Case = CASES[name]
    errors = np.array(case.errors())
    if case.order == np.inf:
        assert errors.max() <= EXACT
        return
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders.mean() == pytest.approx(case.order, abs=0.15)
    assert errors.min() > 10.0 * STOP.tolerance


def test_free_bodies_keep_energy_and_momentum() -> None:
    for row in convergence_orders.free(1000):
        assert row["energy"] <= 1e-12
        assert row["|Jω|"] <= 1e-12
        assert row["momentum"] <= 1e-15
        assert row["angular momentum in space"] <= 1e-3


@pytest.mark.weekly
def test_free_bodies_keep_energy_and_momentum_over_many_steps() -> None:
    count = 100_000 if os.environ.get("PROXBENCH_PROFILE") == "full" else 20_000
    for row in convergence_orders.free(count):
        assert row["steps"] == count
        assert row["energy"] <= 1e-16 * count
        assert row["|Jω|"] <= 1e-16 * count
        assert row["momentum"] <= 1e-15
        assert row["angular momentum in space"] <= 1e-3
