"""The listing is readable for any number of contacts, rows and laws, and fits a narrow terminal."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest
from proxbench.bench.cli.listing import listing_rows, print_listing
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.problems.exchange.catalog import SUITES, suite_members
from proxbench.problems.motion.scenes.registry import SCENES
from proxbench.solvers.registry import parts


@pytest.fixture(autouse=True)
def _narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")


@pytest.fixture(scope="module")
def hard() -> list[dict[str, Any]]:
    """Every problem of the hard suite, as listed."""
    return listing_rows("problems", "hard")["problems"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("hard-empty", "0 0 none factors"),
        ("hard-one-row-closed", "1 1 none Delassus"),
        ("hard-counterexample", "1 2 planar Delassus"),
        ("hard-mixed-laws-84", "84 156 planar, spatial Delassus"),
    ],
)
def test_a_problem_is_described_by_its_sizes_friction_and_form(
    name: str, words: str, hard: list[dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [row for row in hard if row["name"] == name]
    print_listing({"problems": rows})
    head, line = (line for line in capsys.readouterr().out.splitlines() if line.startswith("  "))
    assert head.split() == ["contacts", "rows", "friction", "form"]
    assert line.split() == [name, *words.split()]
    assert line.index(words.split()[-1]) == head.index("form")  # in the column of this heading


@pytest.mark.slow
@pytest.mark.parametrize("what", ["solvers", "suites", "problems", "scenes", ""])
def test_every_listing_fits_eighty_columns(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    print_listing(listing_rows(what))
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "name", "words"),
    [
        ("solvers", "SORprox", "relaxation=1.0"),
        ("solvers", "SORprox(relaxation=1.5)", "relaxation=1.0"),
        ("scenes", "funnel", "balls=1000"),
        ("suites", "quick", "problems: "),
        ("problems", "hard-groove", "planar"),
    ],
)
def test_a_name_is_listed_alone(what: str, name: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["list", what, name]) == 0
    text = capsys.readouterr().out
    assert words in text
    (row,) = listing_rows(what, name=name)[what]
    assert [row] == [one for one in listing_rows(what)[what] if one["name"] == name.partition("(")[0]]


def test_a_name_without_a_kind_is_listed_under_each_kind_that_has_it() -> None:
    both = listing_rows("suites", name="funnel") | listing_rows("scenes", name="funnel")
    assert listing_rows(name="funnel", has_sizes=False) == both
    sentence = "there is no 'funel' among the solvers, suites, scenes and problems; did you mean 'funnel'?"
    with pytest.raises(BenchError, match=re.escape(sentence)):
        listing_rows(name="funel", has_sizes=False)


def test_a_single_solver_is_listed_with_its_summary_and_the_meaning_of_each_option(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run_command(["list", "solvers", "NSGS"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Nonsmooth (block) Gauss–Seidel: " in text
    assert " options relaxation=1.0 ω" in text
    assert "`" not in text


def test_listed_names_are_not_wrapped_without_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("COLUMNS")
    monkeypatch.setattr(sys, "__stdout__", None)  # as into a pipe, even if the tests run in a terminal
    listed = listing_rows("scenes")
    print_listing(listed)
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert len(rows) == len(listed["scenes"]) >= len(SCENES)


def test_suites_are_counted_with_a_few_of_their_members(capsys: pytest.CaptureFixture[str]) -> None:
    print_listing(listing_rows("suites"))
    text = capsys.readouterr().out
    assert len(text.splitlines()) <= 25
    for name, members in SUITES.items():
        entry = re.search(rf"^  {name} +(.*\n(?:   +.*\n)*)", text, re.MULTILINE)
        assert entry is not None
        count, _, shown = " ".join(entry[1].split()).partition(" problems: ")
        assert int(count) == len(members)
        assert {name.strip() for name in shown.split(",")} - {"…"} <= set(members)


def test_a_problem_that_is_not_generated_yet_says_so_and_how_it_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path))
    print_listing(listing_rows("problems", "bodies"))
    lines = capsys.readouterr().out.splitlines()
    assert "  bodies-pile-1000            not generated yet" in lines
    assert "proxbench generate NAME" in lines[-2]
    assert max(map(len, lines)) <= 80
    print_listing(listing_rows("problems", "woodpecker"))
    assert "not generated yet" not in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("suite", SUITES)
def test_the_problems_of_a_suite_are_its_members_under_the_names_of_their_families(
    suite: str, capsys: pytest.CaptureFixture[str]
) -> None:
    print_listing(listing_rows("problems", suite))
    lines = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines if line.startswith("  ")]
    assert names[0] == "contacts"  # the headings
    assert sorted(names[1:]) == sorted(suite_members(suite))
    sizes = [int(line.partition("(")[2].rstrip(")")) for line in lines if re.fullmatch(r"\S.* \(\d+\)", line)]
    assert sum(sizes) == len(suite_members(suite))


def test_parts_of_robust_are_listed_separately(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["list", "solvers"]) == 0
    first, second = capsys.readouterr().out.split("parts of Robust\n")
    for name in parts():
        assert f"  {name} " not in first
        assert f"  {name} " in second
    assert "  SORprox " in first
