"""Cells hold all balls, and neighbouring cells hold all balls that overlap."""

import numpy as np
import pytest
from proxbench.problems.motion.detection import cells
from proxbench.problems.motion.detection.broad_phase import overlapping_pairs
from proxbench.problems.motion.detection.cells import CELLS_PER_BALL, _cell_numbers, _occupied_cell_numbers


def every_pair(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    overlap = apart < radii[:, None] + radii[None]
    return np.argwhere(np.triu(overlap, 1))


def test_sorting_cells_by_counting_or_comparing_finds_the_same_pairs() -> None:
    """With a distant ball there are too many cells to sort them by counting."""
    rng = np.random.default_rng(5)
    centres, radii = rng.uniform(0.0, 6.0, (80, 3)), rng.uniform(0.3, 0.6, 80)
    assert _cell_numbers(centres, 1.2)[3] <= CELLS_PER_BALL * 80
    far = np.vstack([centres, [[0.0, 0.0, -1e5]]])
    assert _cell_numbers(far, 1.2)[3] > CELLS_PER_BALL * 81
    found = overlapping_pairs(centres, radii)
    assert len(found) > 30
    assert np.array_equal(found, overlapping_pairs(far, np.append(radii, 0.5)))


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_balls_at_nonfinite_positions_have_no_cells(value: float) -> None:
    centres = np.random.default_rng(7).uniform(0.0, 3.0, (30, 3))
    centres[11, 1] = value
    assert _cell_numbers(centres, 1.0)[3] == np.inf
    radii = np.full(30, 0.5)
    found, expected = overlapping_pairs(centres, radii), every_pair(np.delete(centres, 11, axis=0), radii[1:])
    assert np.array_equal(found, expected + (expected >= 11))
    assert overlapping_pairs(np.full((30, 3), value), radii).shape == (0, 2)


@pytest.mark.parametrize("value", [-np.inf, 1e16, -1e300])
def test_a_ball_far_from_all_others_does_not_add_candidates(value: float) -> None:
    """In a cube of 1000 balls, a cell and its neighbours hold a small part of the pairs."""
    centres = np.random.default_rng(9).uniform(0.0, 10.0, (1000, 3))
    centres[0, 1] = value
    kept = centres[np.isfinite(centres).all(axis=1)]
    _, counts = np.unique(_occupied_cell_numbers(kept, 1.0)[0], return_counts=True)
    assert counts.max() <= 10


def test_merging_cells_that_are_too_many_keeps_all_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    scattered = rng.uniform(0.0, 1e10, (200, 3))
    centres = np.vstack([scattered, scattered + rng.uniform(-0.5, 0.5, scattered.shape)])
    expected, radii = every_pair(centres, np.full(400, 0.5)), np.full(400, 0.5)
    monkeypatch.setattr(cells, "MAX_CELLS", 1e5)
    number, *_ = _occupied_cell_numbers(centres, 1.0)
    assert 0 <= number.min() <= number.max() < 1e5
    assert np.array_equal(overlapping_pairs(centres, radii), expected)


@pytest.mark.parametrize("dim", [2, 3])
def test_cells_along_the_first_axis_have_consecutive_numbers(dim: int) -> None:
    """Each ball has few candidates; if a row of cells were one range, all balls of the row would be candidates."""
    centres = np.zeros((5, dim))
    centres[:, 0] = 0.5 + np.arange(5)
    number, *_ = _cell_numbers(centres, 1.0)
    assert np.diff(number).tolist() == [1, 1, 1, 1]
