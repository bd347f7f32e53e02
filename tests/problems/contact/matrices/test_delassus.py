"""A given matrix is converted completely into blocks, whatever entries it stores."""

import numpy as np
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import Laws
from proxbench.problems.contact.blocks import layout_of
from proxbench.problems.contact.matrices.delassus import blocks_from_matrix


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 8), width=st.integers(1, 3), hole=st.booleans())
def test_blocks_hold_the_matrix_with_the_diagonal_first_and_ascending_columns_behind_it(
    seed: int, n: int, width: int, hole: bool
) -> None:
    rng = np.random.default_rng(seed)
    pattern = (rng.random((n, n)) < 0.4) | np.eye(n, dtype=bool)
    dense = rng.uniform(1.0, 2.0, (n * width, n * width)) * np.kron(pattern, np.ones((width, width)))
    if hole:
        dense[rng.integers(n * width), rng.integers(n * width)] = 0.0
    pattern = dense.reshape(n, width, n, width).any(axis=(1, 3))
    layout = layout_of(Laws.contacts(0.5, width, n))
    blocks = blocks_from_matrix(sp.csr_array(dense), layout)
    assert np.array_equal(blocks.to_csr(layout).toarray(), dense)
    for row in range(n):
        columns = blocks.columns[blocks.starts[row] : blocks.starts[row + 1]]
        assert columns[0] == row
        assert np.array_equal(columns[1:], np.setdiff1d(np.flatnonzero(pattern[row]), row))
