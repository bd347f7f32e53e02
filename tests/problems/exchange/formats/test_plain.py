"""Plain arrays give the same problem as ``from_delassus``; invalid ones are refused in one sentence."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ContactProblem, ProblemError, load
from proxbench.solvers import solve

G = np.array([[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
C = np.array([-1.0, 0.1, 0.0])
CSR = sp.csr_array(G)
PARTS = {"data": CSR.data, "indices": CSR.indices, "indptr": CSR.indptr}


def saved(folder: Path, **arrays: Any) -> Path:
    np.savez(folder / "mine.npz", **arrays)
    return folder / "mine.npz"


@pytest.mark.parametrize(
    "arrays",
    [
        {"G": G, "c": C, "mu": 0.5},
        {"G": G, "c": C, "mu": [0.5]},
        {"G": G, "c": C, "mu": 0.5, "dim": 3},
        {**PARTS, "c": C, "mu": [0.5]},
    ],
)
def test_plain_arrays_are_the_problem_of_from_delassus(arrays: dict[str, Any], tmp_path: Path) -> None:
    problem = load(saved(tmp_path, **arrays))
    assert problem.digest == ContactProblem.from_delassus(G, C, 0.5).digest
    assert problem.name == "mine"


def test_rows_per_contact_come_from_the_lengths_of_c_and_mu(tmp_path: Path) -> None:
    planar = load(saved(tmp_path, G=np.eye(4), c=[-1.0, 0.0, -1.0, 0.0], mu=[0.1, 0.2]))
    assert (planar.n_contacts, planar.n_rows) == (2, 4)
    frictionless = load(saved(tmp_path, G=np.eye(2), c=[-1.0, -2.0], dim=1))
    assert (frictionless.n_contacts, frictionless.n_rows) == (2, 2)


def test_a_file_of_plain_arrays_is_solved_by_its_path(tmp_path: Path) -> None:
    solution = solve(str(saved(tmp_path, G=G, c=C, mu=0.5)), "SORprox", tolerance=1e-10)
    assert solution.impulses == pytest.approx([0.5, -0.1, 0.0])


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"G": G, "mu": 0.5}, "no array 'c'"),
        ({"G": G, "c": C}, "no array 'mu'"),
        ({"G": G, "c": C, "Mu": 0.5}, "unknown array 'Mu'; did you mean 'mu'"),
        ({"c": C, "mu": 0.5}, "Delassus matrix once"),
        ({"G": G, **PARTS, "c": C, "mu": 0.5}, "Delassus matrix once"),
        ({"data": CSR.data, "indices": CSR.indices, "c": C, "mu": 0.5}, "no array 'indptr'"),
        ({**PARTS, "indices": CSR.indices + 7, "c": C, "mu": 0.5}, "not a 3 x 3 matrix"),
        ({**PARTS, "indices": CSR.indices - 7, "c": C, "mu": 0.5}, "not a 3 x 3 matrix"),
        ({**PARTS, "indptr": CSR.indptr.astype(float), "c": C, "mu": 0.5}, "not a 3 x 3 matrix"),
        ({**PARTS, "data": CSR.data[:1], "c": C, "mu": 0.5}, "not a 3 x 3 matrix"),
        ({"G": G, "c": C, "mu": [0.5, 0.5]}, "1, 2 or 3 rows per contact"),
        ({"G": G, "c": C, "mu": []}, "1, 2 or 3 rows per contact"),
        ({"G": G, "c": C, "mu": 0.5, "dim": 3.0}, "'dim' must be one whole number"),
        ({"G": G, "c": C, "mu": 0.5, "dim": 4}, "dim must be 1"),
        ({"G": G[:2], "c": C, "mu": 0.5}, "G"),
        ({"G": G, "c": C[:, None], "mu": 0.5}, "c must be a vector"),
        ({"G": G, "c": C, "mu": -0.5}, "not negative"),
        ({"G": G, "c": C * np.nan, "mu": 0.5}, "finite"),
        ({"G": G + np.triu(np.ones((3, 3)), 1), "c": C, "mu": 0.5}, "is asymmetric"),
        ({"G": G.astype(str), "c": C, "mu": 0.5}, "G"),
        ({"G": G, "c": C.astype(str), "mu": 0.5}, "c"),
    ],
)
def test_malformed_arrays_are_refused_in_one_sentence(arrays: dict[str, Any], words: str, tmp_path: Path) -> None:
    file = saved(tmp_path, **arrays)
    with pytest.raises(ProblemError, match=words) as caught:
        load(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


def test_a_file_without_a_known_layout_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"not a problem file.*numpy\.savez of G, c and mu"):
        load(saved(tmp_path, weights=np.eye(3)))
