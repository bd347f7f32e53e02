"""The survey of a file agrees with dense linear algebra on its problem."""

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from handmade_fclib import IMPULSES, W, global_data, jointed_data, local_data, rolling_data, write_data
from proxbench.problems import ContactProblem, Laws, ProblemError, load, save_problem, write_fclib
from proxbench.problems.contact.transformations import in_units
from proxbench.problems.exchange.survey import block_conditioning, estimated_rank, problem_files, survey


@pytest.mark.parametrize("seed", range(5))
def test_the_estimated_rank_is_the_rank_whatever_the_units_of_the_rows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rank = int(rng.integers(3, 20))
    directions = sp.csr_array(rng.normal(size=(rank, 30)) * 10.0 ** rng.uniform(-3, 3, size=30))
    problem = ContactProblem.from_factors(directions, np.ones(rank), np.ones(30), 0.5)
    assert estimated_rank(problem) == rank


@pytest.mark.parametrize("name", ["funnel-100", "pile-100", "hard-duplicated-slider"])
def test_the_estimated_rank_of_known_problems_is_that_of_their_eigenvalues(name: str) -> None:
    delassus = load(name).delassus().toarray()
    root = np.sqrt(np.diag(delassus))
    values = np.linalg.eigvalsh(delassus / root[:, None] / root)
    assert estimated_rank(load(name)) == (values > 1e-9 * values[-1]).sum()


def test_zero_rows_do_not_count_towards_the_rank() -> None:
    assert estimated_rank(ContactProblem.from_delassus(np.diag([1.0, 0.0, 0.0]), np.ones(3), 0.5)) == 1
    assert estimated_rank(ContactProblem.from_delassus(np.zeros((3, 3)), np.ones(3), 0.5)) == 0


def test_the_conditioning_is_that_of_the_block_of_a_contact() -> None:
    blocks = sp.block_diag([np.diag([4.0, 1.0, 2.0]), np.eye(3), np.diag([1.0, 0.0, 1.0])])
    problem = ContactProblem.from_delassus(sp.csr_array(blocks), np.ones(9), 0.5)
    assert block_conditioning(problem).tolist() == [4.0, 1.0, np.inf]


def test_survey_describes_the_content_of_a_file(tmp_path: Path) -> None:
    crooked = W.copy()
    crooked[0, 1] = 0.3  # compared with 1.5, too much to be made symmetric
    stored = {"solution/r": IMPULSES, "guesses/number_of_guesses": np.array([2]), "fclib_local/info/title": b"stack"}
    local = survey(write_data(tmp_path / "l.hdf5", local_data(matrix=crooked), **stored))
    assert (local.form, local.title, local.contacts, local.rows, local.dofs) == ("G", "stack", 2, 6, None)
    assert (local.friction, local.guesses) == ((0.25, 0.5), 2)
    assert local.asymmetry == pytest.approx(0.2)
    factored = survey(write_data(tmp_path / "g.hdf5", global_data(), **{"solution/r": IMPULSES}))
    assert (factored.form, factored.dofs, factored.rank, factored.asymmetry) == ("factors", 6, 6, 0.0)
    assert (factored.solution, factored.guesses) == (0.0, 0)
    assert factored.conditioning == pytest.approx(1.0)


def test_a_survey_counts_the_laws(tmp_path: Path) -> None:
    jointed = survey(write_data(tmp_path / "j.hdf5", jointed_data()))
    assert (jointed.contacts, jointed.joints, jointed.rows, jointed.rank) == (2, 2, 8, 6)
    assert (jointed.rolling_friction, jointed.conditioning) == (None, pytest.approx(1.0))
    rolling = survey(write_data(tmp_path / "r.hdf5", rolling_data()))
    assert (rolling.contacts, rolling.joints, rolling.rows, rolling.rank) == (2, 1, 11, 10)
    assert (rolling.friction, rolling.rolling_friction) == ((0.5, 0.5), (0.125, 0.25))


def test_the_conditioning_of_a_contact_that_resists_rolling_does_not_depend_on_the_unit_of_length() -> None:
    laws = Laws.contacts(0.5, 3, 1).with_rolling(0.1, 2)
    for length in (1.0, 1e3):
        problem = in_units(ContactProblem.from_delassus(np.eye(5), np.ones(5), laws=laws), length=length).problem
        assert block_conditioning(problem) == pytest.approx([1.0])


def test_a_file_without_contacts_is_surveyed_and_its_problem_not_written(tmp_path: Path) -> None:
    nothing = {name: np.zeros(0, dtype=np.int32) for name in "ip"} | {"x": np.zeros(0)}
    empty = {name: np.array([0], dtype=np.int32) for name in ("nz", "nzmax", "m", "n")} | nothing
    data = {"fclib_local/spacedim": np.array([3]), **{f"fclib_local/W/{name}": value for name, value in empty.items()}}
    vectors = {"fclib_local/vectors/q": np.zeros(0), "fclib_local/vectors/mu": np.zeros(0)}
    found = survey(write_data(tmp_path / "e.hdf5", data | vectors))
    assert (found.contacts, found.rank, found.friction, found.conditioning) == (0, 0, (0.0, 0.0), 0.0)
    with pytest.raises(ProblemError, match="'e' has no contacts"):
        write_fclib(load(tmp_path / "e.hdf5"), tmp_path / "again.hdf5")


def test_the_files_of_a_folder_are_found_in_order(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    for name in ("b.hdf5", "a.h5", "c.npz", "e.txt", "deep/d.hdf5"):
        (tmp_path / name).touch()
    names = [str(file.relative_to(tmp_path)) for file in problem_files(tmp_path)]
    assert names == ["a.h5", "b.hdf5", "c.npz", "deep/d.hdf5"]
    assert list(problem_files(tmp_path / "a.h5")) == [tmp_path / "a.h5"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(ProblemError, match=r"no file in .*empty that ends in .hdf5\.$"):
        list(problem_files(tmp_path / "empty", (".hdf5",)))


def test_files_of_any_format_are_surveyed(tmp_path: Path) -> None:
    save_problem(load("funnel-30"), tmp_path / "funnel.json")
    factored = survey(tmp_path / "funnel.json")
    assert (factored.form, factored.rows, factored.title) == ("factors", load("funnel-30").n_rows, "")
    np.savez(tmp_path / "plain.npz", G=np.tril(np.ones((3, 3))), c=np.ones(3), mu=0.5)
    plain = survey(tmp_path / "plain.npz")
    assert (plain.form, plain.contacts, plain.asymmetry) == ("G", 1, 1.0)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_symmetric_matrix_that_is_not_finite_is_refused_and_not_replaced_by_zeros(
    value: float, tmp_path: Path
) -> None:
    delassus = np.eye(3)
    delassus[0, 1] = delassus[1, 0] = value
    np.savez(tmp_path / "p.npz", G=delassus, c=np.ones(3), mu=0.5)
    with pytest.raises(ProblemError, match=rf"p\.npz: G\[0, 1\] = {value} must be finite\.$"):
        survey(tmp_path / "p.npz")


def test_an_indefinite_file_is_refused_as_load_refuses_it(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", G=np.diag([1.0, 1.0, -1.0]), c=np.ones(3), mu=0.5)
    with pytest.raises(ProblemError) as loaded:
        load(tmp_path / "p.npz")
    with pytest.raises(ProblemError) as surveyed:
        survey(tmp_path / "p.npz")
    assert str(surveyed.value) == str(loaded.value)
    assert "its diagonal entry" in str(loaded.value)


def test_a_valid_matrix_that_is_too_large_to_project_is_surveyed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("proxbench.problems.exchange.repair.MAX_ROWS", 2)
    np.savez(tmp_path / "p.npz", G=np.eye(3), c=np.ones(3), mu=0.5)
    assert survey(tmp_path / "p.npz").rank == 3
