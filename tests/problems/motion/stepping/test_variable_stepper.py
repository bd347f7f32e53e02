"""The variable step against the woodpecker's published limit cycle, closed forms, and its own documentation."""

import os
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.scenes.effects import Drag, ball_system
from proxbench.problems.motion.scenes.impacts import NewtonsCradle, ObliqueImpact
from proxbench.problems.motion.scenes.inclines import BlockOnIncline, SlidingSphere, SphereOnIncline
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.resting import Stack, VGroove
from proxbench.problems.motion.scenes.scene import ClosedFormScene
from proxbench.problems.motion.scenes.woodpecker import OVERLAP, PERIOD, section_start, woodpecker
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.sequences import StepCounter
from proxbench.problems.motion.stepping.step import AcceptedStep, SwitchingPoint
from proxbench.problems.motion.stepping.step_doubling import StepDoubling
from proxbench.problems.motion.stepping.switch_search import SEARCHES, Anticipating
from proxbench.problems.motion.stepping.variable_stepper import VariableStepper
from proxbench.solvers import Stop, create

from .published_cycle import SWITCH_EVENTS, TIMES, section_error
from .variable_steps import oscillator, steps_of


def cycle(periods: float, **options: Any) -> list[AcceptedStep]:
    return list(steps_of(woodpecker(), section_start(OVERLAP), periods * PERIOD, **options))


def switches(steps: list[AcceptedStep]) -> list[SwitchingPoint]:
    return [switch for step in steps for switch in step.switches]


@pytest.mark.parametrize(
    ("tolerance", "min_step", "error", "solves"),
    [(1e-5, 1e-8, 1e-4, 600), (1e-8, 1e-11, 2.5e-8, 1200)],
)
def test_a_period_of_the_woodpecker_costs_few_solves(
    tolerance: float, min_step: float, error: float, solves: int
) -> None:
    steps = cycle(1.0, tolerance=tolerance, min_step=min_step)
    assert section_error(steps[-1].end) <= error
    assert sum(step.solves for step in steps) <= solves


@pytest.mark.weekly
def test_all_periods_have_the_twelve_incidents_of_the_published_table_in_order_and_in_time() -> None:
    periods = 20 if os.environ.get("PROXBENCH_PROFILE") == "full" else 5
    found = switches(cycle(periods + 1e-4, tolerance=1e-9, min_step=1e-10))
    assert [(switch.law, switch.contact + 1, switch.before, switch.after) for switch in found] == [
        incident[1:] for incident in SWITCH_EVENTS
    ] * periods
    times = np.array([0.5 * (switch.begin + switch.end) for switch in found]).reshape(periods, 12)
    sections = np.append(0.0, times[:-1, -1])
    assert times - sections[:, None] == pytest.approx(np.tile(TIMES, (periods, 1)), abs=1e-8)


def test_an_incident_is_located_to_the_minimal_step() -> None:
    found = switches(cycle(1.0001, tolerance=1e-9, min_step=1e-10))
    assert [0.5 * (switch.begin + switch.end) for switch in found] == pytest.approx(TIMES, abs=1e-8)
    assert all(switch.end - switch.begin <= 1.001e-10 for switch in found)


@pytest.mark.weekly
def test_nested_intervals_converge_only_if_both_steps_are_taken_back() -> None:
    def errors(search: str) -> list[float]:
        levels = [(1e-4, 1e-6), (1e-6, 1e-8), (1e-8, 1e-10)]
        return [
            section_error(cycle(1.0, tolerance=tolerance, min_step=min_step, search=search)[-1].end)
            for tolerance, min_step in levels
        ]

    assert all(error > 1e-4 for error in errors("last"))
    coarse, medium, fine = errors("nested")
    assert coarse < 1e-3
    assert medium < 1e-5
    assert fine < 1e-7


class Unforeseen(Anticipating):
    """A search that anticipates no switching point."""

    def limited_length(self, now: float, length: float) -> float:
        return length


@pytest.mark.slow
def test_switching_points_that_were_not_predicted_are_located(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SEARCHES, "unforeseen", Unforeseen)
    found = switches(cycle(1.0001, tolerance=1e-7, min_step=1e-9, search="unforeseen"))
    assert [0.5 * (switch.begin + switch.end) for switch in found] == pytest.approx(TIMES, abs=1e-8)


@pytest.mark.slow
def test_every_search_finds_the_same_incidents() -> None:
    found = [
        [(switch.law, switch.contact, switch.after) for switch in switches(cycle(1.01, search=search))]
        for search in ("anticipating", "nested")
    ]
    assert found[0] == found[1]
    assert len(found[0]) == 12


@pytest.mark.parametrize(
    ("scene", "until", "accuracy"),
    [
        (BouncingBall(), 0.9, 1e-6),
        (SphereOnIncline(), 0.4, 1e-12),
        (BlockOnIncline(slope=0.3, friction=0.5, speed=1.0), 1.0, 1e-12),
        (BlockOnIncline(slope=0.6, friction=0.5, speed=-1.0), 0.5, 1e-6),
        (SlidingSphere(), 1.0, 1e-12),
        (ObliqueImpact(), 0.5, 1e-7),
        (NewtonsCradle(), 0.5, 1e-7),
        (Stack(), 0.3, 1e-12),
        (VGroove(slope=0.0), 0.3, 1e-12),
    ],
    ids=lambda value: type(value).__name__,
)
@pytest.mark.parametrize("kind", [Extrapolated, StepDoubling])
def test_scenes_follow_their_closed_forms(
    scene: ClosedFormScene, until: float, accuracy: float, kind: type[VariableStepper]
) -> None:
    """If accelerations are constant between switches, only the minimal step around a switch has an error."""
    for step in steps_of(scene.system(), scene.start(), until, kind):
        exact = scene.exact(step.end.time)
    assert step.end.time == pytest.approx(until, abs=1e-12)
    assert step.end.position == pytest.approx(exact.position, abs=accuracy)
    assert step.end.velocity == pytest.approx(exact.velocity, abs=accuracy)


def test_a_ball_comes_to_rest_through_the_accumulation_point() -> None:
    ball = BouncingBall()
    *_, last = steps_of(ball.system(), ball.start(), 1.5 * ball.rest_time, min_step=1e-6)
    assert last.end.position == pytest.approx(ball.exact(last.end.time).position, abs=1e-5)
    assert last.states.closed


def test_a_slip_that_turns_round_between_two_steps_is_a_switching_point() -> None:
    block = BlockOnIncline(slope=0.6, friction=0.5, speed=-1.0)
    deceleration = 9.81 * (np.sin(0.6) + 0.5 * np.cos(0.6))
    (turn,) = switches(list(steps_of(block.system(), block.start(), 1.0, StepDoubling)))
    assert (turn.law, turn.before, turn.after) == ("friction", "slip", "slip")
    assert turn.begin - 1e-8 <= 1.0 / deceleration <= turn.end + 1e-8


def estimated_errors(system: Any, start: State, stepper: Any, levels: int) -> list[float]:
    """Return the error estimates of a step and of a step of half the length."""
    counter = StepCounter(system, create("SORprox"), Stop(1e-12))

    def error(length: float) -> float:
        largest: Any = lambda difference: float(np.abs(difference).max())  # noqa: E731
        return stepper.attempt(counter, start, length, None, relative_error=largest, levels=levels).errors[-1]

    return [error(length) for length in (0.1, 0.05)]


@pytest.mark.parametrize(
    ("stepper", "levels", "reversible", "order"),
    [
        (Extrapolated(tolerance=1e-300, levels=2), 2, True, 3),
        (Extrapolated(tolerance=1e-300, levels=3), 3, True, 5),
        (Extrapolated(tolerance=1e-300, levels=2), 2, False, 2),
        (Extrapolated(tolerance=1e-300, levels=3), 3, False, 3),
        (StepDoubling(tolerance=1e-300), 2, True, 3),
        (StepDoubling(tolerance=1e-300), 2, False, 2),
    ],
)
def test_the_error_estimate_falls_with_the_order_that_step_control_assumes(
    stepper: Any, levels: int, reversible: bool, order: int
) -> None:
    system = oscillator(reversible)
    coarse, fine = estimated_errors(system, State(0.0, np.array([1.0]), np.array([0.3])), stepper, levels)
    assert stepper.error_order(levels, system) == order
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("levels", [2, 3])
def test_balls_which_drag_slows_down_are_extrapolated_with_all_powers_of_the_step(levels: int) -> None:
    """Systems of balls do not declare reversibility, and drag is irreversible."""
    system = ball_system(np.array([0.1]), np.array([1.0]), [], (Drag(0.5),))
    start = State(0.0, np.array([0.0, 0.0, 9.0]), np.array([1.0, 0.0, 0.5]))
    coarse, fine = estimated_errors(system, start, Extrapolated(tolerance=1e-300, levels=levels), levels)
    assert Extrapolated(levels=levels).error_order(levels, system) == levels
    assert np.log2(coarse / fine) == pytest.approx(levels, abs=0.2)


def test_tolerance_governs_the_error_of_a_smooth_motion() -> None:
    start, until = State(0.0, np.array([1.0]), np.zeros(1)), 6.0
    for tolerance in (1e-3, 1e-6, 1e-9):
        options = {"tolerance": tolerance, "max_step": 5.0, "levels": 5}
        steps = list(steps_of(oscillator(True), start, until, **options))
        assert abs(steps[-1].end.position[0] - np.cos(until)) <= 30.0 * tolerance
        assert sum(step.solves for step in steps) <= 200


@pytest.mark.parametrize("search", SEARCHES)
def test_a_step_rejected_for_its_error_alone_withdraws_no_accepted_step(
    search: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mass flies freely onto a stiff spring, without a switch, so that attempts never begin at an earlier time."""
    begins: list[float] = []
    attempt = Extrapolated.attempt

    def noted(stepper: Extrapolated, counter: StepCounter, state: State, *others: Any, **options: Any) -> Any:
        assert state.time >= max(begins, default=0.0)
        begins.append(state.time)
        return attempt(stepper, counter, state, *others, **options)

    monkeypatch.setattr(Extrapolated, "attempt", noted)
    spring = replace(oscillator(True), force=lambda position, velocity: -1e4 * np.minimum(position, 0.0))
    start = State(0.0, np.array([0.5]), np.array([-1.0]))
    steps = list(steps_of(spring, start, 0.52, search=search, tolerance=1e-4))
    assert len(begins) > len(steps)  # some are rejected
    assert sum(step.rejected for step in steps) == len(begins) - len(steps)


def test_steps_join_without_gap_and_end_at_the_given_time() -> None:
    for options in ({}, {"kind": StepDoubling, "search": "nested", "max_step": 5e-3}):
        steps = cycle(0.25, tolerance=1e-4, min_step=1e-6, **options)
        for before, after in pairwise(steps):
            assert after.begin is before.end
        assert steps[-1].end.time == pytest.approx(0.25 * PERIOD, abs=1e-9)
        lengths = [step.end.time - step.begin.time for step in steps[:-1]]
        assert min(lengths) >= 1e-6 * (1 - 1e-6)
        assert max(lengths) <= 2e-2


def test_the_unit_of_length_does_not_change_the_steps() -> None:
    """In millimetres the same steps are taken, up to rounding."""
    scale = 1e3
    metres = oscillator(True)
    millimetres = replace(metres, gap=lambda position: position + 10.0 * scale)
    ends = []
    for system, unit in ((metres, 1.0), (millimetres, scale)):
        start = State(0.0, np.array([unit]), np.zeros(1))
        ends.append([step.end.time for step in steps_of(system, start, 3.0)])
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def test_colliding_balls_switch_alike_under_both_searches() -> None:
    scene = make_scene("funnel", {"balls": 3, "outlet": 3.0})
    found = []
    for search in ("anticipating", "nested"):
        options = {"search": search, "tolerance": 1e-5, "min_step": 1e-7, "max_step": 2e-3}
        found.append(switches(list(steps_of(scene.system, scene.start, 0.2, **options))))
    assert len(found[0]) > 4
    assert [(s.law, s.contact, s.after) for s in found[0]] == [(s.law, s.contact, s.after) for s in found[1]]
    assert [s.begin for s in found[0]] == pytest.approx([s.begin for s in found[1]], abs=1e-5)


@pytest.mark.slow
def test_variable_steps_cost_a_thousandth_of_fixed_steps_at_equal_accuracy() -> None:
    """5000 fixed steps take eight times as many solves and are a thousand times less accurate; they are of first order.

    Their number at equal accuracy is extrapolated from this order, not measured.
    """
    state = section_start()
    for step in MidpointRule(woodpecker(), create("SORprox"), Stop(1e-12, 100_000), PERIOD / 5000).steps(state, 5000):
        state = step.state
    steps = cycle(1.0, tolerance=1e-6, min_step=1e-8)
    assert sum(step.solves for step in steps) < 800
    assert section_error(steps[-1].end) < 1e-3 * section_error(state)
