"""One contact with rolling friction is solved to rounding in every state."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, judge
from proxbench.solvers.sweeps.one_contact import solve_spatial
from proxbench.solvers.sweeps.rolling_contact import solve_rolling
from proxbench.solvers.sweeps.slip_angle import WORKSPACE_SIZE


def solved(delassus: np.ndarray, c: np.ndarray, sliding: int, mu: float, mu_r: float, start: np.ndarray) -> np.ndarray:
    held = start.copy()
    solve_rolling(delassus, c, sliding, mu, 0.0, mu_r, 0.0, held)
    return held


def one_contact(delassus: np.ndarray, c: np.ndarray, sliding: int, mu: float, mu_r: float) -> ContactProblem:
    laws = Laws.contacts(np.array([mu]), 1 + sliding, 1).with_rolling(mu_r, len(c) - 1 - sliding)
    return ContactProblem.from_delassus(delassus, c, laws=laws)


def block(seed: int, sliding: int, rolling: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return G of a contact of random bodies, with angular velocities in its rolling rows, and a free velocity."""
    rng = np.random.default_rng(seed)
    size = 1 + sliding + rolling
    root = rng.normal(size=(size + 4, size))
    root[:, 1 + sliding :] /= radius
    delassus = root.T @ root
    return 0.5 * (delassus + delassus.T), rng.normal(size=size)


shapes = {"sliding": st.integers(0, 2), "rolling": st.integers(1, 3), "radius": st.sampled_from([1e-3, 1.0, 10.0])}


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**31), mu=st.sampled_from([0.1, 0.3, 0.7]), share=st.sampled_from([0.01, 0.3]), **shapes)
def test_the_impulse_of_a_rolling_contact_satisfies_its_laws(
    seed: int, mu: float, share: float, sliding: int, rolling: int, radius: float
) -> None:
    delassus, c = block(seed, sliding, rolling, radius)
    c[1 + sliding :] /= radius
    start = np.random.default_rng(seed + 1).normal(size=len(c)) * (seed % 2)
    found = solved(delassus, c, sliding, mu, share * radius, start)
    verdict = judge(one_contact(delassus, c, sliding, mu, share * radius), found)
    assert verdict.residual <= 1e-10
    assert verdict.cone_violation <= 1e-14 * max(1.0, np.abs(found).max())


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**31), mu=st.sampled_from([0.1, 0.5]))
def test_uncoupled_sliding_and_rolling_are_solved_separately(seed: int, mu: float) -> None:
    """Uncoupled rolling rows follow in closed form; the other rows are the spatial contact."""
    delassus, c = block(seed, 2, 1, 1.0)
    delassus[3, :3] = delassus[:3, 3] = 0.0
    found = solved(delassus, c, 2, mu, 0.2, np.zeros(4))
    spatial = solve_spatial(
        np.ascontiguousarray(delassus[:3, :3]).ravel(), *c[:3], mu, 0.0, 0.0, 0.0, 0.0, np.empty(WORKSPACE_SIZE)
    )
    assert found[:3] == pytest.approx(spatial, rel=1e-9, abs=1e-12)
    assert found[3] == pytest.approx(np.clip(-c[3] / delassus[3, 3], -0.2 * spatial[0], 0.2 * spatial[0]), abs=1e-12)


def test_an_opening_contact_has_no_impulse_and_a_resting_one_keeps_its_impulse() -> None:
    delassus, c = block(1, 2, 2, 1.0)
    c[0] = 1.0
    assert solved(delassus, c, 2, 0.3, 0.1, np.zeros(5)).tolist() == [0.0] * 5
    rest = np.array([1.0, 0.1, 0.1, 0.01, 0.01])
    assert solved(delassus, -delassus @ rest, 2, 0.3, 0.1, rest) == pytest.approx(rest, rel=1e-12)


def test_a_rank_deficient_block_is_solved_by_some_impulse() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        root = rng.normal(size=(3, 5))
        wanted = np.array([1.0, 0.1, -0.1, 0.05, 0.0])
        delassus = root.T @ root
        c = -delassus @ wanted
        found = solved(delassus, c, 2, 0.3, 0.1, np.zeros(5))
        assert judge(one_contact(delassus, c, 2, 0.3, 0.1), found).residual <= 1e-10
