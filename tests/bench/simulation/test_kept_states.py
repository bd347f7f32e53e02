"""Kept states: few, with the first and the last, evenly spaced in time, and independent of interruptions."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from proxbench.bench.simulation.kept_states import KeptStates
from proxbench.problems.motion.state import State

lengths = st.lists(st.floats(1e-3, 3.0), min_size=1, max_size=200)


def state_at(time: float) -> State:
    return State(time, np.zeros(1), np.zeros(1))


def thinned(number: int, times: Sequence[float], marked: Sequence[float] = ()) -> KeptStates:
    kept_states = KeptStates(number, state_at(0.0), 1.0)
    for time in times:
        kept_states.offer(state_at(time), time in marked)
    return kept_states


def kept_times(kept_states: KeptStates) -> list[float]:
    return [state.time for state in kept_states.states]


@pytest.mark.slow
@given(lengths, st.integers(1, 20))
def test_at_most_twice_the_requested_states_are_kept_with_the_ends(steps: list[float], number: int) -> None:
    kept_states = KeptStates(number, state_at(0.0), 1.0)
    for time in np.cumsum(steps):
        kept_states.offer(state_at(float(time)))
        kept = kept_times(kept_states)
        assert len(kept) <= 2 * number
        assert (kept[0], kept[-1]) == (0.0, time)
        assert all(np.diff(kept) > 0.0)


@pytest.mark.parametrize("number", [1, 2, 7, 50])
@pytest.mark.parametrize("steps", [1, 3, 99, 100, 101, 1000])
def test_equal_steps_leave_equal_distances_and_enough_of_them(number: int, steps: int) -> None:
    kept_states = thinned(number, [float(time) for time in range(1, steps + 1)])
    kept = kept_times(kept_states)
    assert set(np.diff(kept)[:-1]) <= {2.0**kept_states.doublings}
    assert len(kept) >= min(number, steps + 1)


@pytest.mark.slow
@given(st.lists(st.floats(0.01, 1.0), min_size=50, max_size=300), st.integers(2, 9))
def test_steps_of_a_third_of_the_spacing_leave_distances_within_a_factor_of_two(
    steps: list[float], number: int
) -> None:
    kept_states = thinned(number, np.cumsum(steps).tolist())
    spacing = 2.0**kept_states.doublings
    assume(max(steps) <= spacing / 3.0)
    # the first cell is half as long, because the start lies in its middle
    distances = np.diff(kept_times(kept_states))[1:-1]
    assert (distances > spacing * 2.0 / 3.0).all()
    assert (distances < spacing * 4.0 / 3.0).all()


@given(lengths, st.integers(1, 9), st.data())
def test_kept_states_do_not_depend_on_interruptions(steps: list[float], number: int, data: st.DataObject) -> None:
    times = np.cumsum(steps).tolist()
    marked = data.draw(st.lists(st.sampled_from(times), max_size=5))
    whole = thinned(number, times, marked)
    cut = data.draw(st.integers(0, len(times)))
    part = thinned(number, times[:cut], marked)
    again = KeptStates(number, state_at(0.0), 1.0)
    again.restore(part.states, [kept.is_marked for kept in part.kept], part.doublings)
    for time in times[cut:]:
        again.offer(state_at(time), time in marked)
    assert kept_times(again) == kept_times(whole)
    assert again.doublings == whole.doublings
    assert set(marked) <= set(kept_times(whole))


def test_a_state_may_be_marked_once_the_next_one_is_known() -> None:
    kept_states = thinned(1, [1.0, 2.0, 3.0, 4.0, 5.1])
    kept_states.offer(state_at(5.1), True)
    kept_states.offer(state_at(6.0))
    assert 5.1 in kept_times(kept_states)
