"""Contact problems check and freeze their arguments, and a digest identifies their numbers."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, ProblemError, load
from proxbench.problems.contact.blocks import BlockLayout
from proxbench.problems.contact.matrices.symmetric import _largest_asymmetry, _largest_excess

G = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.1], [0.0, 0.1, 3.0]])
C = np.array([-1.0, 0.5, 0.2])


def changed(matrix: np.ndarray, row: int, column: int, value: float) -> np.ndarray:
    other = matrix.copy()
    other[row, column] = value
    return other


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"delassus": changed(G, 0, 1, np.nan)}, r"G\[0, 1\] = nan"),
        ({"delassus": changed(G, 2, 2, np.inf)}, r"G\[2, 2\] = inf"),
        ({"delassus": changed(G, 0, 1, 0.7)}, r"symmetric"),
        (
            {"delassus": changed(G, 1, 1, -1.0)},
            r"G is not positive semidefinite: its diagonal entry G\[1, 1\] is -1\.0\.",
        ),
        ({"delassus": G[:2]}, r"shape \(3, 3\)"),
        ({"delassus": "text"}, "G must be"),
        ({"delassus": None}, "G must be|either G"),
        ({"free_velocity": [1.0, np.inf, 0.0]}, r"c\[1\] = inf"),
        ({"free_velocity": [1.0, 2.0]}, "multiple of dim"),
        ({"free_velocity": [[1.0, 2.0, 3.0]]}, "vector"),
        ({"free_velocity": "abc"}, "c must be"),
        ({"free_velocity": [1.0, [2.0], 3.0]}, "c must be"),
        ({"free_velocity": [1.0 + 2.0j, 0.0, 0.0]}, "c must be"),
        ({"friction": -0.1}, r"friction\[0\] = -0.1"),
        ({"friction": [0.1, 0.2]}, "friction"),
        ({"friction": "rough"}, "friction"),
        ({"dim": 5}, "dim"),
    ],
)
def test_invalid_input_is_reported_in_one_sentence(arguments: dict[str, Any], words: str) -> None:
    given = {"delassus": G, "free_velocity": C, "friction": 0.3, **arguments}
    with pytest.raises(ProblemError, match=words) as caught:
        ContactProblem.from_delassus(**given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"force_directions": changed(G, 0, 1, np.nan)}, r"W\[0, 1\] = nan"),
        ({"inverse_mass": [1.0, -1.0, 1.0]}, r"M⁻¹\[1, 1\] = -1.0"),
        ({"inverse_mass": [1.0, 0.0, 1.0]}, r"M⁻¹\[1, 1\] = 0.0"),
        ({"inverse_mass": [1.0, 1.0]}, r"M⁻¹ must have shape"),
        ({"inverse_mass": np.ones((3, 3)) - 2 * np.eye(3)}, "positive definite"),
        ({"inverse_mass": changed(np.eye(3), 0, 1, 0.3)}, "symmetric"),
        ({"inverse_mass": [1.0, np.nan, 1.0]}, r"M⁻¹\[1, 1\] = nan"),
        ({"free_motion": [1.0]}, "free_motion"),
        ({"force_directions": G[:, :2]}, "W has 2 columns"),
        ({"force_directions": "text"}, "W must be"),
    ],
)
def test_invalid_factors_are_refused_with_the_reason(arguments: dict[str, Any], words: str) -> None:
    given = {"force_directions": G, "inverse_mass": np.ones(3), "free_velocity": C, **arguments}
    with pytest.raises(ProblemError, match=words):
        ContactProblem.from_factors(**given)


def test_asymmetric_matrix_is_accepted_on_request() -> None:
    problem = ContactProblem.from_delassus(changed(G, 0, 1, 0.7), C, allow_asymmetric=True)
    assert problem.delassus()[0, 1] == 0.7


def test_symmetry_to_rounding_passes() -> None:
    ContactProblem.from_delassus(changed(G, 0, 1, 0.5 * (1 + 1e-15)), C)


def test_construction_copies_and_freezes() -> None:
    matrix, c = G.copy(), C.copy()
    problem = ContactProblem.from_delassus(matrix, c, 0.3)
    digest = problem.digest
    matrix[:], c[:] = 0.0, 0.0
    assert problem.fresh().digest == digest
    for array in (problem.free_velocity, problem.delassus().data, problem.delassus_blocks().values):
        with pytest.raises(ValueError, match="read-only"):
            array.reshape(-1)[0] = 1.0


def test_the_digest_depends_on_the_numbers_alone() -> None:
    digest = ContactProblem.from_delassus(G, C, 0.3).digest
    assert ContactProblem.from_delassus(sp.csc_array(G), list(C), [0.3]).digest == digest
    assert ContactProblem.from_delassus(G, C, 0.3, name="x", provenance={"seed": 1}).digest == digest
    others = [
        ContactProblem.from_delassus(G * (1 + 1e-15), C, 0.3),
        ContactProblem.from_delassus(G, C * (1 + 1e-15), 0.3),
        ContactProblem.from_delassus(G, C, 0.3 * (1 + 1e-15)),
        ContactProblem.from_delassus(G, C, dim=1),
        ContactProblem.from_factors(np.linalg.cholesky(G).T, np.ones(3), C, 0.3),
    ]
    assert len({digest, *(other.digest for other in others)}) == 1 + len(others)


def test_a_fresh_copy_is_equal_and_shares_no_memory() -> None:
    for problem in (
        ContactProblem.from_delassus(G, C, 0.3),
        ContactProblem.from_factors(G, np.ones(3), C, 0.3, free_motion=np.ones(3)),
    ):
        problem.delassus_blocks()
        copy = problem.fresh()
        assert copy.digest == problem.digest
        assert not np.shares_memory(copy.free_velocity, problem.free_velocity)
        assert not np.shares_memory(copy.delassus().data, problem.delassus().data)


def random_laws(rng: np.random.Generator, n: int) -> Laws:
    """Contacts of one to three rows, separate friction laws, and friction laws that do not follow their partner."""
    kind, partner, friction, fixed = [], [], [], []
    unilateral: list[int] = []
    for _ in range(n):
        choice = rng.integers(5)
        if choice < 3:
            unilateral.append(len(kind))
            kind.append(0), partner.append(-1), friction.append(0.0), fixed.append(0.0)
        if choice in (1, 2):
            kind.append(int(choice)), partner.append(len(kind) - 2), friction.append(0.5), fixed.append(0.1)
        if choice == 3:
            kind.append(int(rng.integers(1, 3))), partner.append(-1), friction.append(0.0), fixed.append(0.3)
        if choice == 4 and unilateral:
            kind.append(int(rng.integers(1, 3))), partner.append(int(rng.choice(unilateral)))
            friction.append(0.2), fixed.append(0.0)
    rows = np.concatenate([[0], np.cumsum([2 if k == 2 else 1 for k in kind])]).astype(int)
    return Laws(np.array(kind), rows[:-1], np.array(friction), np.array(fixed), np.array(partner))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 12), diagonal=st.booleans())
def test_assembly_from_factors_is_the_dense_product_for_any_mixture_of_laws(seed: int, n: int, diagonal: bool) -> None:
    rng = np.random.default_rng(seed)
    laws = random_laws(rng, n)
    directions = rng.normal(size=(9, laws.n_rows)) * (rng.random((9, laws.n_rows)) < 0.5)
    inverse = np.diag(rng.uniform(0.1, 3.0, 9))
    if not diagonal:
        for first in (0, 3, 6):
            root = rng.normal(size=(3, 3))
            inverse[first : first + 3, first : first + 3] = root @ root.T + np.eye(3)
    problem = ContactProblem.from_factors(directions, inverse, rng.normal(size=laws.n_rows), laws=laws)
    dense = directions.T @ inverse @ directions
    scale = np.abs(dense).max(initial=1.0)
    assert np.abs(problem.delassus().toarray() - dense).max(initial=0.0) <= 1e-13 * scale
    assert np.abs(problem.delassus_diagonal - np.diag(dense)).max(initial=0.0) <= 1e-13 * scale
    impulses = rng.normal(size=laws.n_rows)
    velocity = dense @ impulses + problem.free_velocity
    assert np.abs(problem.relative_velocity(impulses) - velocity).max(initial=0.0) <= 1e-12 * scale


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 12))
def test_blocks_hold_the_matrix_with_the_diagonal_first(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    laws = random_laws(rng, n)
    root = rng.normal(size=(5, laws.n_rows)) * (rng.random((5, laws.n_rows)) < 0.4)
    dense = root.T @ root
    problem = ContactProblem.from_delassus(dense, rng.normal(size=laws.n_rows), laws=laws)
    blocks = problem.delassus_blocks()
    assert np.array_equal(blocks.to_csr(problem.layout).toarray(), dense)
    assert np.array_equal(blocks.columns[blocks.starts[:-1]], np.arange(problem.layout.n_blocks))
    for begin, end in pairwise(blocks.starts):
        assert (np.diff(blocks.columns[begin + 1 : end]) > 0).all()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 8))
def test_the_largest_asymmetry_and_the_largest_excess_of_an_entry_agree_with_dense_arrays(seed: int, n: int) -> None:
    """They are compared with dense differences; entries may be on one side of the diagonal only."""
    rng = np.random.default_rng(seed)
    dense = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.5)
    np.fill_diagonal(dense, rng.uniform(0.0, 1.0, n))
    matrix, root = sp.csr_array(dense), np.sqrt(np.diag(dense))
    difference, row, column = _largest_asymmetry(matrix.indptr, matrix.indices, matrix.data)
    assert difference == np.abs(dense - dense.T).max()
    assert difference == abs(dense[row, column] - dense[column, row])
    excess, row, column = _largest_excess(matrix.indptr, matrix.indices, matrix.data, root)
    of_entries = np.where(dense != 0.0, np.abs(dense) - np.outer(root, root), -np.inf)
    assert excess == of_entries.max()
    assert excess == of_entries[row, column]


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 20))
def test_padding_and_unpadding_are_inverse_and_padding_is_zero(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    layout = BlockLayout.of(random_laws(rng, n))
    rows = rng.uniform(1.0, 2.0, len(layout.slot))
    padded = layout.pad(rows)
    assert np.array_equal(layout.unpad(padded), rows)
    assert np.count_nonzero(padded) == len(rows)


def test_a_problem_shows_itself_in_one_line() -> None:
    problem = ContactProblem.from_delassus(np.eye(6), np.zeros(6), 0.3, name="two contacts")
    assert repr(problem) == "<ContactProblem 'two contacts': 2 contacts, 6 rows, holds G>"
    chain = load("hard-chain-10")
    assert repr(chain) == "<ContactProblem 'hard-chain-10': 0 contacts, 20 rows, 20 of joints, holds W and M⁻¹>"


def test_a_matrix_of_single_precision_stays_a_problem_under_another_name() -> None:
    """Its rounding is within the tolerances of single precision, which must also hold for the copy in doubles."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(36, 6))
    problem = ContactProblem.from_delassus((root @ root.T).astype(np.float32), rng.normal(size=36), 0.5)
    assert np.linalg.eigvalsh(problem.delassus().toarray())[0] < -1e-9 * np.abs(problem.delassus_diagonal).max()
    for same in (problem.renamed("other"), problem.anonymous(), problem.fresh(), problem.answered(None, source="here")):
        assert same.digest == problem.digest


LAWS = Laws.contacts(0.3, 3, 1)


@pytest.mark.parametrize("given", [{"friction": 0.9}, {"friction": 0.0}, {"dim": 3}, {"dim": 2}])
def test_friction_and_dimension_beside_laws_are_refused_because_they_have_no_effect(given: dict[str, Any]) -> None:
    (name,) = given
    words = f"^{name} has no effect if laws are given; omit it"
    with pytest.raises(ProblemError, match=words):
        ContactProblem.from_delassus(G, C, laws=LAWS, **given)
    with pytest.raises(ProblemError, match=words):
        ContactProblem.from_factors(np.eye(3), np.ones(3), C, laws=LAWS, **given)


def test_contacts_without_friction_and_dimension_are_spatial_and_frictionless() -> None:
    problem = ContactProblem.from_delassus(G, C)
    assert problem.n_contacts == 1
    assert not problem.laws.friction_coefficient.any()


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"name": 5}, "name must be a string; got a value of type int"),
        ({"provenance": 5}, "provenance must be a dictionary; got a value of type int"),
        ({"answer": np.zeros(3)}, "answer must be an Answer, .* got a value of type ndarray"),
        ({"laws": [1]}, "laws must be Laws, .* got a value of type list"),
        ({"keys": "a"}, "`keys` must be a sequence of strings, one for each contact, got 'a'"),
        ({"keys": [5]}, r"`keys` must be a sequence of strings, one for each contact, got \[5\]"),
        ({"keys": 3}, "`keys` must be a sequence of strings, one for each contact, got 3"),
    ],
)
def test_an_attribute_of_another_type_is_refused(attributes: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        ContactProblem.from_delassus(G, C, **attributes)


def test_a_new_name_must_be_a_text() -> None:
    with pytest.raises(ProblemError, match="name must be a string"):
        ContactProblem.from_delassus(G, C).renamed(5)  # type: ignore[arg-type]


def test_keys_are_stored_as_a_tuple_that_cannot_change() -> None:
    keys = ["left", "right"]
    problem = ContactProblem.from_delassus(np.eye(6), np.zeros(6), keys=keys)
    keys[0] = "changed"
    assert problem.keys == ("left", "right")


def test_an_answer_of_another_type_is_refused() -> None:
    with pytest.raises(ProblemError, match="answer must be an Answer"):
        ContactProblem.from_delassus(np.eye(3), np.zeros(3)).answered([0.0, 0.0, 0.0])  # type: ignore[arg-type]


@pytest.mark.parametrize("dim", [3.0, 2.5])
def test_a_dimension_that_is_not_an_integer_is_refused(dim: Any) -> None:
    with pytest.raises(ProblemError, match="dim must be"):
        ContactProblem.from_delassus(np.eye(3), np.zeros(3), 0.5, dim)
