"""Matrices are read as in scipy, whatever their form, and refused if compiled code cannot trust them."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.contact.matrices.user_matrices import _is_in_order, read_matrix


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), rows=st.integers(0, 9), columns=st.integers(1, 48), density=st.floats(0.0, 1.0))
def test_every_form_of_a_matrix_is_read_as_the_same_arrays(seed: int, rows: int, columns: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    dense = rng.normal(size=(rows, columns)) * (rng.random((rows, columns)) < density)
    wanted = sp.csr_array(dense)
    shuffled = sp.csr_array(sp.coo_array(wanted))
    for row in range(rows):
        part = slice(shuffled.indptr[row], shuffled.indptr[row + 1])
        for array in (shuffled.indices, shuffled.data):
            array[part] = array[part][::-1].copy()
    shuffled.has_canonical_format = shuffled.has_sorted_indices = True  # simulates a stale flag
    for form in (dense, np.asfortranarray(dense), wanted, sp.csc_array(wanted), shuffled):
        found = read_matrix(form, "A", sp.csr_array)
        for name in ("data", "indices", "indptr"):
            assert np.array_equal(getattr(found, name), getattr(wanted, name))
            assert not getattr(found, name).flags.writeable


def test_duplicates_are_added_up() -> None:
    doubled = sp.csr_array((np.array([1.0, 2.0, 5.0]), np.array([1, 1, 0]), np.array([0, 2, 3])), shape=(2, 2))
    assert np.array_equal(read_matrix(doubled, "A", sp.csr_array).toarray(), [[0.0, 3.0], [5.0, 0.0]])


def eye_with_index(form: str, index: int) -> sp.sparray:
    """The identity, with a last entry in a row or column that does not exist."""
    matrix = sp.eye_array(3, format=form)
    indices = np.array([0, 1, index], dtype=np.int64)
    if form == "coo":
        matrix.coords = (indices, np.arange(3))
    else:
        matrix.indices = indices
    return matrix


@pytest.mark.parametrize("index", [-1, 3, 2**31 + 1])
@pytest.mark.parametrize("form", ["csr", "csc", "bsr", "coo"])
def test_an_index_outside_the_shape_is_refused(form: str, index: int) -> None:
    with pytest.raises(ProblemError, match="G is not a valid sparse matrix"):
        ContactProblem.from_delassus(eye_with_index(form, index), -np.ones(3))
    with pytest.raises(ProblemError, match="W is not a valid sparse matrix"):
        ContactProblem.from_factors(eye_with_index(form, index), np.ones(3), -np.ones(3))


@pytest.mark.parametrize("starts", [[0, 1, 2], [0, 1, 3], [0, 1, 2, 3, 3]])
@pytest.mark.parametrize("form", ["csr", "csc"])
def test_a_matrix_whose_arrays_do_not_fit_together_is_refused(form: str, starts: list[int]) -> None:
    matrix = sp.eye_array(3, format=form)
    matrix.indptr = np.array(starts, dtype=np.int32)
    with pytest.raises(ProblemError, match="G is not a valid sparse matrix"):
        ContactProblem.from_delassus(matrix, -np.ones(3))


@pytest.mark.parametrize("change", ["none", "swapped", "repeated", "negative", "beyond", "infinite", "not a number"])
def test_exactly_the_matrices_whose_indices_ascend_and_whose_entries_are_finite_are_in_order(change: str) -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        matrix = sp.csr_array(rng.normal(size=(6, 9)) * (rng.random((6, 9)) < 0.5) * (rng.random((6, 1)) < 0.8))
        indices, data = matrix.indices, matrix.data
        row = rng.choice(np.flatnonzero(np.diff(matrix.indptr) > 1))
        first, last = matrix.indptr[row], matrix.indptr[row + 1] - 1
        if change == "swapped":
            indices[[first, last]] = indices[[last, first]]
        elif change == "repeated":
            indices[last] = indices[last - 1]
        elif change in ("negative", "beyond"):
            indices[first if change == "negative" else last] = -1 if change == "negative" else 9
        elif change != "none":
            data[rng.integers(len(data))] = rng.choice([-np.inf, np.inf]) if change == "infinite" else np.nan
        assert _is_in_order(matrix.indptr, indices, data, 9) == (change == "none")


@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array])
def test_indices_of_64_bits_that_fit_are_stored_in_32_bits(kind: type[sp.csr_array]) -> None:
    """Kernels are then compiled for one index type."""
    matrix = kind(np.array([[2.0, 1.0], [1.0, 2.0]]))
    matrix.indices, matrix.indptr = matrix.indices.astype(np.int64), matrix.indptr.astype(np.int64)
    stored = read_matrix(matrix, "G", sp.csr_array)
    assert stored.indices.dtype == stored.indptr.dtype == np.int32
    assert np.array_equal(stored.toarray(), [[2.0, 1.0], [1.0, 2.0]])
