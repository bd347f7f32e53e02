"""Force directions in pieces represent the same matrix as in columns."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem
from proxbench.problems.contact.blocks import layout_of
from proxbench.problems.contact.laws import Laws
from proxbench.problems.contact.matrices.factors import Factors, InverseMass
from proxbench.problems.contact.matrices.pieces import Pieces, cut_into_pieces


def pairs(seed: int, n_blocks: int, width: int, length: int, n_chunks: int) -> Pieces:
    """Blocks of two pieces on random chunks; some of the second pieces are absent."""
    rng = np.random.default_rng(seed)
    chunks = np.concatenate([rng.choice(n_chunks, 2, replace=False) for _ in range(n_blocks)]).astype(np.int64)
    values = rng.normal(size=(len(chunks), width, length))
    alone = 2 * np.flatnonzero(rng.random(n_blocks) < 0.4) + 1
    chunks[alone], values[alone] = n_chunks, 0.0
    return Pieces(2 * np.arange(n_blocks + 1), chunks, values, n_chunks)


shapes = given(
    seed=st.integers(0, 2**31),
    n_blocks=st.integers(1, 6),
    width=st.integers(1, 3),
    length=st.sampled_from([1, 3, 6]),  # each is compiled with each width
    n_chunks=st.integers(2, 4),
)


@settings(max_examples=30, deadline=None)
@shapes
def test_products_agree_with_the_sparse_matrix(
    seed: int, n_blocks: int, width: int, length: int, n_chunks: int
) -> None:
    pieces = pairs(seed, n_blocks, width, length, n_chunks)
    matrix = pieces.to_csc().toarray()
    rng = np.random.default_rng(seed)
    lanes, dofs = rng.normal(size=n_blocks * width), rng.normal(size=n_chunks * length)
    assert pieces.times(lanes) == pytest.approx(matrix @ lanes, abs=1e-12)
    assert pieces.transposed_times(dofs) == pytest.approx(matrix.T @ dofs, abs=1e-12)
    assert pieces.square_sums().ravel() == pytest.approx((matrix**2).sum(axis=0), abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), n_blocks=st.sampled_from([0, 1, 5, 500]), width=st.integers(1, 3))
def test_rows_of_columns_ascend_and_entries_in_one_row_are_added(seed: int, n_blocks: int, width: int) -> None:
    """Blocks have up to three pieces, in any order and some on one chunk."""
    rng = np.random.default_rng(seed)
    starts = np.concatenate([[0], np.cumsum(rng.integers(0, 4, n_blocks))])
    chunks = rng.integers(0, 5, starts[-1])
    values = rng.integers(-2, 3, (len(chunks), width, 2)).astype(float)
    pieces = Pieces(starts, chunks, values, 5)
    found, expected = pieces.to_csc(), np.zeros((10, n_blocks * width))
    for block in range(n_blocks):
        for piece in range(starts[block], starts[block + 1]):
            columns = slice(block * width, (block + 1) * width)
            expected[2 * chunks[piece] : 2 * chunks[piece] + 2, columns] += values[piece].T
    assert np.array_equal(found.toarray(), expected)
    for begin, end in pairwise(found.indptr):
        assert (np.diff(found.indices[begin:end]) > 0).all()


@settings(max_examples=20, deadline=None)
@shapes
def test_scaling_by_diagonal_blocks_is_the_product_with_the_root(
    seed: int, n_blocks: int, width: int, length: int, n_chunks: int
) -> None:
    pieces = pairs(seed, n_blocks, width, length, n_chunks)
    rng = np.random.default_rng(seed)
    blocks, diagonal = rng.normal(size=(n_chunks, length, length)), rng.normal(size=n_chunks * length)
    for given_root, root in ((blocks, sp.block_diag(blocks).toarray()), (diagonal, np.diag(diagonal))):
        scaled = pieces.scaled(given_root).to_csc().toarray()
        assert scaled == pytest.approx(root.T @ pieces.to_csc().toarray(), abs=1e-12)


@pytest.mark.parametrize("diagonal", [True, False])
def test_factors_in_pieces_and_in_columns_are_one_problem(diagonal: bool) -> None:
    pieces = pairs(3, 8, 3, 6, 4)
    rng = np.random.default_rng(0)
    roots = [np.tril(rng.normal(size=(6, 6)), -1) + np.diag(rng.uniform(1, 2, 6)) for _ in range(4)]
    inverse = InverseMass.create(rng.uniform(1, 2, 24) if diagonal else sp.block_diag([r @ r.T for r in roots]))
    laws, c = Laws.contacts(0.3, 3, 8), rng.normal(size=24)
    in_pieces = ContactProblem(c, laws, factors=Factors(pieces, inverse))
    in_columns = ContactProblem(c, laws, factors=Factors.create(pieces.to_csc(), inverse))
    assert in_pieces.digest == in_columns.digest
    assert in_pieces.fresh().digest == in_pieces.digest
    assert in_pieces.delassus().toarray() == pytest.approx(in_columns.delassus().toarray(), rel=1e-13, abs=1e-13)
    assert in_pieces.delassus_diagonal == pytest.approx(in_columns.delassus_diagonal, rel=1e-13)


def test_a_root_that_couples_chunks_is_no_root_in_blocks() -> None:
    matrix = np.eye(4)
    matrix[1, 2] = matrix[2, 1] = 0.5
    inverse = InverseMass.create(matrix)
    assert inverse.root_blocks(2) is None
    assert inverse.root_blocks(3) is None
    assert inverse.root_blocks(4) is not None


def test_cutting_restores_the_matrix_at_every_chunk_length_it_may_choose() -> None:
    for length in (1, 2, 3, 6):
        columns = pairs(length, 5, 3, length, 3).to_csc()
        pieces = cut_into_pieces(columns, np.ones(3 * length), layout_of(Laws.contacts(0.3, 3, 5)))
        dense = np.zeros((pieces.n_chunks * pieces.length, 15))
        dense[: columns.shape[0]] = columns.toarray()
        assert np.array_equal(pieces.to_csc().toarray(), dense)
        assert pieces.in_pairs or pieces.length != length
