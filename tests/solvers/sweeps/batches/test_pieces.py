"""Sweeps in batches equal sequential sweeps."""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, load
from proxbench.problems.contact.matrices.pieces import Pieces
from proxbench.solvers import Stop, create
from proxbench.solvers.sweeps.batches.lanes import LANES
from proxbench.solvers.sweeps.batches.pieces import assign_batches, sweep_batches
from proxbench.solvers.sweeps.factors import FactorSweep
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n_blocks=st.integers(0, 120), n_chunks=st.integers(2, 60))
def test_batches_keep_the_order_of_contacts_that_share_a_body(seed: int, n_blocks: int, n_chunks: int) -> None:
    rng = np.random.default_rng(seed)
    bodies = np.array([rng.choice(n_chunks, 2, replace=False) for _ in range(n_blocks)], dtype=np.int64).reshape(-1, 2)
    bodies[rng.random(n_blocks) < 0.3, 1] = n_chunks
    pieces = Pieces(2 * np.arange(n_blocks + 1), bodies.ravel(), np.zeros((2 * n_blocks, 3, 6)), n_chunks)
    positions, n_batches = assign_batches(pieces)
    assert len(set(positions.tolist())) == n_blocks
    batch = positions // LANES
    assert n_batches == (batch.max() + 1 if n_blocks else 0)
    for later in range(n_blocks):
        shares = np.isin(bodies[:later], [body for body in bodies[later] if body != n_chunks]).any(axis=1)
        assert (batch[:later][shares] < batch[later]).all()


def test_a_funnel_is_swept_in_batches_and_its_iterates_are_those_of_the_delassus_form() -> None:
    problem = load("funnel-300")
    assert FactorSweep.over(problem, diagonal_step_sizes(problem, 1.0)).kernel is sweep_batches
    histories: list[list[np.ndarray]] = []
    for form in ("delassus", "factors"):
        seen: list[np.ndarray] = []
        prepared = create("SORprox", relaxation=1.2, form=form).prepare(problem)
        prepared.solve(Stop(1e-300, 60), observe=lambda _, x, seen=seen: seen.append(x.copy()))
        histories.append(seen)
    first, second = np.array(histories[0]), np.array(histories[1])
    assert first.shape == (60, problem.n_rows)
    assert np.abs(first - second).max() <= 1e-12 * np.abs(first).max()


def test_contacts_whose_friction_other_contacts_bound_are_not_batched() -> None:
    """A batch contains only the bounds of its own contacts; here neighbours bound each other's friction."""
    rng, n = np.random.default_rng(3), 32
    directions = sp.block_diag([rng.normal(size=(12, 3)) for _ in range(n)], format="csc")  # two bodies per contact
    laws = Laws.contacts(np.array(0.5), 3, n)
    friction = np.flatnonzero(laws.is_friction)
    partner = laws.partner.copy()
    partner[friction] = partner[friction].reshape(-1, 2)[:, ::-1].ravel()
    free = rng.normal(size=3 * n)
    problem = ContactProblem.from_factors(directions, np.ones(12 * n), free, laws=replace(laws, partner=partner))
    sweeps = [create("SORprox", relaxation=1.2, form=form).prepare(problem) for form in ("delassus", "factors")]
    first, second = (prepared.solve(Stop(1e-300, 20)).impulses for prepared in sweeps)
    assert problem.factor_pieces().in_pairs  # as batches need them
    assert np.abs(first - second).max() <= 1e-12 * np.abs(first).max()
