"""``report --page`` and ``--baseline`` write one page and print its path, or print one sentence and write nothing."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.problems import load
from simulated_runs import store_run
from stored_cases import solved_case

REFERENCE = Path(__file__).parents[3] / "results/reference.bundle"


@pytest.fixture
def copied(tmp_path: Path, finished_run: Path) -> Path:
    """Return a copy of a run, to which the test may write."""
    (tmp_path / "cases").mkdir()
    for file in (finished_run / "run.json", *finished_run.glob("cases/*.json")):
        (tmp_path / file.relative_to(finished_run)).write_bytes(file.read_bytes())
    return tmp_path


@pytest.mark.slow
def test_the_page_of_a_run_is_written_and_nothing_else(copied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["report", str(copied), "--page"]) == 1  # the run has faults
    assert capsys.readouterr().out == f"page     {copied / 'report.html'}\n"
    assert {file.name for file in copied.iterdir()} == {"run.json", "cases", "report.html"}
    assert run_command(["report", str(copied), "--page", "--json", "--residual", "local"]) == 1
    assert json.loads(capsys.readouterr().out)["page"] == str(copied / "local/report.html")


@pytest.mark.weekly
def test_charts_and_page_take_the_baseline_that_is_named(copied: Path) -> None:
    assert run_command(["report", str(copied), "--quiet", "--baseline", "SORprox"]) == 1
    lines = (copied / "charts/profile-speedup.csv").read_text().splitlines()
    assert lines[0] == "accuracy,family,solver,problem,speedup,baseline"
    assert {line.rsplit(",", 1)[1] for line in lines[1:]} == {"SORprox"}


@pytest.mark.slow
@pytest.mark.parametrize("switch", ["--page", "--quiet"])
def test_an_unknown_baseline_is_refused_with_the_nearest_name(switch: str, mistake: Callable[[str], str]) -> None:
    assert "did you mean 'NSGS'?" in mistake(f"report {REFERENCE} {switch} --baseline NSG")


@pytest.fixture
def faultless(tmp_path: Path) -> Path:
    """Return a run in which each solver solves each problem, in invented times."""
    problems = [load(name) for name in ("funnel-30", "hard-groove")]
    cases = [solved_case(problem, name, [1e-2, 1e-4]) for problem in problems for name in ("NSGS", "Robust", "SORprox")]
    return store_run(tmp_path / "run", cases)


@pytest.mark.parametrize("options", [pytest.param(["--no-charts"], marks=pytest.mark.slow), ["--problem", "funnel-30"]])
def test_a_damaged_case_gives_exit_code_1_after_the_tables_of_the_others(
    options: list[str], faultless: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["report", str(faultless), *options]) == 0
    capsys.readouterr()
    file = next(faultless.glob("cases/funnel-30--SORprox.json"))
    file.write_bytes(file.read_bytes()[:-40])
    assert run_command(["report", str(faultless), *options]) == 1
    printed = capsys.readouterr()
    assert "funnel-30" in printed.out
    assert f"proxbench: {file.name} is damaged (" in printed.err


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        ["--no-charts"],
        ["--problem", "funnel-30"],
        pytest.param(["--problem", "funnel-30", "--json"], marks=pytest.mark.slow),
        pytest.param(["--json", "--no-charts"], marks=pytest.mark.slow),
        pytest.param(["--quiet", "--no-charts"], marks=pytest.mark.slow),
    ],
)
def test_a_deleted_case_gives_exit_code_1_and_is_named(
    options: list[str], faultless: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    next(faultless.glob("cases/funnel-30--SORprox.json")).unlink()
    assert run_command(["report", str(faultless), *options]) == 1
    printed = capsys.readouterr()
    shown = printed.err if {"--json", "--quiet"} & set(options) else printed.out
    sentence = f"measured; missing: SORprox on funnel-30; resume with: proxbench run --resume {faultless}"
    assert sentence in " ".join(shown.split())


@pytest.mark.parametrize(
    "options", [["--no-charts"], ["--page"], ["--problem", "funnel-30"], ["--quiet", "--no-charts"]]
)
def test_a_run_of_damaged_cases_is_refused_by_their_names(
    options: list[str], faultless: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = sorted(faultless.glob("cases/*.json"))
    for file in files:
        file.write_bytes(b"{}")
    assert run_command(["report", str(faultless), *options]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(
        f"proxbench: no case of {faultless} can be used (damaged or not planned: {files[0].name}, "
    )
    assert f" and {len(files) - 5} more); " in printed.err
    assert printed.err.count("\n") == 1


def test_profiles_over_unknown_problems_are_refused(mistake: Callable[[str], str]) -> None:
    assert "did you mean 'common'?" in mistake(f"report {REFERENCE} --profiles comon")


@pytest.mark.slow
def test_a_run_without_cases_has_no_page(
    finished_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.json").write_bytes((finished_run / "run.json").read_bytes())
    for options in (["--page"], ["--baseline", "NSGS"]):
        assert run_command(["report", str(tmp_path), *options]) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err.startswith("proxbench: ")
        assert printed.err.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["run.json"]


@pytest.mark.parametrize(
    "options",
    [
        "--page --profiles all",
        "--no-charts --profiles all",
        "--page --problem funnel-100",
        "--page --no-charts",
        "--page --quiet --json",
        "--baseline NSGS --problem x",
    ],
)
def test_options_that_exclude_each_other_are_refused(options: str, mistake: Callable[[str], str]) -> None:
    sentence = mistake(f"report {REFERENCE} {options}")
    assert "; omit --" in sentence or "are mutually exclusive" in sentence


@pytest.mark.parametrize("switch", ["--page", "--baseline NSGS"])
def test_simulations_have_neither_page_nor_baseline(switch: str, mistake: Callable[[str], str]) -> None:
    assert "applies to runs, but pour.npz is a simulation" in mistake(f"report pour.npz {switch}")
