"""A matrix is the same in every storage, and an inconsistent one is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from handmade_fclib import Q, W, local_data, matrix_data, write_data
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from proxbench.problems.exchange.fclib.container import ContainerError, open_container
from proxbench.problems.exchange.fclib.matrices import COLUMNS, ROWS, TRIPLETS, read_matrix, stored_matrix

KINDS = {"triplets": TRIPLETS, "columns": COLUMNS, "rows": ROWS}


def read(path: Path, shape: tuple[int, int]) -> Any:
    with open_container(path) as file:
        return read_matrix(file.group("matrix"), shape)


def write_matrix(path: Path, parts: dict[str, Any]) -> Path:
    return write_data(path, {f"matrix/{name}": value for name, value in parts.items()})


@pytest.mark.parametrize("kind", KINDS)
@given(matrix=arrays(np.float64, st.tuples(st.integers(1, 5), st.integers(1, 5)), elements=st.floats(-9, 9)))
def test_matrices_round_trip_bit_by_bit_in_every_storage_scheme(
    kind: str, matrix: np.ndarray, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("matrix") / "m.hdf5"
    assert np.array_equal(read(write_matrix(path, matrix_data(matrix, kind)), matrix.shape).toarray(), matrix)
    again = stored_matrix(read(path, matrix.shape), KINDS[kind])
    assert np.array_equal(read(write_matrix(path, again), matrix.shape).toarray(), matrix)


def test_a_lower_triangle_stands_for_a_symmetric_matrix(tmp_path: Path) -> None:
    packed = matrix_data(W, "packed")
    assert len(packed["x"]) < np.count_nonzero(W)
    assert np.array_equal(read(write_matrix(tmp_path / "m.hdf5", packed), W.shape).toarray(), W)
    as_data = {**packed, "symmetric_packed": None, "packed": None}
    path = write_matrix(tmp_path / "n.hdf5", as_data)
    assert np.array_equal(read(path, W.shape).toarray(), np.tril(W))


def test_entries_given_twice_are_added(tmp_path: Path) -> None:
    doubled = matrix_data(W, "triplets")
    twice = {name: np.concatenate([doubled[name], doubled[name]]) for name in "pix"}
    nz = np.array([2 * len(doubled["x"])], dtype=np.int32)
    path = write_matrix(tmp_path / "m.hdf5", {**doubled, **twice, "nz": nz, "nzmax": nz})
    assert np.array_equal(read(path, W.shape).toarray(), 2 * W)


@pytest.mark.parametrize("kind", KINDS)
def test_arrays_may_be_longer_than_what_they_hold(kind: str, tmp_path: Path) -> None:
    parts = matrix_data(W, kind)
    longer = {"x": np.append(parts["x"], np.full(7, np.nan)), "i": np.append(parts["i"], np.full(7, -5))}
    if kind == "triplets":
        longer["p"] = np.append(parts["p"], np.full(7, -5))
    assert np.array_equal(read(write_matrix(tmp_path / "m.hdf5", {**parts, **longer}), W.shape).toarray(), W)


@pytest.mark.parametrize(
    ("kind", "changes", "words"),
    [
        ("rows", {"m": 7}, r"must have shape \(6, 6\) to match the vectors, got \(7, 6\)"),
        ("rows", {"m": 2**31 - 1, "n": 2**31 - 1}, "must have shape"),
        ("rows", {"nz": -3}, "nz = -3 is not a storage format"),
        ("rows", {"p": np.arange(6)}, "p must have 7 entries, got 6"),
        ("rows", {"p": np.array([0, 2, 1, 3, 4, 5, 6])}, "p must rise"),
        ("rows", {"p": np.array([0, 1, 2, 3, 4, 5, 2**31 - 1])}, "p must rise"),
        ("rows", {"p": np.array([-1, 1, 2, 3, 4, 5, 6])}, "p must rise"),
        ("columns", {"i": np.full(12, 6)}, "i has the index 6, which must be from 0 to 5"),
        ("triplets", {"p": np.full(12, -1)}, "p has the index -1"),
        ("triplets", {"nz": 13}, "fewer than nz = 13"),
        ("triplets", {"x": np.zeros(3)}, "x has 3 entries"),
        ("rows", {"x": None}, "/matrix/x is missing"),
        ("rows", {"symmetric_packed": 1}, "more than a lower triangle"),
    ],
)
def test_a_matrix_that_contradicts_itself_is_refused(
    kind: str, changes: dict[str, Any], words: str, tmp_path: Path
) -> None:
    numbers = {name: np.array([value]) if isinstance(value, int) else value for name, value in changes.items()}
    with pytest.raises(ContainerError, match=words):
        read(write_matrix(tmp_path / "m.hdf5", {**matrix_data(W, kind), **numbers}), W.shape)


def test_the_local_problem_of_these_tests_is_the_one_that_is_shipped() -> None:
    folder = Path(__file__).parent / "files"
    for kind in ("triplets", "columns", "rows", "packed"):
        with open_container(folder / f"local-{kind}.hdf5") as file:
            root = file.group("fclib_local")
            assert np.array_equal(read_matrix(root.group("W"), W.shape).toarray(), W)
            assert np.array_equal(root.group("vectors").floats("q"), Q)
    assert set(local_data()) > {"fclib_local/spacedim"}
