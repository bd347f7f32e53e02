"""The block factorisation: an exact solution for every pattern, whatever the order of elimination."""

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray
from proxbench.solvers.interior.systems.block_lu import BlockLU
from proxbench.solvers.interior.systems.elimination import find_elimination


def grid(side: int) -> sp.csr_array:
    """The pattern of a square grid of blocks, its diagonal stored."""
    line = sp.diags_array([np.ones(side - 1), np.ones(side), np.ones(side - 1)], offsets=[-1, 0, 1])
    pattern = sp.csr_array(sp.kron(line, sp.eye_array(side)) + sp.kron(sp.eye_array(side), line))
    pattern.sort_indices()
    return pattern


def random_blocks(pattern: sp.csr_array, width: int, seed: int) -> NDArray[np.float64]:
    """Blocks of a matrix that is not symmetric, its symmetric part positive definite."""
    random = np.random.default_rng(seed)
    blocks = random.normal(size=(pattern.nnz, width, width))
    rows = np.repeat(np.arange(pattern.shape[0]), np.diff(pattern.indptr))
    blocks[rows == pattern.indices] += 12.0 * width * np.eye(width)
    return blocks


@pytest.mark.parametrize("width", [1, 2, 3, 6])
@pytest.mark.parametrize("pattern", [grid(1), grid(7), sp.csr_array(np.ones((9, 9))), sp.csr_array(sp.eye_array(5))])
def test_solutions_satisfy_the_system(pattern: sp.csr_array, width: int) -> None:
    n = pattern.shape[0]
    blocks = random_blocks(pattern, width, n)
    factors = BlockLU(pattern.indptr, pattern.indices, width)
    assert factors.factorise(blocks)
    matrix = sp.bsr_array((blocks, pattern.indices, pattern.indptr), shape=(n * width, n * width))
    right = np.random.default_rng(0).normal(size=n * width)
    assert np.abs(matrix @ factors.solve(right) - right).max() < 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_the_sign_of_the_determinant_is_that_of_the_dense_matrix(seed: int) -> None:
    """Rows are multiplied with random signs, which leaves a matrix of either sign."""
    pattern, width = grid(4), 3
    blocks = random_blocks(pattern, width, seed)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(16, width))
    blocks *= signs[np.repeat(np.arange(16), np.diff(pattern.indptr))][:, :, None]
    factors = BlockLU(pattern.indptr, pattern.indices, width)
    assert factors.factorise(blocks)
    dense = sp.bsr_array((blocks, pattern.indices, pattern.indptr)).toarray()
    assert factors.determinant_sign() == np.linalg.slogdet(dense)[0] == np.prod(signs)


def test_one_elimination_order_serves_all_values_of_a_pattern() -> None:
    pattern, right = grid(5), np.ones(75)
    factors = BlockLU(pattern.indptr, pattern.indices, 3)
    for seed in range(3):
        blocks = random_blocks(pattern, 3, seed)
        assert factors.factorise(blocks)
        matrix = sp.bsr_array((blocks, pattern.indices, pattern.indptr))
        assert np.abs(matrix @ factors.solve(right) - right).max() < 1e-12


def test_one_correction_reduces_the_residual_of_stiff_blocks_to_rounding() -> None:
    """With I + 10⁷ VVᵀ on the diagonal, the residual of the equations is the rounding of their terms."""
    pattern, width = grid(4), 6
    random = np.random.default_rng(0)
    blocks = np.zeros((pattern.nnz, width, width))
    rows = np.repeat(np.arange(16), np.diff(pattern.indptr))
    stiff = random.normal(size=(16, width, 2))
    blocks[rows == pattern.indices] = np.eye(width) + 1e7 * stiff @ stiff.transpose(0, 2, 1)
    matrix = sp.bsr_array((blocks, pattern.indices, pattern.indptr))
    right = matrix @ random.normal(size=16 * width)
    left = []
    for corrections in (0, 1):
        factors = BlockLU(pattern.indptr, pattern.indices, width, corrections)
        assert factors.factorise(blocks)
        found = factors.solve(right)
        left.append(np.abs(matrix @ found - right).max() / (np.abs(matrix.toarray()) @ np.abs(found)).max())
    assert left[1] <= 1e-15 < 1e-10 < left[0]


def test_a_singular_matrix_has_no_factors() -> None:
    pattern = grid(3)
    assert not BlockLU(pattern.indptr, pattern.indices, 2).factorise(np.zeros((pattern.nnz, 2, 2)))


def test_every_block_is_eliminated_once_and_children_come_before_their_parents() -> None:
    pattern = grid(12)
    found = find_elimination(pattern.indptr, pattern.indices)
    assert sorted(found.order) == list(range(144))
    assert sorted(found.entries) == list(range(pattern.nnz))
    for node in range(len(found.node_starts) - 1):
        children = found.children[found.child_starts[node] : found.child_starts[node + 1]]
        assert (children < node).all()


def test_divided_supernodes_take_less_work_and_have_the_same_solution() -> None:
    pattern = grid(60)
    whole, divided = (find_elimination(pattern.indptr, pattern.indices, most) for most in (3600, 40))
    assert np.diff(whole.node_starts).max() > 40 == np.diff(divided.node_starts).max()
    assert divided.multiplications < whole.multiplications
    rng = np.random.default_rng(0)
    blocks, right = rng.normal(size=(pattern.nnz, 1, 1)), rng.normal(size=3600)
    blocks[pattern.indices == np.repeat(np.arange(3600), np.diff(pattern.indptr))] += 10.0
    factors = [BlockLU(pattern.indptr, pattern.indices, 1, max_columns=most) for most in (3600, 40)]
    assert all(factor.factorise(blocks) for factor in factors)
    found = [factor.solve(right) for factor in factors]
    assert np.abs(found[0] - found[1]).max() <= 1e-12 * np.abs(found[0]).max()


def test_work_on_a_grid_grows_more_slowly_than_that_of_a_band() -> None:
    """A band over k² rows takes about k⁴ operations, 16 times as many at twice the side; the least factor is 8."""
    work = [find_elimination(grid(side).indptr, grid(side).indices, side**2).multiplications for side in (20, 40)]
    assert 8.0 <= work[1] / work[0] < 12.0
