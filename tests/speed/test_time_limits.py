"""A time limit holds on problems with inner steps that take longer than the limit."""

import time
from itertools import product
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ContactProblem
from proxbench.solvers import Solution, Status, Stop, create

OVERRUN = 0.05
"""Allowed time beyond the limit, relative to it, or ``OVERRUN_SECONDS`` if that is more."""

OVERRUN_SECONDS = 0.2


def packed_balls(side: int) -> ContactProblem:
    """Frictional contacts between balls of a cubic lattice falling onto a floor; about 3·side³ contacts."""
    rng = np.random.default_rng(0)
    place = {cell: body for body, cell in enumerate(product(range(side), repeat=3))}
    centres = np.array(list(place)) + rng.uniform(-0.1, 0.1, (side**3, 3))
    columns, lanes, values, contact = [], [], [], 0
    for cell, body in place.items():
        below = [tuple(np.subtract(cell, axis)) for axis in np.eye(3, dtype=int)]
        for other in [place[near] for near in below if near in place] + ([-1] if cell[2] == 0 else []):
            away = centres[body] - centres[other] if other >= 0 else np.array([0.0, 0.0, 1.0])
            normal = away / np.linalg.norm(away)
            axes = np.linalg.qr(np.column_stack([normal, np.eye(3)[:, [np.argmin(np.abs(normal)), 0]]]))[0].T
            frame = np.vstack([normal, axes[1], np.cross(normal, axes[1])])
            turn = -0.5 * np.cross(normal, frame)
            for end, sign in ((body, 1.0), (other, -1.0)):
                if end >= 0:
                    block = np.hstack([sign * frame, turn])
                    columns.append(np.repeat(3 * contact + np.arange(3), 6))
                    lanes.append(np.tile(6 * end + np.arange(6), 3))
                    values.append(block.ravel())
            contact += 1
    entries = (np.concatenate(values), (np.concatenate(lanes), np.concatenate(columns)))
    directions = sp.csr_array(entries, shape=(6 * side**3, 3 * contact))
    motion = np.hstack([rng.normal(0.0, 1e-3, (side**3, 3)), np.zeros((side**3, 3))])
    motion[:, 2] -= 0.01
    inverse_mass = np.tile([1.0, 1.0, 1.0, 10.0, 10.0, 10.0], side**3)
    return ContactProblem.from_factors(directions, inverse_mass, directions.T @ motion.ravel(), 0.3, dim=3)


@pytest.mark.parametrize("side", [10, 19])
@pytest.mark.parametrize("limit", [0.5, 4.0])
@pytest.mark.parametrize("pace", ["as it is", "always slow"])
def test_semismooth_newton_ends_in_time(
    benchmark: Any, pace: str, limit: float, side: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On 21 000 contacts, a factorisation takes most of a minute; one is requested whenever sweeps count as slow."""
    solver = create("HybridNewton")
    if pace == "always slow":
        monkeypatch.setattr("proxbench.solvers.composite.hybrid_newton.SLOW", -1.0)
    solver.prepare(packed_balls(3)).solve(Stop(1e-10, max_seconds=10.0))  # compiles
    prepared = solver.prepare(packed_balls(side))
    seconds: list[float] = []

    def solve() -> Solution:
        began = time.perf_counter()
        solution = prepared.solve(Stop(1e-300, 10**9, limit))
        seconds.append(time.perf_counter() - began)
        return solution

    solution = benchmark.pedantic(solve, rounds=1)
    assert solution.status is Status.TIME_LIMIT
    assert max(seconds) <= limit + max(OVERRUN_SECONDS, OVERRUN * limit)
