"""The cell list finds exactly the overlapping pairs."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems.motion.detection.broad_phase import SKIN, NearPairs, _cell_numbers, overlapping_pairs


def every_pair(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    overlap = apart < radii[:, None] + radii[None]
    return np.argwhere(np.triu(overlap, 1))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 60), dim=st.sampled_from([2, 3]), spread=st.floats(0.1, 50.0))
def test_it_agrees_with_looking_at_every_pair(seed: int, n: int, dim: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    centres, radii = rng.normal(size=(n, dim)) * spread, rng.uniform(0.2, 1.0, n)
    assert np.array_equal(overlapping_pairs(centres, radii), every_pair(centres, radii))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("n", [17, 18, 25, 33, 80])
def test_a_dense_heap_larger_than_the_first_guess_is_found_whole(n: int, dim: int) -> None:
    """Of n balls, (n − 1)/2 pairs a ball overlap, where there is room for 8 of them at first."""
    centres = np.random.default_rng(1).normal(size=(n, dim)) * 0.1
    pairs = overlapping_pairs(centres, np.ones(n))
    assert np.array_equal(pairs, np.column_stack(np.triu_indices(n, 1)))


def test_one_ball_far_away_costs_no_memory_and_no_pairs() -> None:
    centres = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, -1e6]])
    assert overlapping_pairs(centres, np.full(3, 0.3)).tolist() == [[0, 1]]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_pair_is_found_in_whichever_neighbouring_cells_its_balls_lie(dim: int) -> None:
    """Beside two balls that mark the ends of the grid, a pair that overlaps in each of all directions."""
    rng = np.random.default_rng(2)
    ends = np.array([np.full(dim, -5.0), np.full(dim, 5.0)])
    for direction in product((-1.0, 0.0, 1.0), repeat=dim):
        if any(direction):
            step = 0.99 * np.array(direction) / np.linalg.norm(direction)
            for corner in rng.uniform(-1.0, 1.0, (20, dim)):
                centres = np.array([ends[0], corner, corner + step, ends[1]])
                assert overlapping_pairs(centres, np.full(4, 0.5)).tolist() == [[1, 2]]


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_along_the_first_axis_have_consecutive_numbers(dim: int) -> None:
    """Each ball has few candidates; if a row of cells were one range, it would have the whole row."""
    centres = np.zeros((5, dim))
    centres[:, 0] = 0.5 + np.arange(5)
    number, _, _ = _cell_numbers(centres, 1.0)
    assert np.diff(number).tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("step", [0.0, 0.1, 0.4, 0.6, 5.0])
def test_no_pair_is_missed_by_balls_that_move_after_a_search(step: float) -> None:
    """Each ball moves by ``step`` skins at random, ten times; a pair may come nearer by twice as much."""
    rng = np.random.default_rng(3)
    radii, centres = rng.uniform(0.5, 1.0, 200), rng.uniform(0.0, 8.0, (200, 3))
    near = NearPairs(radii)
    for _ in range(10):
        found = set(map(tuple, near.at(centres).tolist()))
        assert found >= set(map(tuple, every_pair(centres, radii).tolist()))
        moves = rng.normal(size=(200, 3))
        centres = centres + step * SKIN * radii.min() * moves / np.linalg.norm(moves, axis=1, keepdims=True)


def test_balls_that_do_not_move_are_searched_once() -> None:
    centres = np.random.default_rng(4).uniform(0.0, 8.0, (50, 3))
    near = NearPairs(np.ones(50))
    along_x = 0.5 * SKIN * np.array([1.0, 0.0, 0.0])
    assert near.at(centres) is near.at(centres + 0.9 * along_x)
    assert near.at(centres) is not near.at(centres + 1.1 * along_x)
