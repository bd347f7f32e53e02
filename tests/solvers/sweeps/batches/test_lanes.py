"""Vectors read and write the same numbers as loops over lanes."""

import numpy as np
import pytest
from numba import njit, uint64
from proxbench.solvers.sweeps.batches.lanes import (
    BALL_LENGTH,
    LANES,
    cache_lines,
    copy_of_lines,
    gather_chunks,
    gather_moves,
    scatter_chunks,
    scatter_chunks_but_idle,
    scatter_moves,
    scatter_moves_but_idle,
)

PAIR = 2 * LANES
"""The tested batch is the second of two."""


@njit
def gathered_and_scattered(axes, bodies, pair, velocity, scattered, writes_idle):  # type: ignore[no-untyped-def]
    gathered = np.zeros(2 * LANES * len(axes))
    gather_chunks(axes, bodies, uint64(pair), velocity, gathered)
    if writes_idle:
        scatter_chunks(axes, bodies, uint64(pair), scattered, velocity)
    else:
        scatter_chunks_but_idle(axes, bodies, uint64(pair), scattered, velocity)
    return gathered


@njit
def moves_of_batch(bodies, pair, motion):  # type: ignore[no-untyped-def]
    moves = np.zeros(6 * LANES)
    gather_moves(bodies, uint64(pair), motion, moves)
    return moves


@njit
def push_balls(bodies, pair, records, masses, moves, motion, writes_idle):  # type: ignore[no-untyped-def]
    if writes_idle:
        scatter_moves(bodies, uint64(pair), records, uint64(masses), moves, motion)
    else:
        scatter_moves_but_idle(bodies, uint64(pair), records, uint64(masses), moves, motion)


def pairs_of_bodies(rng: np.random.Generator, n_bodies: int, length: int) -> np.ndarray:
    """First entries of both bodies of two batches; some second bodies are the idle one, which comes last."""
    bodies = np.array([rng.permutation(n_bodies)[: 2 * LANES] for _ in range(2)])
    bodies[:, LANES:][rng.random((2, LANES)) < 0.3] = n_bodies
    return (length * bodies).ravel().astype(np.uint64)


@pytest.mark.parametrize("writes_idle", [True, False])
@pytest.mark.parametrize("length", [3, 6, 9])
def test_chunks_shorter_and_longer_than_vectors_move_to_lanes_and_back(length: int, writes_idle: bool) -> None:
    rng = np.random.default_rng(length)
    axes = tuple(np.arange(length, dtype=np.uint64))
    bodies = pairs_of_bodies(rng, 50, length)
    velocity, scattered = rng.normal(size=51 * length), rng.normal(size=2 * LANES * length)
    sides = bodies[PAIR:].reshape(2, LANES).astype(int)
    expected, written = np.zeros((2, length, LANES)), velocity.copy()
    for (side, lane), chunk in np.ndenumerate(sides):
        expected[side, :, lane] = velocity[chunk : chunk + length]
        if writes_idle or chunk != 50 * length:
            written[chunk : chunk + length] = scattered.reshape(2, length, LANES)[side, :, lane]
    gathered = gathered_and_scattered(axes, bodies, PAIR, velocity, scattered, writes_idle)
    assert np.array_equal(gathered, expected.ravel())
    assert np.array_equal(velocity, written)


@pytest.mark.parametrize("writes_idle", [True, False])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_balls_move_by_the_impulses_of_their_contacts(dtype: type, writes_idle: bool) -> None:
    """The velocities of the idle ball change only if it is written to, because its inverse mass is not zero here."""
    rng, n_balls, masses = np.random.default_rng(3), 50, 5
    bodies = pairs_of_bodies(rng, n_balls, BALL_LENGTH).astype(np.uint32)
    motion = cache_lines(n_balls + 1)
    motion[:] = rng.normal(size=len(motion))
    rows = motion.reshape(-1, BALL_LENGTH)
    rows[:, [3, 7]] = 0.0
    first, second = bodies[PAIR:].reshape(2, LANES).astype(int) // BALL_LENGTH
    moves = moves_of_batch(bodies, PAIR, motion).reshape(6, LANES)
    assert np.array_equal(moves[:3].T, rows[first, :3] - rows[second, :3])
    assert np.array_equal(moves[3:].T, rows[first, 4:7] + rows[second, 4:7])

    records, pushes = rng.uniform(size=masses + 2 * LANES).astype(dtype), rng.normal(size=(6, LANES))
    expected = rows.copy()
    for lane in range(LANES):
        for ball, mass, sign in (
            (first[lane], records[masses + lane], 1.0),
            (second[lane], records[masses + LANES + lane], -1.0),
        ):
            if writes_idle or ball != n_balls:
                expected[ball, :3] += sign * float(mass) * pushes[:3, lane]
                expected[ball, 4:7] -= float(mass) * pushes[3:, lane]
    push_balls(bodies, PAIR, records, masses, pushes.ravel(), motion, writes_idle)
    assert rows == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert not rows[:, [3, 7]].any()


@pytest.mark.parametrize("count", [1, 7, 100, 10_000])
def test_each_ball_occupies_one_cache_line(count: int) -> None:
    motion = cache_lines(count)
    motion[:] = np.arange(len(motion))
    copy = copy_of_lines(motion)
    for numbers in (motion, copy):
        assert numbers.ctypes.data % (8 * BALL_LENGTH) == 0
        assert np.array_equal(numbers, np.arange(BALL_LENGTH * count))
    assert not np.shares_memory(motion, copy)
