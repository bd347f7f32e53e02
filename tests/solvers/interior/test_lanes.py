"""Two cones of one contact share its normal impulse, and a Newton system does not contain the split velocity."""

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ContactProblem, load
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem
from proxbench.solvers.interior import cones
from proxbench.solvers.interior.lanes import lanes_of

ROLLING = {axes: random_linked_problem(LinkedFamily(6, 3, 30, rolling_rows=axes), 0) for axes in (1, 2, 3)}
PROBLEMS = [load("funnel-planar-30"), load("funnel-30"), *ROLLING.values()]

pytestmark = pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: f"{problem.layout.width}-lanes")


def random_arrays(problem: ContactProblem) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return numbers over blocks, and over cones."""
    rng, layout = np.random.default_rng(0), problem.layout
    lanes = lanes_of(layout)
    return rng.normal(size=(layout.n_blocks, layout.width)), rng.normal(size=(len(lanes.block), lanes.width))


def test_conversion_from_blocks_to_cones_and_back_is_the_identity(problem: ContactProblem) -> None:
    lanes = lanes_of(problem.layout)
    used = problem.layout.pad(np.ones(problem.n_rows))
    blocks = used * random_arrays(problem)[0]
    assert np.array_equal(used * lanes.to_block(lanes.from_block(blocks)), blocks)
    assert np.array_equal(used * lanes.sum_to_block(lanes.split_from_block(blocks)), blocks)


@pytest.mark.parametrize(("impulses", "velocities"), [("from_block", "sum_to_block"), ("split_from_block", "to_block")])
def test_power_is_the_same_over_blocks_and_over_cones(problem: ContactProblem, impulses: str, velocities: str) -> None:
    lanes = lanes_of(problem.layout)
    used = problem.layout.pad(np.ones(problem.n_rows))
    blocks, split = random_arrays(problem)
    over_cones = (getattr(lanes, impulses)(used * blocks) * split).sum()
    over_blocks = (used * blocks * getattr(lanes, velocities)(split)).sum()
    assert over_cones == pytest.approx(over_blocks, rel=1e-12)


def test_the_steps_of_the_cones_add_up_to_that_of_their_block(problem: ContactProblem) -> None:
    """The sum of dû = x − D dr over both cones is that of the summed x and D, for one dr of the contact."""
    layout, lanes = problem.layout, lanes_of(problem.layout)
    m, w = len(lanes.block), lanes.width
    rng, kind = np.random.default_rng(1), np.full(m, cones.CONE)
    points = rng.normal(size=(2, m, w))
    points[:, :, 0] = np.linalg.norm(points[:, :, 1:], axis=2) + rng.uniform(0.1, 2.0, size=(2, m))
    r, u = points
    matrices, shifts, second = np.zeros((m, w, w)), np.zeros((m, w)), np.zeros((m, w + 1))
    coupled, right, du, ds = np.zeros((m, w, w)), np.zeros((m, w)), np.zeros((m, w)), np.zeros(m)
    none, zeros = np.zeros(m), np.zeros(m)
    cones.linearise(kind, r, u, 0.3, second, matrices, shifts)
    cones.couple(kind, none, none, r, u, matrices, shifts, 0.3, second, coupled, right)
    dr = layout.pad(np.ones(problem.n_rows)) * random_arrays(problem)[0]
    cones.write_changes(kind, none, none, u, matrices, shifts, coupled, right, zeros, lanes.from_block(dr), du, ds)
    block = lanes.sum_to_block(right) - (lanes.matrices_to_block(coupled) @ dr[:, :, None])[:, :, 0]
    used = layout.pad(np.ones(problem.n_rows)) > 0.0
    assert lanes.sum_to_block(du)[used] == pytest.approx(block[used], rel=1e-10, abs=1e-10)
