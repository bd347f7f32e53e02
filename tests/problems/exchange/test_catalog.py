"""Valid names give problems, invalid ones suggest the nearest name, and the frozen library is complete and small."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError, load, suite
from proxbench.problems.exchange.catalog import (
    FUNNEL_SIZES,
    MIXED_PILES,
    SUITES,
    cache_folder,
    is_available,
    is_shipped,
    problem_names,
    suite_members,
    suite_names,
)
from proxbench.problems.exchange.files.problem_file import save_problem
from proxbench.problems.hard import hard_case

LIBRARY = resources.files("proxbench.problems").joinpath("library")
FROZEN = {file.name.removesuffix(".npz"): file for file in LIBRARY.iterdir() if file.name.endswith(".npz")}


def test_only_bodies_and_sequences_are_generated_on_demand() -> None:
    assert {name for name in SUITES["all"] if not is_shipped(name)} < {*SUITES["bodies"], *SUITES["sequences"]}


def test_the_library_contains_only_suite_problems_and_keeps_its_size_limit() -> None:
    sizes = {name: len(file.read_bytes()) for name, file in FROZEN.items()}
    assert set(sizes) <= set(SUITES["all"])
    assert sum(sizes.values()) <= 6e6
    assert sum(sizes.get(name, 0) for name in SUITES["quick"]) <= 2e6


def test_suites_are_what_their_names_say() -> None:
    assert suite_names() == ["quick", "funnel", "piles", "woodpecker", "bodies", "sequences", "hard", "all"]
    assert len(suite("quick")) >= 8
    for size in FUNNEL_SIZES:
        for name in (f"funnel-{size}", f"funnel-planar-{size}", f"funnel-frictionless-{size}"):
            assert name in suite_members("funnel")
    widths = {name: load(name).layout.width for name in ("funnel-30", "funnel-planar-30", "funnel-frictionless-30")}
    assert list(widths.values()) == [3, 2, 1]


def test_mixed_piles_are_redundant_and_each_contact_has_a_friction_coefficient_of_its_own() -> None:
    assert set(MIXED_PILES) < set(suite_members("piles"))
    problems = [load(name) for name in MIXED_PILES]
    assert len({problem.digest for problem in problems}) == len(problems) == 10
    for problem in problems:
        assert problem.factors is not None
        assert problem.n_rows > problem.factors.n_dofs == 6 * 400
        friction = problem.layout.friction_coefficient
        assert len(set(friction)) == problem.n_contacts
        assert 0.1 <= friction.min() < 0.12
        assert 0.93 < friction.max() <= 0.95


def test_the_thousand_ball_funnel_has_about_seventeen_hundred_contacts() -> None:
    assert 1600 <= load("funnel-1000").n_contacts <= 1840


@pytest.mark.parametrize(
    ("call", "name", "nearest"),
    [(load, "funel-1000", "funnel-1000"), (load, "hard-grove", "hard-groove"), (suite, "quik", "quick")],
)
def test_an_unknown_name_is_answered_with_the_nearest(call: object, name: str, nearest: str) -> None:
    with pytest.raises(ProblemError, match=repr(nearest)):
        call(name)  # type: ignore[operator]


@pytest.mark.parametrize("name", ["../funnel-30", "/etc/passwd", "..", "a/b", "library/funnel-30"])
def test_names_cannot_leave_their_folder(name: str) -> None:
    with pytest.raises(ProblemError, match=r"there is no problem|is not a problem file|is a folder"):
        load(name)


def test_the_cache_folder_is_searched_and_can_be_moved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path
    assert not is_available("mine")
    save_problem(hard_case("hard-groove").renamed("mine"), tmp_path / "mine.npz")
    assert is_available("mine")
    assert "mine" in problem_names()
    assert load("mine").digest == hard_case("hard-groove").digest


def test_a_file_without_a_name_has_that_of_the_file(tmp_path: Path) -> None:
    problem = ContactProblem.from_delassus(np.eye(3), (-1.0, 0.5, 0.0), 0.3)
    for given, name in (("", "wall"), ("kept", "kept")):
        save_problem(problem.renamed(given) if given else problem, tmp_path / "wall.npz")
        assert load(tmp_path / "wall.npz").name == name
        assert load(tmp_path / "wall.npz").digest == problem.digest


def test_damaged_file_in_the_cache_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path))
    (tmp_path / "mine.npz").write_bytes(b"no file")
    with pytest.raises(ProblemError, match="damaged"):
        load("mine")


@pytest.mark.parametrize("given", [np.eye(3), None, 5])
def test_an_argument_that_is_neither_name_nor_path_is_refused(given: object) -> None:
    with pytest.raises(ProblemError, match="load takes the name of a problem or the path of a file, not "):
        load(given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("g.npy", r"g\.npy is not a problem file, whose name ends in \.npz, \.json, \.hdf5 or \.h5; write one with "),
        (Path("g.npy"), r"g\.npy is damaged or not a problem file: it is not an \.npz archive, or it is cut off; "),
        ("folder", "folder is a folder, not a problem file; name a file in it"),
        (Path("folder"), "folder is a folder, not a problem file; name a file in it"),
        ("./none", r"there is no problem or file '\./none'; name a problem, or a file that exists"),
    ],
)
def test_a_path_that_is_not_a_problem_file_is_refused_as_such(
    given: str | Path, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    np.save("g.npy", np.eye(3))
    Path("folder").mkdir()
    with pytest.raises(ProblemError, match=f"^{sentence}"):
        load(given)
