"""What is measured of the woodpecker: first order with fixed steps, and tolerances that are kept."""

from itertools import pairwise

import numpy as np
import pytest
from proxbench.bench.study import measuring
from proxbench.bench.study.measuring import measure
from proxbench.bench.study.plan import Case
from proxbench.bench.study.points import trajectory_point
from proxbench.problems.mechanics.state import State
from proxbench.problems.scenes.woodpecker import DESCENT, PERIOD, section_start
from proxbench.problems.trajectories.limit_cycle import section_error

from .conftest import fixed_case, toy_case, toy_plan

NEIGHBOURS = (0.98, 0.99, 1.0, 1.01, 1.02)


def median_error(case: Case) -> float:
    found = {member: measure(toy_plan(case), case, member) for member in case.members}
    point = trajectory_point(case, {member: one for member, one in found.items() if one is not None})
    assert point is not None
    assert point.low <= point.error <= point.high
    return point.error


def test_the_section_error_is_the_largest_of_the_three_over_its_range() -> None:
    start = section_start()
    reached = State(PERIOD, start.position - [DESCENT, 0.0, 0.0], start.velocity)
    assert section_error(reached) <= 1e-15
    off = State(
        PERIOD, reached.position + np.array([1e-6, 5.0, 1e-6]), reached.velocity + np.array([7.0, 7.0, 17.57e-3])
    )
    assert section_error(off) == pytest.approx(1e-3)


def test_medians_of_the_fixed_step_fall_with_first_order() -> None:
    coarse, fine = (median_error(fixed_case(steps, members=NEIGHBOURS)) for steps in (200, 1600))
    assert 0.5 < np.log(coarse / fine) / np.log(8) < 1.6


def test_the_error_falls_with_the_tolerance_of_the_stepper() -> None:
    exponents = (3, 5, 7)
    steppers = [f"Extrapolated(tolerance=1e-{k}, min_step=1e-{k + 2})" for k in exponents]
    errors = [median_error(toy_case(stepper=stepper, members=(0.9, 1.0, 1.1))) for stepper in steppers]
    assert all(fine < 0.2 * coarse for coarse, fine in pairwise(errors))
    assert errors[-1] < 1e-6


def test_neighbours_of_a_fixed_step_have_whole_numbers_of_steps() -> None:
    case = fixed_case(100)
    for factor, steps in ((0.98, 98), (1.0, 100), (1.017, 102)):
        one = measure(toy_plan(case), case, factor)
        assert one is not None
        assert one.solves == steps
        assert one.wall > 0.0


def test_a_variable_step_that_flickers_is_given_up_and_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "MOST_SOLVES", 300)
    case = toy_case(stepper="Extrapolated(tolerance=1e-7, min_step=1e-9)", tolerance=1e-4)
    one = measure(toy_plan(case), case, 1.0)
    assert one is not None
    assert one.failure.startswith("given up after 300 one-step solves, at ")
    assert not one.values
    assert trajectory_point(case, {1.0: one}) is None


def test_a_solver_that_fails_is_a_failure_with_its_reason() -> None:
    case = toy_case(solver="CvxpyQP")
    one = measure(toy_plan(case), case, 1.0)
    assert one is not None
    assert "friction" in one.failure


def test_a_solver_that_raises_anything_is_a_failure_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def burst(*given: object, **named: object) -> None:
        raise RuntimeError("it burst")

    monkeypatch.setattr(measuring, "simulate", burst)
    one = measure(toy_plan(toy_case()), toy_case(), 1.0)
    assert one is not None
    assert one.failure == "RuntimeError: it burst"


def test_a_member_that_was_stopped_is_nothing() -> None:
    case = fixed_case(1000)
    assert measure(toy_plan(case), case, 1.0, lambda: True) is None
