"""The cell list finds exactly the overlapping pairs."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems.motion.detection import broad_phase
from proxbench.problems.motion.detection.broad_phase import (
    MAX_QUERIES,
    MAX_SKIN,
    MAX_SKIN_OF_FEW,
    MIN_QUERIES,
    MIN_SKIN,
    SPEED_MARGIN,
    NearPairs,
    _limits_of_radii,
    near_bodies,
    overlapping_pairs,
)


def every_pair(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    overlap = apart < radii[:, None] + radii[None]
    return np.argwhere(np.triu(overlap, 1))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 60), dim=st.sampled_from([2, 3]), spread=st.floats(0.1, 50.0))
def test_broad_phase_agrees_with_testing_every_pair(seed: int, n: int, dim: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    centres, radii = rng.normal(size=(n, dim)) * spread, rng.uniform(0.2, 1.0, n)
    assert np.array_equal(overlapping_pairs(centres, radii), every_pair(centres, radii))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(10, 80), dim=st.sampled_from([2, 3]), ratio=st.floats(1.5, 6.0))
def test_pairs_with_a_few_large_balls_are_those_of_testing_every_pair(
    seed: int, n: int, dim: int, ratio: float
) -> None:
    """A tenth of the balls are large, some of which overlap each other."""
    rng = np.random.default_rng(seed)
    centres, radii = rng.uniform(0.0, 2.0 * n ** (1.0 / dim), (n, dim)), rng.uniform(0.4, 0.5, n)
    large = rng.choice(n, n // 10, replace=False)
    radii[large] *= ratio
    centres[large] *= 0.5
    limit = _limits_of_radii(radii)[1]
    assert set(np.flatnonzero(radii > limit)) in (set(), set(large))
    assert np.array_equal(overlapping_pairs(centres, radii), every_pair(centres, radii))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(10, 40), dim=st.sampled_from([2, 3]))
def test_a_ball_without_a_position_hides_no_pair_of_small_and_large_balls(seed: int, n: int, dim: int) -> None:
    rng = np.random.default_rng(seed)
    centres, radii = rng.integers(0, 6, (n, dim)).astype(float), np.full(n, 0.5)
    radii[0] = 2.0
    centres[-1, rng.integers(dim)] = rng.choice([np.nan, np.inf, -np.inf])
    assert np.array_equal(overlapping_pairs(centres, radii), every_pair(centres[:-1], radii[:-1]))


def test_a_large_ball_that_overlaps_a_dense_heap_is_found_with_all_of_it() -> None:
    """The pairs exceed the first guess, so that both searches are repeated with more space."""
    centres = np.random.default_rng(1).normal(size=(60, 3)) * 0.1
    radii = np.append(np.ones(59), 5.0)
    assert _limits_of_radii(radii)[1] < 5.0
    assert np.array_equal(overlapping_pairs(centres, radii), np.column_stack(np.triu_indices(60, 1)))


def test_a_few_large_balls_do_not_widen_the_cells_of_all_others() -> None:
    """With 5 % of large balls, the others are searched in narrow cells; with 50 %, all balls are in wide ones."""
    radii = np.ones(100)
    radii[:5] = 2.0
    assert _limits_of_radii(radii) == (2.0, pytest.approx(1.15 * 1.05))
    radii[:50] = 2.0
    assert _limits_of_radii(radii) == (2.0, 2.0)
    assert _limits_of_radii(np.ones(100)) == (1.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n_moving=st.integers(0, 20), n_fixed=st.integers(0, 4), margin=st.floats(0.0, 1.0))
def test_bodies_are_near_each_other_and_fixed_ones_unless_they_are_excluded(
    seed: int, n_moving: int, n_fixed: int, margin: float
) -> None:
    rng, n = np.random.default_rng(seed), n_moving + n_fixed
    centres, radii = rng.normal(size=(n, 3)) * 2.0, rng.uniform(0.2, 1.0, n)
    radii[n_moving::2] = np.inf  # half-spaces
    expected = every_pair(centres, radii + 0.5 * margin)
    expected = expected[expected[:, 0] < n_moving]
    excluded = np.unique(rng.integers(0, n * n, 3 * n) if n else np.zeros(0, dtype=np.int64))
    none = np.zeros(0, dtype=np.int64)
    assert np.array_equal(near_bodies(centres, radii, n_moving, margin, none), expected)
    kept = expected[~np.isin(expected @ [n, 1], excluded)]
    assert np.array_equal(near_bodies(centres, radii, n_moving, margin, excluded), kept)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("n", [17, 18, 25, 33, 80])
def test_a_dense_heap_larger_than_the_first_guess_is_found_whole(n: int, dim: int) -> None:
    """All n balls overlap, which gives (n − 1)/2 pairs per ball; the first guess has space for 8."""
    centres = np.random.default_rng(1).normal(size=(n, dim)) * 0.1
    pairs = overlapping_pairs(centres, np.ones(n))
    assert np.array_equal(pairs, np.column_stack(np.triu_indices(n, 1)))


def test_pairs_that_exceed_the_first_guess_by_one_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """One pair overlaps, and pairs that are tested after it do not."""
    monkeypatch.setattr(broad_phase, "USUAL_PAIRS", 0)
    centres, radii = np.array([[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [1.95, 0.5, 0.0]]), np.full(3, 0.5)
    assert np.array_equal(overlapping_pairs(centres, radii), every_pair(centres, radii))
    assert len(every_pair(centres, radii)) == 1


def test_distant_ball_needs_no_memory_and_adds_no_pairs() -> None:
    centres = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, -1e6]])
    assert overlapping_pairs(centres, np.full(3, 0.3)).tolist() == [[0, 1]]


@pytest.mark.parametrize("extent", [1e5, 1e7, 1e10, 1e14])
@pytest.mark.parametrize("dim", [2, 3])
def test_pairs_are_found_at_any_distance_from_each_other(extent: float, dim: int) -> None:
    """The cells of an extent of more than about 1e6 diameters in space are too many to be numbered."""
    rng = np.random.default_rng(3)
    scattered = rng.uniform(0.0, extent, (200, dim))
    centres = np.vstack([scattered, scattered + rng.uniform(-0.5, 0.5, scattered.shape)])
    radii = np.full(len(centres), 0.5)
    pairs = overlapping_pairs(centres, radii)
    assert len(pairs) > 150
    assert np.array_equal(pairs, every_pair(centres, radii))


@pytest.mark.parametrize("far", [-1e16, 1e16, 1e300])
def test_a_distant_ball_does_not_hide_a_pair_by_rounding(far: float) -> None:
    for axis in range(3):
        centres = np.zeros((3, 3))
        centres[:, axis] = far, 0.9, 1.1
        assert overlapping_pairs(centres, np.full(3, 0.5)).tolist() == [[1, 2]]
    spread = np.array([[-1e308, 0.0], [1e308, 0.0], [1e308, 0.9]])
    assert overlapping_pairs(spread, np.full(3, 0.5)).tolist() == [[1, 2]]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_pair_is_found_in_whichever_neighbouring_cells_its_balls_lie(dim: int) -> None:
    """Two balls mark the ends of the grid; a further pair overlaps in each possible direction."""
    rng = np.random.default_rng(2)
    ends = np.array([np.full(dim, -5.0), np.full(dim, 5.0)])
    for direction in product((-1.0, 0.0, 1.0), repeat=dim):
        if any(direction):
            step = 0.99 * np.array(direction) / np.linalg.norm(direction)
            for corner in rng.uniform(-1.0, 1.0, (20, dim)):
                centres = np.array([ends[0], corner, corner + step, ends[1]])
                assert overlapping_pairs(centres, np.full(4, 0.5)).tolist() == [[1, 2]]


@pytest.mark.parametrize("step", [0.0, 0.1, 0.4, 0.6, 1.5, 5.0, 20.0])
def test_no_pair_is_missed_by_balls_that_move_after_a_search(step: float) -> None:
    """Each ball moves randomly by ``step`` skins, ten times; a pair may approach by twice as much."""
    rng = np.random.default_rng(3)
    radii, centres = rng.uniform(0.5, 1.0, 200), rng.uniform(0.0, 8.0, (200, 3))
    near = NearPairs(radii)
    for _ in range(10):
        found = set(map(tuple, near.at(centres).tolist()))
        assert found >= set(map(tuple, every_pair(centres, radii).tolist()))
        moves = rng.normal(size=(200, 3))
        centres = centres + step * MIN_SKIN * radii.min() * moves / np.linalg.norm(moves, axis=1, keepdims=True)


@pytest.mark.parametrize("fast", [0.02, 0.3, 3.0])
def test_no_pair_is_missed_by_balls_of_different_speeds(fast: float) -> None:
    """A tenth of the balls cross the others, and all reverse their velocities from time to time."""
    rng = np.random.default_rng(11)
    radii, centres = rng.uniform(0.5, 1.0, 200), rng.uniform(0.0, 8.0, (200, 3))
    near, velocities = NearPairs(radii), 1e-3 * rng.normal(size=(200, 3))
    velocities[::10] *= 1e3 * fast
    for look in range(60):
        found = set(map(tuple, near.at(centres).tolist()))
        assert found >= set(map(tuple, every_pair(centres, radii).tolist()))
        if look % 20 == 19:
            velocities *= -1.0
        centres = centres + velocities


def test_balls_that_do_not_move_are_searched_once() -> None:
    centres = np.random.default_rng(4).uniform(0.0, 8.0, (50, 3))
    near = NearPairs(np.ones(50))
    along_x = MIN_SKIN * np.array([1.0, 0.0, 0.0])
    assert near.at(centres) is near.at(centres + 0.9 * along_x)
    assert near.at(centres) is not near.at(centres + 1.1 * along_x)


@pytest.mark.parametrize(("n_fast", "widest"), [(10, MAX_SKIN_OF_FEW), (50, MAX_SKIN)])
def test_skins_are_wide_only_if_few_balls_are_fast(n_fast: int, widest: float) -> None:
    """Balls are so far apart that none of them are near each other, but one fast pair whose gap is the sum of skins."""
    centres, velocity = np.zeros((100, 3)), np.zeros((100, 3))
    centres[:, 1] = 100.0 * np.arange(100)
    velocity[:n_fast, 0] = 0.5
    centres[1, 1] = 2.0 + 2.0 * 0.99 * widest
    near = NearPairs(np.ones(100))
    for look in range(4):
        pairs = near.at(centres + look * velocity)
    assert pairs.tolist() == [[0, 1]]
    centres[1, 1] = 2.0 + 2.0 * 1.01 * widest
    near = NearPairs(np.ones(100))
    assert not [pair for look in range(4) for pair in near.at(centres + look * velocity).tolist()]


@pytest.mark.parametrize(
    ("speed", "queries"),
    [
        (MAX_SKIN / MIN_QUERIES / SPEED_MARGIN, int(MIN_QUERIES)),
        (MAX_SKIN / MAX_QUERIES / SPEED_MARGIN, int(MAX_QUERIES)),
        (0.04 * MIN_SKIN, 25),
    ],
)
def test_a_search_lasts_for_several_queries_of_balls_of_steady_speed(speed: float, queries: int) -> None:
    """Within their bounds, skins become as wide as the balls require; slow balls have the least skin."""
    radii, centres = np.ones(50), np.random.default_rng(6).uniform(0.0, 8.0, (50, 3))
    near, step = NearPairs(radii), np.array([0.98 * speed, 0.0, 0.0])
    found = [near.at(centres + look * step) for look in range(80)]
    searches = [look for look in range(1, 80) if found[look] is not found[look - 1]]
    assert min(np.diff(searches)[1:]) >= queries - 1


def test_a_fast_ball_does_not_widen_the_search_margins_of_slow_ones() -> None:
    """A ball that crosses a grid of balls, none of which are near each other, adds only its own pairs."""
    grid = 2.2 * np.argwhere(np.ones((5, 5, 5)))
    centres = np.vstack([grid, [[-3.0, 4.4, 5.5]]])
    near, step = NearPairs(np.ones(126)), np.zeros((126, 3))
    step[-1, 0] = 0.2
    pairs = np.vstack([near.at(centres + look * step) for look in range(60)])
    assert len(pairs) > 0
    assert (pairs == 125).any(axis=1).all()
