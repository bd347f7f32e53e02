"""Which length a search for switching points tries next."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping import switch_search
from proxbench.problems.motion.stepping.sequences import Attempt
from proxbench.problems.motion.stepping.step import LawStates
from proxbench.problems.motion.stepping.switch_search import APPROACH, BLIND_CUT, Anticipating, NestedIntervals

MIN_STEP, MAX_STEP = 1e-8, 1e-2


class Announced:
    """Margins that announce a switching point at a time, or always at once."""

    def __init__(self, due: float | None, doubt: float = 0.0) -> None:
        self.due, self.doubt = due, doubt

    def next_switch(self, now: float) -> tuple[float, float]:
        return now if self.due is None else self.due, self.doubt


def anticipating(monkeypatch: pytest.MonkeyPatch, due: float | None, doubt: float = 0.0) -> Anticipating:
    monkeypatch.setattr(switch_search, "Margins", lambda system, horizon: Announced(due, doubt))
    return Anticipating(BouncingBall().system(), MIN_STEP, MAX_STEP)


def test_margins_that_are_wrong_for_ever_do_not_make_the_motion_creep(monkeypatch: pytest.MonkeyPatch) -> None:
    """A few minimal steps are tried where a switch should be, then steps grow twofold up to the length asked for."""
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
    assert search.limited_length(1.0 - 1.1 * MAX_STEP, MAX_STEP) == MAX_STEP  # in sight, but not within the step
    assert search.limited_length(1.0 - 0.5 * MIN_STEP, MAX_STEP) == MIN_STEP


@pytest.mark.parametrize(("doubt", "way"), [(0.0, 1.0), (0.1, 0.8), (0.34, 0.32), (0.36, 0.5), (10.0, 0.5)])
def test_the_more_a_switch_is_in_doubt_the_more_of_the_way_is_left_but_half_of_it_is_gone(
    doubt: float, way: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = anticipating(monkeypatch, 1.0, doubt * 0.9 * MAX_STEP)
    assert search.limited_length(1.0 - 0.9 * MAX_STEP, MAX_STEP) == pytest.approx(0.9 * way * MAX_STEP, rel=1e-5)


def switched_after(smooth: float) -> Attempt:
    """An attempt whose laws switched behind ``smooth`` seconds."""
    return Attempt(None, [], LawStates(), [(None, smooth)] if smooth else [])  # type: ignore[list-item]


@pytest.mark.parametrize(("smooth", "factor"), [(0.0, BLIND_CUT), (0.5, 0.5 * APPROACH), (0.75, 0.75 * APPROACH)])
def test_after_a_switch_a_part_of_what_was_smooth_is_tried(
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
    search.note_switch(State(1.0, np.zeros(1), np.zeros(1)))
    assert search.length_after_switch(1.0, 8e-3, switched_after(0.0)) == 4e-3
    assert [search.length_after_step(now, 4e-3, 1.0) for now in (1.0, 1.004)] == [4e-3, 4e-3]
    assert search.length_after_step(1.0041, 4e-3, 1.0) == 8e-3  # the end of the attempt is behind
    assert search.length_after_step(1.01, 4e-3, 1.0) == 8e-3
    assert search.length_after_switch(1.0, 8e-3, switched_after(0.0)) == 4e-3
    assert search.length_after_switch(1.004, 8e-3, switched_after(0.0)) == 4e-3  # beyond the first attempt
    assert search.length_after_step(1.005, 4e-3, 1.0) == 8e-3


def test_an_alarm_after_nothing_was_in_sight_is_a_new_one(monkeypatch: pytest.MonkeyPatch) -> None:
    margins = Announced(None)
    monkeypatch.setattr(switch_search, "Margins", lambda system, horizon: margins)
    search = Anticipating(BouncingBall().system(), MIN_STEP, MAX_STEP)
    assert [search.limited_length(0.0, MAX_STEP) for _ in range(10)][-1] > MIN_STEP
    margins.due = np.inf
    assert search.limited_length(0.0, MAX_STEP) == MAX_STEP
    margins.due = None
    assert search.limited_length(0.0, MAX_STEP) == MIN_STEP
