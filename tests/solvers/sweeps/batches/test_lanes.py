"""Vectors read and write the same numbers as loops over lanes."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit, uint64
from proxbench.solvers.sweeps.batches.lanes import (
    BALL_LENGTH,
    LANES,
    aligned_copy,
    gather_chunks,
    gather_moves,
    scatter_chunks,
    scatter_chunks_but_idle,
    scatter_moves,
    scatter_moves_but_idle,
    zeros_for_balls,
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
    motion = zeros_for_balls(n_balls + 1)
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
def test_each_ball_begins_at_a_multiple_of_64_bytes(count: int) -> None:
    motion = zeros_for_balls(count)
    motion[:] = np.arange(len(motion))
    copy = aligned_copy(motion)
    for numbers in (motion, copy):
        assert numbers.ctypes.data % (8 * BALL_LENGTH) == 0
        assert np.array_equal(numbers, np.arange(BALL_LENGTH * count))
    assert not np.shares_memory(motion, copy)


def test_sweeps_in_python_give_the_iterates_of_compiled_sweeps() -> None:
    """They differ by rounding, because Python does not fuse products and sums."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_balls import heap, over_pieces\n"
        "from proxbench.solvers import Stop, create\n"
        "for problem, kind in ((heap(1), 'BallIterates'), (over_pieces(heap(1)), 'BatchIterates')):\n"
        "    prepared = create('SORprox', form='factors', momentum=0.5).prepare(problem)\n"
        "    assert type(prepared.begin(0.0 * problem.free_velocity)).__name__ == kind\n"
        "    print(*map(repr, prepared.solve(Stop(1e-16, 3)).impulses.tolist()))\n"
    )

    def impulses(is_python: str) -> list[np.ndarray]:
        environment = {**os.environ, "NUMBA_DISABLE_JIT": is_python}
        command = [sys.executable, "-c", code, str(Path(__file__).parent)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return [np.array(line.split(), dtype=float) for line in done.stdout.splitlines()]

    for in_python, compiled in zip(impulses("1"), impulses("0"), strict=True):
        assert in_python == pytest.approx(compiled, rel=1e-12, abs=1e-14)
