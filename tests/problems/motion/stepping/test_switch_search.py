"""The lengths that a search for switching points tries."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.scenes.inclines import BlockOnIncline
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping import switch_search
from proxbench.problems.motion.stepping.sequences import Attempt, StepCounter, take_sequence
from proxbench.problems.motion.stepping.step import LawStates
from proxbench.problems.motion.stepping.switch_search import (
    APPROACH,
    BLIND_CUT,
    MEMORY,
    Anticipating,
    Margins,
    NestedIntervals,
)
from proxbench.solvers import Stop, create

MIN_STEP, MAX_STEP = 1e-8, 1e-2


class Announced:
    """Margins that predict a switching point at the given time ``due``, or always immediately."""

    def __init__(self, due: float | None, doubt: float = 0.0) -> None:
        self.due, self.doubt = due, doubt

    def next_switch(self, now: float) -> tuple[float, float]:
        return now if self.due is None else self.due, self.doubt


def anticipating(monkeypatch: pytest.MonkeyPatch, due: float | None, doubt: float = 0.0) -> Anticipating:
    monkeypatch.setattr(switch_search, "Margins", lambda system, horizon: Announced(due, doubt))
    return Anticipating(BouncingBall().system(), MIN_STEP, MAX_STEP)


def test_persistently_wrong_margins_do_not_shorten_all_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A few minimal steps are tried at the expected switch; then steps double up to the requested length."""
    search = anticipating(monkeypatch, None)
    lengths = [search.limited_length(0.0, MAX_STEP) for _ in range(30)]
    assert lengths[:4] == [MIN_STEP] * 4
    assert all(after == min(2.0 * before, MAX_STEP) for before, after in pairwise(lengths[4:]))
    assert lengths[-1] == MAX_STEP


def test_a_step_ends_just_before_a_switch_that_is_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    search = anticipating(monkeypatch, 1.0)
    assert search.limited_length(0.0, MAX_STEP) == MAX_STEP
    assert search.limited_length(1.0 - 0.5 * MAX_STEP, MAX_STEP) == pytest.approx(
        0.5 * (MAX_STEP - MIN_STEP), rel=1e-12
    )
    assert search.limited_length(1.0 - 1.1 * MAX_STEP, MAX_STEP) == MAX_STEP  # predicted, but not within the step
    assert search.limited_length(1.0 - 0.5 * MIN_STEP, MAX_STEP) == MIN_STEP


@pytest.mark.parametrize(("doubt", "way"), [(0.0, 1.0), (0.1, 0.8), (0.34, 0.32), (0.36, 0.5), (10.0, 0.5)])
def test_uncertain_switch_shortens_the_step_by_at_most_half(
    doubt: float, way: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = anticipating(monkeypatch, 1.0, doubt * 0.9 * MAX_STEP)
    assert search.limited_length(1.0 - 0.9 * MAX_STEP, MAX_STEP) == pytest.approx(0.9 * way * MAX_STEP, rel=1e-5)


def switched_after(smooth: float) -> Attempt:
    """Return an attempt whose laws switched after ``smooth`` seconds."""
    return Attempt(None, [], LawStates(), [(None, smooth)] if smooth else [])  # type: ignore[list-item]


@pytest.mark.parametrize(("smooth", "factor"), [(0.0, BLIND_CUT), (0.5, 0.5 * APPROACH), (0.75, 0.75 * APPROACH)])
def test_the_step_after_a_switch_is_a_fraction_of_the_smooth_interval(
    smooth: float, factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = anticipating(monkeypatch, 1.0)
    assert search.length_after_switch(0.0, 1e-3, switched_after(smooth * 1e-3)) == pytest.approx(factor * 1e-3)
    assert search.length_after_switch(0.0, MIN_STEP, switched_after(smooth * MIN_STEP)) == MIN_STEP
    state = State(0.0, np.zeros(1), np.zeros(1))
    passed = Attempt(state, [0.0], LawStates(), [(None, 1e-3)])  # type: ignore[list-item]
    assert search.length_after_switch(0.0, 1e-3, passed) == pytest.approx(APPROACH * 1e-3)


def test_nested_intervals_halve_a_step_and_keep_it_until_the_switch_is_passed() -> None:
    search: Any = NestedIntervals(BouncingBall().system(), MIN_STEP, MAX_STEP)
    assert search.length_after_step(0.0, 1e-3, 1.0) == 2e-3
    assert search.length_after_step(0.0, 1e-3, 1.5e-3) == 1.5e-3
    assert search.length_after_switch(1.0, 8e-3, switched_after(0.0)) == 4e-3
    assert search.length_after_switch(1.0, 1.5 * MIN_STEP, switched_after(0.0)) == MIN_STEP
    search.record_switch(State(1.0, np.zeros(1), np.zeros(1)))
    assert search.length_after_switch(1.0, 8e-3, switched_after(0.0)) == 4e-3
    assert [search.length_after_step(now, 4e-3, 1.0) for now in (1.0, 1.004)] == [4e-3, 4e-3]
    assert search.length_after_step(1.0041, 4e-3, 1.0) == 8e-3  # the end of the failed attempt has passed
    assert search.length_after_step(1.01, 4e-3, 1.0) == 8e-3
    assert search.length_after_switch(1.0, 8e-3, switched_after(0.0)) == 4e-3
    assert search.length_after_switch(1.004, 8e-3, switched_after(0.0)) == 4e-3  # beyond the first attempt
    assert search.length_after_step(1.005, 4e-3, 1.0) == 8e-3


def test_switch_after_none_was_announced_starts_a_new_search(monkeypatch: pytest.MonkeyPatch) -> None:
    margins = Announced(None)
    monkeypatch.setattr(switch_search, "Margins", lambda system, horizon: margins)
    search = Anticipating(BouncingBall().system(), MIN_STEP, MAX_STEP)
    assert [search.limited_length(0.0, MAX_STEP) for _ in range(10)][-1] > MIN_STEP
    margins.due = np.inf
    assert search.limited_length(0.0, MAX_STEP) == MAX_STEP
    margins.due = None
    assert search.limited_length(0.0, MAX_STEP) == MIN_STEP


def falling(gaps: Any) -> MechanicalSystem:
    """Points with gaps that are functions of their coordinates, and no forces."""
    return MechanicalSystem(
        mass=lambda position: np.eye(len(position)),
        force=lambda position, velocity: np.zeros(len(position)),
        gap=gaps,
        directions=lambda position: np.eye(len(position)),
        friction=[0.0, 0.0],
        restitution_normal=[0.0, 0.0],
        restitution_tangential=[0.0, 0.0],
        rows_per_contact=1,
    )


def recorded(margins: Margins, path: Any, times: list[float]) -> Margins:
    """Record the gaps along a path, which is a function of time."""
    for time in times:
        margins.record_gaps(State(time, np.array(path(time)), np.ones(2)))
    return margins


TIMES = [0.0, 0.1, 0.25, 0.3, 0.45]


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_margin_that_is_a_polynomial_vanishes_where_it_is_announced(degree: int) -> None:
    """The contact that closes first is found; the polynomial without its oldest value is the same."""
    margins = recorded(
        Margins(falling(lambda position: position), 10.0), lambda time: [2.0 - time, 1.0 - time**degree], TIMES
    )
    due, doubt = margins.next_switch(TIMES[-1])
    assert due == pytest.approx(1.0, rel=1e-9)
    assert doubt == pytest.approx(0.0, abs=1e-8)


def test_the_root_of_a_lower_degree_bounds_what_is_known_of_a_margin() -> None:
    """A cubic through the last four of five values of t ↦ 1 - t⁴ has another root than the quartic through all five."""
    system = falling(lambda position: position)
    few, many = (
        recorded(Margins(system, 10.0), lambda time: [5.0, 1.0 - time**4], TIMES[-count:]).next_switch(TIMES[-1])
        for count in (4, 5)
    )
    assert many[0] == pytest.approx(1.0, rel=1e-9)
    assert many[1] == pytest.approx(abs(few[0] - many[0]), rel=1e-6)
    assert many[1] > 1e-3


def test_two_values_predict_a_switch_to_half_the_remaining_time_and_one_predicts_none() -> None:
    margins = Margins(falling(lambda position: position), 10.0)
    assert recorded(margins, lambda time: [2.0, 1.0 - time], [0.0]).next_switch(0.0) == (np.inf, np.inf)
    due, doubt = recorded(margins, lambda time: [2.0, 1.0 - time], [0.2]).next_switch(0.2)
    assert (due, doubt) == pytest.approx((1.0, 0.4), rel=1e-9)
    margins.forget()
    assert margins.next_switch(0.2) == (np.inf, np.inf)


def test_growing_or_constant_gap_predicts_no_switch() -> None:
    margins = recorded(Margins(falling(lambda position: position), 10.0), lambda time: [1.0 + time, 1.0], TIMES)
    assert margins.next_switch(TIMES[-1]) == (np.inf, np.inf)


def test_past_roots_are_ignored() -> None:
    """t ↦ (t - 1)(t - 2) falls through zero at 1 and rises at 2."""
    margins = Margins(falling(lambda position: position), 10.0)
    recorded(margins, lambda time: [(time - 1.0) * (time - 2.0), 9.0], TIMES)
    assert margins.next_switch(0.5)[0] == pytest.approx(1.0, rel=1e-6)
    assert margins.next_switch(2.5)[0] == np.inf


def test_only_recent_values_of_gaps_that_may_close_soon_are_stored() -> None:
    """At twice the speed of 1 m/s, gaps of up to 2 · 2 · 0.1 m may close within two steps of the largest length."""
    margins = recorded(Margins(falling(lambda position: position), 0.1), lambda time: [0.41, 0.39], TIMES * 2)
    values: Any = margins
    assert {key: len(kept) for key, kept in values._values.items()} == {("gap", 1): MEMORY}


def test_a_gap_that_closes_within_a_step_is_noticed_and_one_that_was_closed_is_not() -> None:
    margins = Margins(falling(lambda position: position), 1.0)
    states = {name: State(0.0, np.array(q), np.zeros(2)) for name, q in (("open", [1.0, 1.0]), ("one", [1.0, -1.0]))}
    assert margins.penetrates(states["open"], states["one"])
    assert not margins.penetrates(states["one"], states["one"])
    assert not margins.penetrates(states["one"], states["open"])


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize(
    ("slope", "has_ended"), [(0.0, False), (-0.4, False), (-0.9, False), (-1.1, True), (-1.9, True)]
)
def test_a_force_that_ends_after_its_last_evaluation_is_noticed_at_the_end_of_a_step(
    count: int, slope: float, has_ended: bool
) -> None:
    """A mass is pressed onto a floor by the force 1 + slope · t, a function of its other coordinate.

    The force vanishes at t = -1/slope, and is evaluated at (2 count - 1)/(2 count) of the step of 1 s at the latest.
    """
    system = MechanicalSystem(
        mass=lambda position: np.eye(2),
        force=lambda position, velocity: np.array([-1.0 - slope * position[1], 0.0]),
        gap=lambda position: position[:1],
        directions=lambda position: np.array([[1.0], [0.0]]),
        friction=[0.0],
        restitution_normal=[0.0],
        restitution_tangential=[0.0],
        rows_per_contact=1,
    )
    start = State(0.0, np.array([-1e-9, 0.0]), np.array([0.0, 1.0]))
    counter = StepCounter(system, create("SORprox"), Stop(1e-13, 1000))
    sequence = take_sequence(counter, start, 1.0, count, None)
    if slope * (2 * count - 1) / (2 * count) < -1.0:
        assert sequence.end is None  # the force has ended before its last evaluation
    else:
        is_seen = count > 1  # a single value gives a constant
        assert Margins(system, 1.0).has_ended_force(sequence.substeps, sequence.states) is (has_ended and is_seen)


def test_the_reversal_of_a_contact_without_friction_is_not_predicted_as_a_switch() -> None:
    """A block pushed up a smooth slope stops after v / (g sin θ) and slides down; no law switches."""
    block = BlockOnIncline(slope=0.3, friction=0.0, speed=-1.0)
    margins = Margins(block.system(), 1.0)
    counter = StepCounter(block.system(), create("SORprox"), Stop(1e-13, 1000))
    sequence = take_sequence(counter, block.start(), 1e-2, 3, None)
    for step, length in sequence.substeps:
        margins.record(step, length, sequence.states)
    assert margins.next_switch(0.01)[0] > 2.0 / (9.81 * np.sin(0.3))


def test_a_contact_without_a_friction_law_does_not_hide_the_switch_of_another_contact() -> None:
    """Two masses slide on a floor at 1 m/s, one of them with friction, which stops it after v / (μ g)."""
    directions = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    system = MechanicalSystem(
        mass=lambda position: np.eye(4),
        force=lambda position, velocity: np.array([0.0, -9.81, 0.0, -9.81]),
        gap=lambda position: position[1::2],
        directions=lambda position: directions,
        friction=[0.5, 0.0],
        restitution_normal=[0.0, 0.0],
        restitution_tangential=[0.0, 0.0],
        rows_per_contact=[2, 1],
    )
    margins = Margins(system, 1.0)
    start = State(0.0, np.full(4, -1e-9), np.array([1.0, 0.0, 1.0, 0.0]))
    sequence = take_sequence(StepCounter(system, create("SORprox"), Stop(1e-13, 1000)), start, 1e-2, 3, None)
    for step, length in sequence.substeps:
        margins.record(step, length, sequence.states)
    assert margins.next_switch(0.01)[0] == pytest.approx(1.0 / (0.5 * 9.81), rel=1e-6)


def test_margins_of_friction_are_what_is_left_of_it_and_how_fast_it_slides() -> None:
    """A block of 1 kg at rest on a slope has the margin μ g cos - g sin; a sliding block stops after v / a."""
    gravity = 9.81
    for speed, friction in ((0.0, 0.5), (1.0, 0.5)):
        block = BlockOnIncline(slope=0.3, friction=friction, speed=speed)
        system = block.system()
        margins = Margins(system, 1.0)
        counter = StepCounter(system, create("SORprox"), Stop(1e-13, 1000))
        state, states = block.start(), None
        for _ in range(3):
            sequence = take_sequence(counter, state, 1e-3, 1, states)
            assert sequence.end is not None
            ((step, length),) = sequence.substeps
            margins.record(step, length, sequence.states)
            state, states = sequence.end, sequence.states
        due, _ = margins.next_switch(state.time)
        if speed:
            deceleration = gravity * (friction * np.cos(0.3) - np.sin(0.3))
            assert due == pytest.approx(speed / deceleration, rel=1e-6)
        else:
            assert due > 100.0
            kept: Any = margins
            assert {key[0] for key in kept._values} == {"force", "slack"}
            slack = next(values for key, values in kept._values.items() if key[0] == "slack")
            normal = next(values for key, values in kept._values.items() if key[0] == "force")
            held = gravity * (friction * np.cos(0.3) - np.sin(0.3)) / (gravity * np.cos(0.3))
            assert slack[-1][1] / normal[-1][1] == pytest.approx(held, rel=1e-6)
