"""A file of ContactBench is the same problem with its normal row last.

All arrays here are synthetic, with the names, shapes and row order of ContactBench's sources. Its own samples are
binary ``.npz`` files (``tests/python/data`` of its repository). One test reads them from the folder that the variable
PROXBENCH_CONTACTBENCH names.
"""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, ProblemError, judge, load
from proxbench.problems.exchange.formats.contactbench import problem_of_arrays
from proxbench.problems.exchange.repair import Repair
from proxbench.solvers import solve


def complementarity(impulses: np.ndarray, velocity: np.ndarray, mu: float) -> float:
    """Return ContactBench's measure of one contact, (σ + μ‖σ_T‖ e_N) · λ, with rows T1, T2, N."""
    return float(velocity @ impulses + mu * np.hypot(velocity[0], velocity[1]) * impulses[2])


@given(st.integers(0, 10_000), st.integers(1, 4))
def test_contactbench_velocities_are_permuted_judge_velocities(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    root, g, mus = rng.normal(size=(3 * n, 3 * n)), rng.normal(size=(3 * n, 1)), rng.uniform(0.1, 1.0, n)
    G = root @ root.T
    problem = problem_of_arrays({"G": 0.5 * (G + G.T), "g": g, "mus": mus}, Repair())
    theirs = rng.normal(size=3 * n)
    ours = theirs.reshape(n, 3)[:, [2, 0, 1]].ravel()
    velocity = (G @ theirs + g.ravel()).reshape(n, 3)
    np.testing.assert_allclose(problem.relative_velocity(ours).reshape(n, 3), velocity[:, [2, 0, 1]], rtol=1e-12)
    assert problem.laws.friction_coefficient[1::2].tolist() == mus.tolist()


FOLDER = os.environ.get("PROXBENCH_CONTACTBENCH", "")
SAMPLES = sorted(Path(FOLDER).glob("*.npz")) if FOLDER else []


@pytest.mark.skipif(not SAMPLES, reason="PROXBENCH_CONTACTBENCH names no folder of samples of ContactBench")
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.stem)
def test_samples_of_contactbench_are_read_and_solved(sample: Path) -> None:
    problem = load(sample)
    with np.load(sample) as arrays:
        assert problem.n_rows == arrays["g"].size == 3 * arrays["mus"].size
    assert judge(problem, solve(problem, tolerance=1e-6).impulses).residual <= 1e-6


def test_sliding_cube_is_solved_by_the_measure_of_contactbench(tmp_path: Path) -> None:
    G, g = np.diag([1.0, 1.0, 2.0]), np.array([3.0, 0.0, -1.0])
    np.savez(tmp_path / "cube.npz", G=G, g=g, mus=np.array([0.5]))
    problem = load(tmp_path / "cube.npz")
    ours = np.array([0.5, -0.25, 0.0])
    assert judge(problem, ours).residual <= 1e-15
    theirs = ours[[1, 2, 0]]
    assert complementarity(theirs, G @ theirs + g, 0.5) == 0.0
    assert problem.provenance["source"] == "ContactBench"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mus": np.array([0.5, 0.5])}, "'g' has 3 rows and 'mus' 2 contacts"),
        ({"G": None}, "there is no array 'G'; ContactBench writes G, g, mus"),
        ({"G": np.eye(4)}, r"G must have shape \(3, 3\)"),
        ({"mus": np.array([-0.5])}, "not negative"),
        ({"G": np.diag([1.0, 1.0, -1e-7])}, "--indefinite project"),
    ],
)
def test_inconsistent_input_gets_one_sentence(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    arrays = {"G": np.eye(3), "g": np.array([0.0, 0.0, -1.0]), "mus": np.array([0.5])} | changes
    np.savez(tmp_path / "p.npz", **{name: value for name, value in arrays.items() if value is not None})
    with pytest.raises(ProblemError, match=words) as caught:
        load(tmp_path / "p.npz")
    assert str(caught.value).startswith(str(tmp_path / "p.npz"))


def test_plain_arrays_with_the_normal_last_are_the_same_problem(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    root, g = rng.normal(size=(6, 6)), rng.normal(size=6)
    G, mus = root @ root.T, np.array([0.2, 0.4])
    G = 0.5 * (G + G.T)
    np.savez(tmp_path / "theirs.npz", G=G, g=g, mus=mus)
    np.savez(tmp_path / "plain.npz", G=G, c=g, mu=mus, normal="last", version=1)
    assert load(tmp_path / "theirs.npz").digest == load(tmp_path / "plain.npz").digest
    order = [2, 0, 1, 5, 3, 4]
    assert load(tmp_path / "plain.npz").digest == ContactProblem.from_delassus(G[order][:, order], g[order], mus).digest
