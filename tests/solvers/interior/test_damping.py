"""The share of De Saxcé's term adapts to the steps, within its limits."""

import numpy as np
import pytest
from proxbench.problems import load
from proxbench.problems.contact.transformations import in_units
from proxbench.solvers import Status, Stop, create
from proxbench.solvers.interior.damping import MIN_SHARE, SHARES, ContactDamping, GlobalDamping, Undamped


def test_every_share_begins_with_newton_s_method() -> None:
    for make in SHARES.values():
        assert (make(3).values == 1.0).all()


@pytest.mark.parametrize("make", [GlobalDamping, ContactDamping])
def test_short_steps_reduce_it_to_the_least_and_long_ones_raise_it_to_one(
    make: type[GlobalDamping] | type[ContactDamping],
) -> None:
    share = make(2)
    while (share.values > MIN_SHARE).all():
        share.record(0.1, np.full(2, 0.1))
    assert (share.values == MIN_SHARE).all()
    for _ in range(50):
        share.record(1.0, np.full(2, 5.0))
    assert (share.values == 1.0).all()


@pytest.mark.parametrize("make", [GlobalDamping, ContactDamping])
def test_the_share_returns_to_one_if_steps_stay_short(make: type[GlobalDamping] | type[ContactDamping]) -> None:
    share = make(2)
    while (share.values > MIN_SHARE).all():
        share.record(0.1, np.full(2, 0.1))
    share.record(0.1, np.full(2, 0.1))
    assert (share.values == 1.0).all()


@pytest.mark.parametrize("units", [{}, {"mass": 1e3, "length": 1e3}, {"time": 1e-6}])
def test_contacts_that_neither_open_nor_close_strictly_are_solved_with_damping(units: dict[str, float]) -> None:
    """Damped alone, steps end at the apex of such a contact at a residual of sqrt(tau), 1e-6."""
    problem = in_units(load("hard-mixed-laws"), **units).problem
    solver = create("InteriorPoint", scaling="nesterov_todd", damping="contact")
    solution = solver.prepare(problem).solve(Stop(2e-7, max_iterations=200))
    assert solution.status is Status.SOLVED


def test_each_contact_is_damped_by_its_own_boundary() -> None:
    share = ContactDamping(3)
    share.record(0.2, np.array([0.2, 0.7, 5.0]))
    assert share.values[0] < 1.0
    assert (share.values[1:] == 1.0).all()


def test_newton_s_method_is_never_damped() -> None:
    share = Undamped(2)
    share.record(1e-6, np.full(2, 1e-6))
    assert (share.values == 1.0).all()
