"""The states of laws in a step, and the switches between two states, as in the table of a switching function."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.problems.motion.scenes.inclines import BlockOnIncline
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import (
    LawStates,
    StepError,
    SwitchingPoint,
    are_finite,
    check_finite,
    law_states,
)
from proxbench.solvers import Stop, create

OPEN = LawStates()
STICK = LawStates((7,), (7,))
LEFT = LawStates((7,), (), {7: (-1.0,)})
RIGHT = LawStates((7,), (), {7: (2.0,)})


def switch(law: str, before: str, after: str) -> SwitchingPoint:
    return SwitchingPoint(1.0, 2.0, law, 7, before, after)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("before", "after", "switches"),
    [
        (OPEN, STICK, [switch("unilateral", "open", "closed"), switch("friction", "slip", "stick")]),
        (OPEN, LEFT, [switch("unilateral", "open", "closed")]),
        (STICK, OPEN, [switch("unilateral", "closed", "open"), switch("friction", "stick", "slip")]),
        (LEFT, OPEN, [switch("unilateral", "closed", "open")]),
        (STICK, LEFT, [switch("friction", "stick", "slip")]),
        (RIGHT, STICK, [switch("friction", "slip", "stick")]),
        (LEFT, RIGHT, [switch("friction", "slip", "slip")]),
        (OPEN, OPEN, []),
        (STICK, STICK, []),
        (LEFT, LEFT, []),
    ],
)
def test_a_law_that_projects_in_one_step_and_not_in_the_next_switches(
    before: LawStates, after: LawStates, switches: list[SwitchingPoint]
) -> None:
    """The friction law of an open contact projects, like that of a slipping one."""
    assert list(after.switches_since(before, 1.0, 2.0)) == switches
    assert after.is_unchanged_since(before) is (not switches)


def test_switches_are_listed_by_contact() -> None:
    before = LawStates((2, 5), (2,), {5: (1.0,)})
    found = LawStates((2, 3), (), {2: (1.0,), 3: (1.0,)}).switches_since(before, 0.0, 1.0)
    assert [(one.contact, one.law, one.after) for one in found] == [
        (2, "friction", "slip"),
        (3, "unilateral", "closed"),
        (5, "unilateral", "open"),
    ]


def test_a_perpendicular_slip_is_not_a_reversal() -> None:
    before, across, back = (LawStates((1,), (), {1: slip}) for slip in ((1.0, 0.0), (0.0, 1.0), (-1.0, 9.0)))
    assert across.is_unchanged_since(before)
    assert not back.is_unchanged_since(before)


@pytest.mark.parametrize(("friction", "sticks"), [(0.25, False), (0.35, True)])
def test_a_block_sticks_on_a_slope_less_steep_than_its_friction_and_else_slips_down(
    friction: float, sticks: bool
) -> None:
    """tan 0.3 = 0.309. The friction impulse opposes the sliding velocity."""
    block = BlockOnIncline(slope=0.3, friction=friction, speed=0.0)
    rule = MidpointRule(block.system(), create("SORprox"), Stop(1e-13, 1000), 1e-3)
    *_, step = rule.steps(block.start(), 3)
    states = law_states(step)
    (contact,) = states.closed
    assert states.sticking == ((contact,) if sticks else ())
    assert set(states.slips) == (set() if sticks else {contact})
    assert step.contacts is not None
    if not sticks:
        sliding = step.contacts.transposed_times(step.state.velocity)[1:]
        assert np.dot(states.slips[contact], sliding) < 0.0


@pytest.mark.parametrize("rows", [1, 2])
def test_a_closed_contact_without_friction_neither_sticks_nor_slips(rows: int) -> None:
    """With one row it has no friction law; with two, its coefficient of friction is 0."""
    block = BlockOnIncline(slope=0.3, friction=0.0, speed=1.0)
    directions = np.array([[0.0, 1.0], [1.0, 0.0]])[:, :rows]
    system = replace(block.system(), directions=lambda position: directions, rows_per_contact=rows)
    step = MidpointRule(system, create("SORprox"), Stop(1e-13, 1000), 1e-3).step(block.start())
    assert step.contacts is not None
    states = law_states(step)
    assert states.closed == tuple(step.contacts.keys.tolist())
    assert (states.sticking, dict(states.slips)) == ((), {})


def test_a_contact_that_is_pulled_off_is_open_though_it_takes_part_in_the_step() -> None:
    system = BlockOnIncline(slope=0.3, friction=0.5).system()
    rule = MidpointRule(system, create("SORprox"), Stop(1e-13, 1000), 1e-3)
    below = np.array([0.0, -0.01])
    for speed, is_closed in ((1.0, False), (-1.0, True)):
        step = rule.step(State(0.0, below, np.array([0.0, speed])))
        assert step.contacts is not None
        assert bool(law_states(step).closed) is is_closed


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_state_that_is_not_finite_is_an_error_with_the_last_good_one(wrong: float) -> None:
    good = State(0.25, np.zeros(2), np.zeros(2))
    check_finite(good, good)
    for bad in (State(0.5, np.array([0.0, wrong]), np.zeros(2)), State(0.5, np.zeros(2), np.array([wrong, 0.0]))):
        with pytest.raises(StepError, match=r"no longer finite after t = 0\.25 s") as raised:
            check_finite(good, bad)
        assert raised.value.state is good


def test_a_planar_slip_is_compared_beside_a_contact_that_becomes_spatial() -> None:
    """All contacts of a step have as many friction components as the widest one."""
    before = LawStates(closed=(0,), slips={0: (1.0,)})
    same = LawStates(closed=(0,), slips={0: (2.0, 0.0)})
    back = LawStates(closed=(0,), slips={0: (-2.0, 0.0)})
    assert same.is_unchanged_since(before)
    assert not back.is_unchanged_since(before)
    assert [point.after for point in before.switches_since(back, 0.0, 1.0)] == ["slip"]


@pytest.mark.parametrize("count", [1, 2, 5, 17, 1000])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_are_finite_if_each_of_them_is(count: int, value: float) -> None:
    """The largest numbers are finite, and infinities of both signs do not cancel."""
    numbers = np.full(count, np.finfo(np.float64).max)
    assert are_finite(numbers)
    for place in (0, count // 2, -1):
        spoiled = numbers.copy()
        spoiled[place] = value
        assert not are_finite(spoiled)
        spoiled[0] = -value
        assert not are_finite(spoiled)
    assert are_finite(np.zeros(0))
