"""The variable step against the woodpecker's published limit cycle, closed forms, and what it promises of itself."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.scenes.effects import Drag, ball_system
from proxbench.problems.motion.scenes.impacts import NewtonsCradle, ObliqueImpact
from proxbench.problems.motion.scenes.inclines import BlockOnIncline, SlidingSphere, SphereOnIncline
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.resting import Stack, VGroove
from proxbench.problems.motion.scenes.scene import ClosedFormScene, bare_scene
from proxbench.problems.motion.scenes.woodpecker import DESCENT, OVERLAP, PERIOD, section_start, woodpecker
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.sequences import StepCounter, UnsolvedStepError
from proxbench.problems.motion.stepping.step import AcceptedStep, StepError, SwitchingPoint
from proxbench.problems.motion.stepping.step_doubling import StepDoubling
from proxbench.problems.motion.stepping.switch_search import SEARCHES, Anticipating
from proxbench.problems.motion.stepping.variable_stepper import VariableStepper
from proxbench.solvers import Solution, Status, Stop, create

from .published_cycle import INCIDENTS, TIMES


def steps_of(
    system: Any,
    start: State,
    until: float,
    kind: type[VariableStepper] = Extrapolated,
    solver: Any = None,
    **options: Any,
) -> Iterator[AcceptedStep]:
    still = State(0.0, np.ones(1), np.zeros(1))
    scene = replace(bare_scene("own", {}, oscillator(True), still), system=system, start=start)
    chosen: Any = {"tolerance": 1e-6, "min_step": 1e-8, "max_step": 2e-2, **options}
    return kind(**chosen).steps(scene, solver or create("SORprox"), Stop(1e-13, 100_000), start, until)


def cycle(periods: float, **options: Any) -> list[AcceptedStep]:
    return list(steps_of(woodpecker(), section_start(OVERLAP), periods * PERIOD, **options))


def switches(steps: list[AcceptedStep]) -> list[SwitchingPoint]:
    return [switch for step in steps for switch in step.switches]


def section_error(state: State) -> float:
    """Largest error of y, φ_S and its velocity after one period, each over its range in the cycle."""
    start = section_start()
    return max(
        abs(state.position[0] - start.position[0] + DESCENT) / 0.01945,
        abs(state.position[2] - start.position[2]) / 0.47,
        abs(state.velocity[2] - start.velocity[2]) / 17.57,
    )


@pytest.mark.parametrize(
    ("tolerance", "min_step", "error", "solves"),
    [(1e-5, 1e-8, 1e-4, 600), (1e-7, 1e-9, 1e-6, 900), (1e-8, 1e-11, 2.5e-8, 1200)],
)
def test_a_period_of_the_woodpecker_costs_few_solves(
    tolerance: float, min_step: float, error: float, solves: int
) -> None:
    steps = cycle(1.0, tolerance=tolerance, min_step=min_step)
    assert section_error(steps[-1].end) <= error
    assert sum(step.solves for step in steps) <= solves


@pytest.mark.slow
def test_twenty_periods_have_the_twelve_incidents_of_the_published_table_in_order_and_in_time() -> None:
    found = switches(cycle(20.0001, tolerance=1e-9, min_step=1e-10))
    assert [(switch.law, switch.contact + 1, switch.before, switch.after) for switch in found] == [
        incident[1:] for incident in INCIDENTS
    ] * 20
    times = np.array([0.5 * (switch.begin + switch.end) for switch in found]).reshape(20, 12)
    sections = np.append(0.0, times[:-1, -1])
    assert times - sections[:, None] == pytest.approx(np.tile(TIMES, (20, 1)), abs=1e-8)


def test_an_incident_is_located_to_the_minimal_step() -> None:
    found = switches(cycle(1.0001, tolerance=1e-9, min_step=1e-10))
    assert [0.5 * (switch.begin + switch.end) for switch in found] == pytest.approx(TIMES, abs=1e-8)
    assert all(switch.end - switch.begin <= 1.001e-10 for switch in found)


@pytest.mark.slow
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
    """Runs into every switching point."""

    def limited_length(self, now: float, length: float) -> float:
        return length


def test_incidents_that_are_not_anticipated_are_located_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
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
        (SphereOnIncline(), 1.0, 1e-12),
        (BlockOnIncline(slope=0.3, friction=0.5, speed=1.0), 2.0, 1e-12),
        (BlockOnIncline(slope=0.6, friction=0.5, speed=-1.0), 2.0, 1e-6),
        (SlidingSphere(), 1.0, 1e-12),
        (ObliqueImpact(), 0.5, 1e-7),
        (NewtonsCradle(), 0.5, 1e-7),
        (Stack(), 1.0, 1e-12),
        (VGroove(slope=0.0), 1.0, 1e-12),
    ],
    ids=lambda value: type(value).__name__,
)
@pytest.mark.parametrize("kind", [Extrapolated, StepDoubling])
def test_scenes_follow_their_closed_forms(
    scene: ClosedFormScene, until: float, accuracy: float, kind: type[VariableStepper]
) -> None:
    """Where accelerations are constant between switches, only the minimal step around a switch makes an error."""
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


def oscillator(reversible: bool) -> MechanicalSystem:
    """A unit mass on a unit spring, damped unless it is reversible, and a contact that is never reached."""
    mass = np.eye(1)
    return MechanicalSystem(
        mass=lambda position: mass,
        force=lambda position, velocity: -position if reversible else -position - 0.5 * velocity,
        gap=lambda position: position + 10.0,
        directions=lambda position: np.ones((1, 1)),
        friction=[0.0],
        restitution_normal=[0.0],
        restitution_tangential=[0.0],
        rows_per_contact=1,
        is_reversible=reversible,
    )


def estimated_errors(system: Any, start: State, levels: int) -> list[float]:
    """Return the error estimates of a step and of one half as long."""
    stepper = Extrapolated(tolerance=1e-300, levels=levels)
    counter = StepCounter(system, create("SORprox"), Stop(1e-12))

    def error(length: float) -> float:
        largest: Any = lambda difference: float(np.abs(difference).max())  # noqa: E731
        return stepper.attempt(counter, start, length, None, relative_error=largest, levels=levels).errors[-1]

    return [error(length) for length in (0.1, 0.05)]


@pytest.mark.parametrize(("levels", "reversible", "order"), [(2, True, 3), (3, True, 5), (2, False, 2), (3, False, 3)])
def test_the_error_estimate_falls_with_the_order_that_step_control_reckons_with(
    levels: int, reversible: bool, order: int
) -> None:
    system = oscillator(reversible)
    coarse, fine = estimated_errors(system, State(0.0, np.array([1.0]), np.array([0.3])), levels)
    assert Extrapolated(levels=levels).error_order(levels, system) == order
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("levels", [2, 3])
def test_balls_which_drag_slows_down_are_extrapolated_with_all_powers_of_the_step(levels: int) -> None:
    """Balls declare nothing about reversibility, and drag is irreversible."""
    system = ball_system(np.array([0.1]), np.array([1.0]), [], (Drag(0.5),))
    start = State(0.0, np.array([0.0, 0.0, 9.0]), np.array([1.0, 0.0, 0.5]))
    coarse, fine = estimated_errors(system, start, levels)
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


def test_steps_join_without_gap_and_end_at_the_given_time() -> None:
    for options in ({}, {"kind": StepDoubling, "search": "nested", "max_step": 5e-3}):
        steps = cycle(0.5, tolerance=1e-4, min_step=1e-6, **options)
        for before, after in pairwise(steps):
            assert after.begin is before.end
        assert steps[-1].end.time == pytest.approx(0.5 * PERIOD, abs=1e-9)
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
def test_it_costs_a_thousandth_of_fixed_steps_at_equal_accuracy() -> None:
    """5000 fixed steps cost eight times as much and are a thousand times less accurate; they are of first order.

    What they would cost at equal accuracy is extrapolated from the measured order, not run.
    """
    state = section_start()
    for step in MidpointRule(woodpecker(), create("SORprox"), Stop(1e-12, 100_000), PERIOD / 5000).steps(state, 5000):
        state = step.state
    steps = cycle(1.0, tolerance=1e-6, min_step=1e-8)
    assert sum(step.solves for step in steps) < 800
    assert section_error(steps[-1].end) < 1e-3 * section_error(state)


class Failing:
    """SORprox until its patience is over."""

    def __init__(self, after: int, failure: Status | Exception) -> None:
        self._solver, self._left, self._failure = create("SORprox"), after, failure

    def prepare(self, problem: ContactProblem) -> Any:
        self._left -= 1
        if self._left >= 0:
            return self._solver.prepare(problem)
        if isinstance(self._failure, Exception):
            raise self._failure
        return self

    def solve(self, stop: Stop, start: Any = None) -> Solution:
        assert isinstance(self._failure, Status)
        return Solution(np.zeros(2), self._failure, 1)


@pytest.mark.parametrize("search", ["anticipating", "nested"])
@pytest.mark.parametrize("failure", [Status.INFEASIBLE, RuntimeError("no luck")])
def test_a_failing_solver_ends_the_motion_with_the_last_good_state(failure: Status | Exception, search: str) -> None:
    steps = steps_of(woodpecker(), section_start(OVERLAP), PERIOD, solver=Failing(100, failure), search=search)
    reached: list[State] = []
    with pytest.raises(StepError, match=r"from t = 0\.\d+ s") as raised:
        reached.extend(step.end for step in steps)
    assert len(reached) > 10
    assert raised.value.state is reached[-1]
    rest = list(steps_of(woodpecker(), raised.value.state, PERIOD))
    assert section_error(rest[-1].end) < 1e-4


def test_a_step_of_a_switch_that_is_not_solved_ends_the_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the shortest one already. An attempt of it has found the switch, and it is taken again to be accepted."""
    taken, take = [(State(-1.0, np.zeros(3), np.zeros(3)), 0.0)], StepCounter.take

    def fail_once(counter: StepCounter, state: State, length: float, held: tuple[int, ...] = ()) -> Any:
        taken.append((state, length))
        if taken[-2][0] is state and taken[-2][1] == length and len(failed) < 1:
            failed.append(state)
            raise UnsolvedStepError(str(Status.ITERATION_LIMIT))
        return take(counter, state, length, held)

    failed: list[State] = []
    monkeypatch.setattr(StepCounter, "take", fail_once)
    ball = BouncingBall()
    with pytest.raises(StepError, match=r"the inclusion of the shortest step, 1e-08 s from t = 0\.45") as raised:
        list(steps_of(ball.system(), ball.start(), 0.6))
    assert failed == [raised.value.state]


class NotANumber(Failing):
    """SORprox until its patience is over; then NaN, which it calls solved."""

    def solve(self, stop: Stop, start: Any = None) -> Solution:
        return Solution(np.full(2, np.nan), Status.SOLVED, 1)


@pytest.mark.parametrize("search", ["anticipating", "nested"])
def test_nan_that_a_solver_calls_solved_never_becomes_a_state(search: str) -> None:
    steps = steps_of(woodpecker(), section_start(OVERLAP), PERIOD, solver=NotANumber(100, Status.SOLVED), search=search)
    reached: list[State] = []
    with pytest.raises(StepError, match="'solved, but with impulses that are not finite'") as raised:
        reached.extend(step.end for step in steps)
    assert all(np.isfinite([*state.position, *state.velocity]).all() for state in [*reached, raised.value.state])
    assert raised.value.state is reached[-1]


def test_a_singular_mass_matrix_is_an_error_with_the_time() -> None:
    broken = replace(oscillator(True), mass=lambda position: np.zeros((1, 1)))
    with pytest.raises(StepError, match=r"t = 0 s.*not positive definite"):
        next(steps_of(broken, State(0.0, np.ones(1), np.zeros(1)), 1.0))


def test_directions_of_the_wrong_shape_are_an_error_with_the_time() -> None:
    broken = replace(oscillator(True), directions=lambda position: np.ones((1, 2)))
    with pytest.raises(StepError, match=r"t = 0 s.*W\(q\) is \(1, 2\), not \(1, 1\)"):
        next(steps_of(broken, State(0.0, np.array([-11.0]), np.zeros(1)), 1.0))


@pytest.mark.parametrize(
    ("broken", "what"),
    [
        ({"gap": lambda position: np.ones(2)}, r"gaps g\(q\) is \(2,\), not \(1,\)"),
        ({"force": lambda position, velocity: np.ones((1, 2))}, r"forces h\(q, u\) is \(1, 2\), not \(1,\)"),
        ({"mass": lambda position: np.eye(2)}, r"mass matrix M\(q\) is \(2, 2\), not \(1, 1\)"),
        ({"gap": lambda position: np.full(1, np.nan)}, r"the gaps g\(q\) contain NaN"),
        ({"force": lambda position, velocity: np.full(1, np.nan)}, r"the forces h\(q, u\) contain NaN"),
        ({"mass": lambda position: 1.0 / 0.0}, "ZeroDivisionError: float division by zero"),
    ],
    ids=["gap", "force", "mass", "NaN gap", "NaN force", "raising"],
)
def test_functions_of_a_system_that_fail_are_an_error_with_the_time(broken: dict[str, Any], what: str) -> None:
    with pytest.raises(StepError, match=f"t = 0 s.*{what}"):
        next(steps_of(replace(oscillator(True), **broken), State(0.0, np.ones(1), np.zeros(1)), 1.0))


def test_a_function_that_raises_later_is_an_error_with_time_and_step() -> None:
    def gap(position: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        if position[0] < 0.5:
            raise OverflowError("too far")
        return position + 10.0

    reached: list[AcceptedStep] = []
    with pytest.raises(
        StepError, match=r"a step of \S+ s from t = \d\.\d+ s failed: OverflowError: too far\."
    ) as raised:
        reached.extend(steps_of(replace(oscillator(True), gap=gap), State(0.0, np.ones(1), np.zeros(1)), 9.0))
    assert raised.value.state is reached[-1].end


@pytest.mark.parametrize("min_step", [1e-300, 1e-17])
def test_a_minimal_step_that_no_clock_resolves_is_refused(min_step: float) -> None:
    with pytest.raises(ProblemError, match=r"too short to separate times up to 0\.145\d+ s; choose at least 2e-15 s"):
        steps_of(woodpecker(), section_start(OVERLAP), PERIOD, min_step=min_step)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"tolerance": 0.0}, "tolerance must be between 0 and 1"),
        ({"min_step": -1.0}, "min_step must be positive"),
        ({"min_step": 1e-3, "max_step": 1e-4}, "max_step must be finite and at least min_step = 0.001"),
    ],
)
def test_options_out_of_range_are_named(options: dict[str, Any], what: str) -> None:
    with pytest.raises(ProblemError, match=what):
        steps_of(oscillator(True), State(0.0, np.ones(1), np.zeros(1)), 1.0, **options)


@pytest.mark.parametrize("until", [-1.0, np.inf, np.nan])
def test_an_end_before_the_start_or_never_is_named(until: float) -> None:
    with pytest.raises(ProblemError, match=f"until = {until} s must be finite and after the start at 0.0 s"):
        steps_of(oscillator(True), State(0.0, np.ones(1), np.zeros(1)), until)


def test_extrapolation_needs_two_levels() -> None:
    with pytest.raises(ProblemError, match="levels must be at least 2"):
        Extrapolated(levels=1)
