"""Files with asymmetric or indefinite matrices: each remedy does what its name states, and is reported."""

import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from handmade_fclib import Data, H, M, W, global_data, local_data, matrix_data, write_data
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ProblemError, judge, read_fclib, write_fclib
from proxbench.problems.exchange.fclib import conversion
from proxbench.problems.exchange.repair import (
    MAX_ASYMMETRY,
    MAX_NEGATIVE,
    AsymmetricError,
    asymmetry,
    semidefinite,
    symmetric,
)

COUPLED = M + 0.25 * (np.eye(6, k=3) + np.eye(6, k=-3))
"""A mass matrix of three blocks, as of a body whose centre of mass is off its origin."""


def crooked(by: float) -> Data:
    """Return the local problem with one entry of W increased by a fraction of the largest one."""
    matrix = W.copy()
    matrix[1, 4] += by * np.abs(W).max()
    return local_data(matrix=matrix)


def with_mass(matrix: np.ndarray) -> Data:
    """Return the global problem with another M."""
    parts = {f"fclib_global/M/{name}": value for name, value in matrix_data(matrix, "triplets").items()}
    return global_data() | parts


def test_a_small_asymmetry_is_replaced_by_the_mean_and_recorded(tmp_path: Path) -> None:
    path = write_data(tmp_path / "p.hdf5", crooked(1e-3))
    problem = read_fclib(path)
    matrix = problem.delassus()
    assert abs(matrix - matrix.T).max() == 0.0
    assert matrix[1, 4] == pytest.approx(W[1, 4] + 0.5 * 1e-3 * np.abs(W).max(), rel=1e-15)
    assert problem.provenance["asymmetry"] == pytest.approx(1e-3)
    said = "W is asymmetric by 1.0e-03 of its largest entry, and is replaced by (W + Wᵀ)/2"
    assert problem.provenance["matrix"] == said
    assert not problem.allow_asymmetric


def test_an_asymmetry_is_kept_bit_by_bit_on_request(tmp_path: Path) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", crooked(0.3)), "keep")
    assert problem.allow_asymmetric
    assert problem.delassus()[1, 4] == W[1, 4] + 0.3 * np.abs(W).max()
    assert "is kept unchanged" in str(problem.provenance["matrix"])
    write_fclib(problem, tmp_path / "again.hdf5")
    assert read_fclib(tmp_path / "again.hdf5", "keep").digest == problem.digest


def test_a_kept_asymmetry_that_was_written_here_can_be_read_symmetric(tmp_path: Path) -> None:
    kept = read_fclib(write_data(tmp_path / "p.hdf5", crooked(1e-3)), "keep")
    write_fclib(kept, tmp_path / "again.hdf5")
    for way in ("mean", "lower", "upper"):
        assert read_fclib(tmp_path / "again.hdf5", way).digest == read_fclib(tmp_path / "p.hdf5", way).digest


@pytest.mark.parametrize(("by", "symmetry"), [(2 * MAX_ASYMMETRY, "mean"), (1e-3, "refuse")])
@pytest.mark.parametrize("form", ["W", "M"])
def test_excessive_asymmetry_is_refused_with_its_size_and_a_remedy(
    form: str, by: float, symmetry: Any, tmp_path: Path
) -> None:
    matrix = M.copy()
    matrix[0, 3] += by * np.abs(M).max()
    matrix[3, 0] += 0.001 * by
    data = crooked(by) if form == "W" else with_mass(matrix)
    with pytest.raises(ProblemError, match=rf"{form} is asymmetric by \d\.\de-0\d of its largest entry") as caught:
        read_fclib(write_data(tmp_path / "p.hdf5", data), symmetry)
    assert str(caught.value).endswith(f"--symmetry {'lower' if by > MAX_ASYMMETRY else 'mean'}")


def test_a_refused_matrix_is_named_with_the_argument_of_python_that_reads_it() -> None:
    far = sp.csr_array(np.array([[1.0, 0.5], [0.1, 1.0]]))
    with pytest.raises(AsymmetricError) as caught:
        symmetric(far, "W", "mean")
    reason = "W is asymmetric by 4.0e-01 of its largest entry, and either its lower or its upper triangle is wrong"
    assert str(caught.value) == f"{reason}; read it with `symmetry` 'lower'."
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.reason, again.remedy) == (reason, "lower")


def test_an_asymmetry_of_rounding_is_left_as_it_is(tmp_path: Path) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", crooked(1e-13)), "refuse")
    assert problem.delassus()[1, 4] == W[1, 4] + 1e-13 * np.abs(W).max()
    assert "asymmetry" not in problem.provenance


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_mass_matrix_stored_by_one_triangle_is_read_as_the_whole_one(side: str, tmp_path: Path) -> None:
    half = np.tril(COUPLED) if side == "lower" else np.triu(COUPLED)
    path = write_data(tmp_path / "half.hdf5", with_mass(half))
    command = re.escape(f"; run: proxbench import fclib {path} --symmetry {side}")
    with pytest.raises(ProblemError, match=f"only its {side} triangle has entries{command}$"):
        read_fclib(path)
    whole = read_fclib(write_data(tmp_path / "whole.hdf5", with_mass(COUPLED)))
    found = read_fclib(path, side)  # type: ignore[arg-type]
    assert found.digest == whole.digest
    assert f"only its {side} triangle is read" in str(found.provenance["matrix"])


def test_a_mass_matrix_off_by_rounding_of_its_writer_is_read_by_the_mean(tmp_path: Path) -> None:
    bent = COUPLED.copy()
    bent[3, 0] += 1.5e-6 * M.max()
    problem = read_fclib(write_data(tmp_path / "p.hdf5", with_mass(bent)))
    assert problem.provenance["asymmetry"] == pytest.approx(1.5e-6, rel=1e-6)
    mean = 0.5 * (bent + bent.T)
    expected = H.T @ np.linalg.solve(mean, H)
    np.testing.assert_allclose(problem.delassus().toarray(), expected, rtol=1e-14, atol=1e-15)


def test_a_mass_matrix_is_never_kept_unsymmetric(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="a mass matrix M must be symmetric"):
        read_fclib(write_data(tmp_path / "p.hdf5", with_mass(np.tril(COUPLED))), "keep")


@pytest.mark.parametrize("option", [{"symmetry": "average"}, {"indefinite": "clip"}])
def test_unknown_repair_option_is_refused(option: dict[str, Any], tmp_path: Path) -> None:
    name, word = next(iter(option.items()))
    with pytest.raises(ProblemError, match=f"`{name}` '{word}' is unknown; "):
        read_fclib(write_data(tmp_path / "p.hdf5", local_data()), **option)


def indefinite(least: float) -> np.ndarray:
    """Return W with its least eigenvalue replaced by a fraction of the largest one."""
    values, vectors = np.linalg.eigh(W)
    values[0] = least * values[-1]
    matrix = (vectors * values) @ vectors.T
    return 0.5 * (matrix + matrix.T)


def test_a_small_negative_eigenvalue_of_the_delassus_matrix_is_projected_only_on_request(tmp_path: Path) -> None:
    path = write_data(tmp_path / "p.hdf5", local_data(matrix=indefinite(-3e-8)))
    with pytest.raises(
        ProblemError,
        match=r"must be positive semidefinite; correct the matrix, or, if the negative eigenvalue is a rounding error "
        r"of at most 1e-06 of the largest, run: proxbench import fclib .*p\.hdf5 --indefinite project "
        r"--output NEW\.npz$",
    ):
        read_fclib(path)
    problem = read_fclib(path, indefinite="project")
    assert problem.provenance["least_eigenvalue"] == pytest.approx(-3e-8, rel=1e-6)
    values = np.linalg.eigvalsh(problem.delassus().toarray())
    assert values[0] >= -1e-15 * values[-1]
    assert judge(problem, np.zeros(6)).residual > 0.0


def test_the_command_for_one_remedy_keeps_the_other(tmp_path: Path) -> None:
    path = write_data(tmp_path / "p.hdf5", local_data(matrix=np.tril(indefinite(-3e-8))))
    with pytest.raises(ProblemError, match=r"--symmetry lower --indefinite project$"):
        read_fclib(path, indefinite="project")
    with pytest.raises(ProblemError, match=r"--symmetry lower --indefinite project --output NEW\.npz$"):
        read_fclib(path, "lower")
    assert read_fclib(path, "lower", "project").n_rows == 6


def test_a_matrix_far_from_semidefinite_is_refused_even_if_projection_is_requested(tmp_path: Path) -> None:
    path = write_data(tmp_path / "p.hdf5", local_data(matrix=indefinite(-2 * MAX_NEGATIVE)))
    with pytest.raises(ProblemError, match="replaces only negative eigenvalues up to 1e-06"):
        read_fclib(path, indefinite="project")


@given(st.integers(0, 10_000), st.integers(1, 12))
def test_the_projection_is_the_nearest_semidefinite_matrix(seed: int, n: int) -> None:
    """A − P is then negative semidefinite and orthogonal to P, the conditions of the projection onto a cone."""
    rng = np.random.default_rng(seed)
    basis, _ = np.linalg.qr(rng.normal(size=(n, n)))
    values = np.append(rng.uniform(-MAX_NEGATIVE, 1.0, n - 1), 1.0)
    matrix = (basis * values) @ basis.T
    matrix = 0.5 * (matrix + matrix.T)
    found = semidefinite(sp.csr_array(matrix))[0].toarray()
    removed = matrix - found
    assert np.linalg.eigvalsh(found)[0] >= -1e-9
    assert np.linalg.eigvalsh(removed)[-1] <= 1e-14
    assert abs((removed * found).sum()) <= 1e-14


@given(st.integers(0, 10_000), st.sampled_from(["mean", "lower", "upper"]))
def test_every_remedy_returns_a_symmetric_matrix_and_leaves_a_symmetric_one_alone(seed: int, how: Any) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(5, 5))
    matrix = matrix + matrix.T
    same, said = symmetric(sp.csr_array(matrix), "A", how)
    assert np.array_equal(same.toarray(), matrix)
    assert said == {}
    bent = matrix.copy()
    bent[3, 1] += 5e-3 * np.abs(matrix).max()
    found = symmetric(sp.csr_array(bent), "A", how)[0].toarray()
    assert np.array_equal(found, found.T)
    assert found[1, 3] == {"mean": 0.5 * (bent[1, 3] + bent[3, 1]), "lower": bent[3, 1], "upper": bent[1, 3]}[how]


def test_a_mass_matrix_whose_inverse_is_too_large_is_condensed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_data(tmp_path / "p.hdf5", with_mass(COUPLED))
    factored = read_fclib(path)
    monkeypatch.setattr(conversion, "MAX_ENTRIES", 5)
    condensed = read_fclib(path)
    assert condensed.factors is None
    assert "condensed" in condensed.provenance
    np.testing.assert_allclose(condensed.delassus().toarray(), factored.delassus().toarray(), rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(condensed.free_velocity, factored.free_velocity, rtol=1e-13, atol=1e-15)


def test_a_condensed_matrix_with_a_negative_eigenvalue_is_projected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """M⁻¹ has the eigenvalue −1e-8 in place of its least one, as after a loss of digits."""
    values, vectors = np.linalg.eigh(np.linalg.inv(COUPLED))
    mass = (vectors / np.append(-1e-8 * values[-1], values[1:])) @ vectors.T
    path = write_data(tmp_path / "p.hdf5", with_mass(0.5 * (mass + mass.T)))
    monkeypatch.setattr(conversion, "MAX_ENTRIES", 5)
    with pytest.raises(ProblemError, match="indefinite"):
        read_fclib(path)
    condensed = read_fclib(path, indefinite="project")
    assert condensed.provenance["least_eigenvalue"] < -1e-9
    assert np.linalg.eigvalsh(condensed.delassus().toarray())[0] >= -1e-12


def test_asymmetry_is_the_largest_difference_over_the_largest_entry() -> None:
    crooked = W.copy()
    crooked[0, 3] += 0.125
    assert asymmetry(sp.csr_array(W)) == 0.0
    assert asymmetry(sp.csr_array(crooked)) == 0.125 / np.abs(crooked).max()
    assert asymmetry(sp.csr_array((3, 3))) == 0.0
