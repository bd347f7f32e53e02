"""Failures that end a motion with a variable step: solvers and systems that fail, and options out of range."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.scenes.woodpecker import OVERLAP, PERIOD, section_start, woodpecker
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.sequences import StepCounter, UnsolvedStepError
from proxbench.problems.motion.stepping.step import AcceptedStep, StepError
from proxbench.solvers import Solution, Status, Stop, create

from .published_cycle import section_error
from .variable_steps import oscillator, steps_of


class Failing:
    """SORprox that fails after a number of solves."""

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


@pytest.mark.parametrize(
    ("failure", "search"),
    [
        (Status.INFEASIBLE, "anticipating"),
        pytest.param(Status.INFEASIBLE, "nested", marks=pytest.mark.slow),
        (RuntimeError("no luck"), "anticipating"),
        (RuntimeError("no luck"), "nested"),
    ],
)
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
    """Such a step cannot be shortened. One attempt has found the switch; a second one is made to accept the step."""
    taken, take = [(State(-1.0, np.zeros(3), np.zeros(3)), 0.0)], StepCounter.take

    def fail_once(counter: StepCounter, state: State, length: float, inelastic: tuple[int, ...] = ()) -> Any:
        taken.append((state, length))
        if taken[-2][0] is state and taken[-2][1] == length and len(failed) < 1:
            failed.append(state)
            raise UnsolvedStepError(str(Status.ITERATION_LIMIT))
        return take(counter, state, length, inelastic)

    failed: list[State] = []
    monkeypatch.setattr(StepCounter, "take", fail_once)
    ball = BouncingBall()
    with pytest.raises(StepError, match=r"the inclusion of the shortest step, 1e-08 s from t = 0\.45") as raised:
        list(steps_of(ball.system(), ball.start(), 0.6))
    assert failed == [raised.value.state]


class NotANumber(Failing):
    """SORprox that returns NaN as solved after a number of solves."""

    def solve(self, stop: Stop, start: Any = None) -> Solution:
        return Solution(np.full(2, np.nan), Status.SOLVED, 1)


@pytest.mark.parametrize("search", ["anticipating", "nested"])
def test_nan_impulses_reported_as_solved_never_reach_the_state(search: str) -> None:
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
        ({"tolerance": 1.0}, "tolerance must be between 0 and 1"),
        ({"min_step": -1.0}, "min_step must be positive"),
        ({"min_step": 1e-3, "max_step": 1e-4}, "max_step must be finite and at least min_step = 0.001"),
    ],
)
def test_error_names_the_invalid_option(options: dict[str, Any], what: str) -> None:
    with pytest.raises(ProblemError, match=what):
        steps_of(oscillator(True), State(0.0, np.ones(1), np.zeros(1)), 1.0, **options)


@pytest.mark.parametrize("until", [-1.0, np.inf, np.nan])
def test_end_before_start_or_infinite_is_rejected(until: float) -> None:
    with pytest.raises(ProblemError, match=f"until = {until} s must be finite and after the start at 0.0 s"):
        steps_of(oscillator(True), State(0.0, np.ones(1), np.zeros(1)), until)


def test_extrapolation_needs_two_levels() -> None:
    with pytest.raises(ProblemError, match="levels must be at least 2"):
        Extrapolated(levels=1)
