"""The inverse of a mass matrix is found block by block in any order of the degrees of freedom, and M is kept."""

import io

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.contact.matrices import block_diagonal
from proxbench.problems.contact.matrices.factors import InverseMass
from proxbench.problems.exchange.files.problem_file import problem_bytes, read_problem


def mass_of_bodies(seed: int, shuffled: bool) -> sp.csr_array:
    """Return M of bodies with 1, 3 and 6 coupled degrees of freedom, in order or shuffled."""
    rng = np.random.default_rng(seed)
    blocks = []
    for size in rng.choice([1, 3, 6], size=12):
        half = rng.normal(size=(size, size))
        blocks.append(half @ half.T + size * np.eye(size))
    mass = sp.csr_array(sp.block_diag(blocks))
    order = rng.permutation(mass.shape[0]) if shuffled else np.arange(mass.shape[0])
    return sp.csr_array(mass[order][:, order])


@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_the_inverse_is_that_of_dense_algebra_and_couples_no_other_bodies(seed: int, shuffled: bool) -> None:
    mass = mass_of_bodies(seed, shuffled)
    inverse = InverseMass.of_mass(mass)
    assert np.abs(inverse.matrix.toarray() - np.linalg.inv(mass.toarray())).max() < 1e-13
    assert np.array_equal(inverse.matrix.toarray() != 0, mass.toarray() != 0)
    assert abs(inverse.matrix - inverse.matrix.T).max() == 0.0


def test_the_root_is_a_root_with_the_same_blocks() -> None:
    inverse = InverseMass.of_mass(mass_of_bodies(5, shuffled=True))
    assert abs(inverse.root @ inverse.root.T - inverse.matrix).max() < 1e-15
    assert set(zip(*inverse.root.nonzero(), strict=True)) <= set(zip(*inverse.matrix.nonzero(), strict=True))


def test_stored_zeros_of_the_mass_matrix_couple_no_coordinates() -> None:
    mass = sp.csr_array(np.full((3, 3), 7.0))
    mass.data[:] = np.diag([2.0, 4.0, 8.0]).ravel()
    inverse = InverseMass.of_mass(mass)
    assert inverse.is_diagonal
    assert np.array_equal(inverse.matrix.data, [0.5, 0.25, 0.125])


def test_the_mass_is_kept_bit_by_bit_also_in_a_file() -> None:
    mass = mass_of_bodies(1, shuffled=True)
    directions = np.eye(mass.shape[0])[:, :3]
    problem = ContactProblem.from_factors(directions, InverseMass.of_mass(mass), np.ones(3), 0.5)
    for again in (problem, problem.fresh(), read_problem(io.BytesIO(problem_bytes(problem)))):
        assert again.factors is not None
        kept = again.factors.inverse_mass.mass
        assert kept is not None
        assert np.array_equal(kept.toarray(), mass.toarray())
        assert again.digest == problem.digest


@pytest.mark.parametrize("is_diagonal", [False, True])
def test_a_fresh_copy_has_the_root_and_shares_no_memory(is_diagonal: bool) -> None:
    inverse = InverseMass.create(np.ones(4)) if is_diagonal else InverseMass.of_mass(mass_of_bodies(2, shuffled=True))
    fresh = inverse.fresh()
    assert {"root_diagonal" if is_diagonal else "root", "is_diagonal"} <= vars(fresh).keys()
    for one, other in ((fresh.matrix, inverse.matrix), (fresh.root, inverse.root)):
        assert np.array_equal(one.toarray(), other.toarray())
        assert not np.shares_memory(one.data, other.data)
    if is_diagonal:
        for one in (inverse, fresh):
            assert not one.root_diagonal.flags.writeable
            assert not np.shares_memory(inverse.root_diagonal, fresh.root_diagonal)


def test_an_invalid_mass_matrix_is_refused_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    upper = np.eye(3)
    upper[0, 1] = 0.5
    indefinite = np.diag([1.0, 1.0, 1.0, 1.0])
    indefinite[2, 3] = indefinite[3, 2] = 2.0
    for given, words in (
        (np.ones((2, 3)), "M must be square"),
        (upper, "M must be symmetric; the block of degree of freedom 0"),
        (indefinite, "M must be positive definite; the block of degree of freedom 2"),
        (np.diag([1.0, 0.0]), "M must be positive definite; the block of degree of freedom 1"),
        (np.diag([1.0, np.nan]), r"M\[1, 1\] = nan"),
        (np.diag([1.0, 1e-310]), r"M⁻¹\[1, 1\] = inf"),
    ):
        with pytest.raises(ProblemError, match=words):
            InverseMass.of_mass(given)
    monkeypatch.setattr(block_diagonal, "MAX_ENTRIES", 8)
    with pytest.raises(ProblemError, match="M couples 3 degrees of freedom"):
        InverseMass.of_mass(np.ones((3, 3)) + np.eye(3))
