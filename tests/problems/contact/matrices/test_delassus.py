"""Matrices of whole blocks are cut as the general way gathers them."""

import numpy as np
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems.contact.matrices.delassus import _cut, _gather, _gather_any


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 8), width=st.integers(1, 3), hole=st.booleans())
def test_whole_blocks_are_cut_as_any_matrix_is_gathered(seed: int, n: int, width: int, hole: bool) -> None:
    rng = np.random.default_rng(seed)
    pattern = (rng.random((n, n)) < 0.4) | np.eye(n, dtype=bool)
    dense = rng.uniform(1.0, 2.0, (n * width, n * width)) * np.kron(pattern, np.ones((width, width)))
    if hole:
        dense[rng.integers(n * width), rng.integers(n * width)] = 0.0
    matrix, lanes, slot = sp.csr_array(dense), tuple(range(width)), np.arange(n * width)
    arrays = (matrix.indptr, matrix.indices, slot, n)
    found = _gather(width, *arrays, matrix.data)
    for own, general in zip(found, _gather_any(*arrays, width, matrix.data), strict=True):
        assert np.array_equal(own, general)
    if not hole:  # the fast way is not left out by accident
        starts, columns, values = (np.empty_like(array) for array in found)
        assert _cut(lanes, matrix.indptr, matrix.indices, matrix.data, starts, columns, values.reshape(-1))
        assert np.array_equal(values, found[2])
