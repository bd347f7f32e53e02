"""FCLIB files: every storage gives the same problem, files are read back bit by bit, and errors get one sentence."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from handmade_fclib import IMPULSES, MU, F, H, M, Q, W, local_data, matrix_data, write_as_siconos, write_data
from proxbench.problems import ContactProblem, Laws, ProblemError, judge, load, read_fclib, save_problem, write_fclib
from proxbench.problems.exchange.fclib.contents import DIGEST
from proxbench.problems.exchange.survey import survey
from proxbench.problems.hard import hard_case

SHIPPED = Path(__file__).parent / "files"


@pytest.mark.parametrize("form", ["local", "global"])
def test_every_storage_is_the_same_problem_with_the_known_solution(form: str) -> None:
    problems = [read_fclib(path) for path in sorted(SHIPPED.glob(f"{form}-*.hdf5"))]
    assert len(problems) == {"local": 4, "global": 3}[form]
    assert len({problem.digest for problem in problems}) == 1
    for problem in problems:
        assert judge(problem, IMPULSES).residual == 0.0
        assert np.array_equal(problem.laws.friction_coefficient[1::2], MU)
        assert np.array_equal(problem.free_velocity, Q)
        assert np.abs(problem.delassus().toarray() - W).max() < 1e-15


@pytest.mark.parametrize("form", ["local", "global"])
def test_a_file_with_the_structure_of_public_ones_is_the_same_problem(form: str, tmp_path: Path) -> None:
    """The public library states no licence, so the tests contain none of its files."""
    problem = read_fclib(write_as_siconos(tmp_path / "public.hdf5", form))
    assert problem.digest == read_fclib(SHIPPED / f"{form}-rows.hdf5").digest
    assert problem.provenance["title"] == "Box_stacks"
    assert problem.answer is None
    found = survey(tmp_path / "public.hdf5")
    assert (found.guesses, found.solution, found.contacts) == (1, None, 2)


def test_a_global_problem_becomes_factors_and_a_local_one_a_delassus_matrix() -> None:
    local, factored = read_fclib(SHIPPED / "local-rows.hdf5"), read_fclib(SHIPPED / "global-rows.hdf5")
    assert local.factors is None
    assert local.matrix is not None
    assert factored.matrix is None
    assert factored.factors is not None
    assert np.array_equal(factored.factors.force_directions.toarray(), H)
    assert np.array_equal(factored.factors.inverse_mass.matrix.toarray(), np.linalg.inv(M))
    assert np.array_equal(factored.factors.free_motion, np.linalg.inv(M) @ F)  # type: ignore[arg-type]


def test_an_exported_file_of_an_earlier_version_is_read() -> None:
    problem = read_fclib(SHIPPED / "sticking-box.hdf5")  # reading compares the digest
    known = hard_case("hard-sticking-box")
    assert problem.name == "sticking-box"
    assert np.abs((problem.delassus() - known.delassus()).toarray()).max() < 1e-12
    assert np.abs(problem.free_velocity - known.free_velocity).max() < 1e-12


def test_a_planar_problem_has_two_rows_a_contact(tmp_path: Path) -> None:
    planar = W[:4, :4]
    data = {**local_data(matrix=planar), "fclib_local/spacedim": np.array([2]), "fclib_local/vectors/q": Q[:4]}
    problem = read_fclib(write_data(tmp_path / "p.hdf5", data))
    assert (problem.n_contacts, problem.n_rows, problem.layout.width) == (2, 4, 2)
    write_fclib(problem, tmp_path / "again.hdf5")
    assert read_fclib(tmp_path / "again.hdf5").digest == problem.digest


@pytest.mark.parametrize(
    "name", ["hard-sticking-box", "hard-counterexample", "funnel-100", "funnel-planar-30", "pile-300"]
)
def test_a_problem_of_ours_comes_back_with_the_same_digest(name: str, tmp_path: Path) -> None:
    problem = load(name)
    write_fclib(problem, tmp_path / "new" / f"{name}.hdf5")
    again = load(tmp_path / "new" / f"{name}.hdf5")
    assert (again.name, again.digest) == (name, problem.digest)
    if problem.factors is not None and problem.factors.free_motion is not None:
        assert again.factors is not None
        assert again.factors.free_motion == pytest.approx(problem.factors.free_motion, rel=1e-14)


def test_a_file_written_again_has_every_bit_of_its_arrays(tmp_path: Path) -> None:
    """The copy goes through a problem file, with full inertias; inverting these twice changes bits.

    c is between half and twice the part that f adds, whatever its last bits, so their difference has no rounding.
    """
    rng = np.random.default_rng(4)
    half = rng.normal(size=(6, 6))
    mass = np.block([[half @ half.T + np.eye(6), np.zeros((6, 3))], [np.zeros((3, 6)), np.diag(rng.uniform(1, 2, 3))]])
    directions, f = rng.normal(size=(9, 6)), rng.normal(size=9)
    w = 0.25 * directions.T @ np.linalg.solve(mass, f)
    data = {
        "fclib_global/spacedim": np.array([3]),
        **{f"fclib_global/M/{name}": value for name, value in matrix_data(mass, "columns").items()},
        **{f"fclib_global/H/{name}": value for name, value in matrix_data(directions, "rows").items()},
        "fclib_global/vectors/f": f,
        "fclib_global/vectors/w": w,
        "fclib_global/vectors/mu": rng.uniform(size=2),
    }
    first = read_fclib(write_data(tmp_path / "first.hdf5", data))
    save_problem(first, tmp_path / "problem.npz")
    write_fclib(load(tmp_path / "problem.npz"), tmp_path / "second.hdf5")
    second = read_fclib(tmp_path / "second.hdf5")
    assert second.digest == first.digest
    with h5py.File(tmp_path / "second.hdf5") as file:
        root = file["fclib_global"]
        for label, matrix in (("M", mass), ("H", directions)):
            stored = root[label]
            entries = (stored["x"][:], (stored["i"][:], stored["p"][:]))
            assert np.array_equal(sp.coo_array(entries, shape=matrix.shape).toarray(), matrix)
        assert np.array_equal(root["vectors/mu"], data["fclib_global/vectors/mu"])
        assert np.abs(root["vectors/f"] - data["fclib_global/vectors/f"]).max() < 1e-13
        assert np.abs(root["vectors/w"] - w).max() < 1e-13
        assert bytes(root[f"info/{DIGEST}"][()]).decode() == first.digest


def test_a_free_motion_that_would_cost_bits_of_c_is_left_out(tmp_path: Path) -> None:
    c = np.array([1e-20, 0.0, 0.0])  # no sum of 1/3 and another double
    problem = ContactProblem.from_factors(np.eye(3), np.ones(3), c, 0.5, free_motion=[1 / 3, 0.0, 0.0])
    write_fclib(problem, tmp_path / "p.hdf5")
    again = read_fclib(tmp_path / "p.hdf5")
    assert again.digest == problem.digest
    assert again.factors is not None
    assert again.factors.free_motion is None


def test_a_mass_that_is_not_known_is_the_inverse_to_rounding(tmp_path: Path) -> None:
    problem = load("woodpecker-beak-impact")
    write_fclib(problem, tmp_path / "p.hdf5")
    again = read_fclib(tmp_path / "p.hdf5")
    scale = abs(problem.delassus()).max()
    assert abs(again.delassus() - problem.delassus()).max() < 1e-10 * scale
    with h5py.File(tmp_path / "p.hdf5") as file:
        assert (DIGEST in file["fclib_global/info"]) == (again.digest == problem.digest)


def test_the_same_problem_gives_the_same_bytes_in_a_format_that_old_libraries_read(tmp_path: Path) -> None:
    problem = load("hard-sticking-box")
    for name in ("a.hdf5", "b.h5"):
        write_fclib(problem, tmp_path / name)
    content = (tmp_path / "a.hdf5").read_bytes()
    assert content == (tmp_path / "b.h5").read_bytes()
    assert content[:9] == b"\x89HDF\r\n\x1a\n\x00"  # version 0 of the superblock
    with h5py.File(tmp_path / "a.hdf5") as file:
        arrays: list[h5py.Dataset] = []
        file.visititems(lambda _, item: arrays.append(item) if isinstance(item, h5py.Dataset) else None)
        assert all(array.chunks is None and array.compression is None for array in arrays)
        types = {array.dtype for array in arrays if array.dtype.kind != "S"}
        assert types == {np.dtype("<i4"), np.dtype("<f8")}
        title = file["fclib_global/info/title"]
        assert title.dtype.itemsize == len(problem.name) + 1  # C expects a terminating zero


@pytest.mark.parametrize("form", ["local", "global"])
def test_a_solution_is_stored_with_its_velocities_and_confirmed_by_the_judge(form: str, tmp_path: Path) -> None:
    path = tmp_path / "solved.hdf5"
    write_fclib(read_fclib(SHIPPED / f"{form}-rows.hdf5"), path, IMPULSES)
    with h5py.File(path) as file:
        assert np.array_equal(file["solution/r"], IMPULSES)
        assert np.array_equal(file["solution/u"], np.zeros(6))
        if form == "global":
            assert np.array_equal(file["solution/v"], np.linalg.inv(M) @ (F + H @ IMPULSES))
    problem = read_fclib(path)
    assert problem.answer is not None
    assert np.array_equal(problem.answer.witness, IMPULSES)  # type: ignore[arg-type]
    assert problem.provenance["stored_solution_residual"] == 0.0
    write_fclib(problem, tmp_path / "again.hdf5")
    assert (tmp_path / "again.hdf5").read_bytes().count(IMPULSES.tobytes()) == 1


def test_a_stored_solution_that_does_not_solve_the_problem_is_ignored(tmp_path: Path) -> None:
    zeros = write_data(tmp_path / "zeros.hdf5", local_data(), **{"solution/r": np.zeros(6)})
    assert read_fclib(zeros).answer is None
    wrong = read_fclib(write_data(tmp_path / "wrong.hdf5", local_data(), **{"solution/r": 0.5 * IMPULSES}))
    assert wrong.answer is None
    assert float(wrong.provenance["stored_solution_residual"]) > 0.1
    with h5py.File(zeros, "a") as file:
        del file["solution/r"]
        file["solution"].create_dataset("r", (6,), np.float64)  # reserved and never written, as in public files
    assert read_fclib(zeros).answer is None
    not_finite = {"solution/r": np.full(6, np.nan)}
    assert read_fclib(write_data(tmp_path / "nan.hdf5", local_data(), **not_finite)).answer is None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fclib_local/spacedim": np.array([4])}, r"spacedim = 4 must be 2 or 3"),
        ({"fclib_local/spacedim": np.array([2])}, "imply 2 contacts of 2 rows each"),
        ({"fclib_local/spacedim": None}, "spacedim is missing"),
        ({"fclib_local/vectors/mu": np.array([0.5, -0.1])}, r"friction\[1\] = -0.1"),
        ({"fclib_local/vectors/mu": np.array([0.5])}, "1 contacts of 3 rows"),
        ({"fclib_local/vectors/q": np.append(Q[:5], np.nan)}, r"c\[5\] = nan must be finite"),
        ({"fclib_local/vectors/q": Q[:3]}, r"must have shape \(3, 3\)"),
        ({"fclib_local/W/x": np.full(12, np.inf)}, r"G\[0, 0\] = inf must be finite"),
        ({"fclib_local/W/m": np.array([2**31 - 1])}, "must have shape"),
        ({"fclib_global/spacedim": np.array([3])}, "it contains several problems"),
        ({"solution/r": np.zeros(5)}, "solution/r must have 6 entries, got 5"),
    ],
)
def test_unsupported_or_inconsistent_content_is_refused_in_one_sentence(
    changes: dict[str, Any], words: str, tmp_path: Path
) -> None:
    path = write_data(tmp_path / "p.hdf5", local_data(), **changes)
    with pytest.raises(ProblemError, match=words) as caught:
        load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("funnel-frictionless-30", "has no friction"),
        ("hard-tresca-joint", "has a fixed friction bound"),
        ("hard-remote-partner", "mixes laws"),
        ("hard-linked-1-axes", "1 axis, but FCLIB supports only as many axes as sliding directions, here 2"),
        ("hard-linked-3-axes", "has rolling friction about 3 axes"),
    ],
)
def test_laws_that_fclib_does_not_have_are_refused_and_nothing_is_written(
    name: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(ProblemError, match=words):
        write_fclib(load(name), tmp_path / "p.hdf5")
    assert list(tmp_path.iterdir()) == []


def test_a_mixture_of_planar_and_spatial_contacts_is_refused(tmp_path: Path) -> None:
    laws = Laws.in_order([0, 1, 0, 2], np.array([0.0, 0.5, 0.0, 0.5]), np.zeros(4), np.array([-1, 0, -1, 2]))
    mixed = ContactProblem.from_delassus(np.eye(5), np.ones(5), laws=laws)
    with pytest.raises(ProblemError, match="mixes laws"):
        write_fclib(mixed, tmp_path / "p.hdf5")


def test_a_failed_write_leaves_the_old_file_and_no_stray_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "p.hdf5"
    write_fclib(load("hard-sticking-box"), path)
    before = path.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(ProblemError, match="No space left"):
        write_fclib(load("hard-counterexample"), path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_wrong_extensions_missing_files_and_invalid_impulses_are_refused(tmp_path: Path) -> None:
    problem = load("hard-sticking-box")
    with pytest.raises(ProblemError, match=r"name it p\.hdf5"):
        write_fclib(problem, tmp_path / "p.npz")
    with pytest.raises(ProblemError, match="there is no problem file"):
        load(str(tmp_path / "none.hdf5"))
    for wrong in (np.zeros(3), np.full(12, np.nan)):
        with pytest.raises(ProblemError, match="impulses must be 12 finite numbers"):
            write_fclib(problem, tmp_path / "p.hdf5", wrong)
    assert list(tmp_path.iterdir()) == []
