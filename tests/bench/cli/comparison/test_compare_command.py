"""``proxbench compare`` fails on the conditions of ``--fail-on``, and reports every mistake in one sentence."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from simulated_runs import simulated_cases, store_run


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str, str]:
    """A run, a second run of the same cases, and one in which A is slower."""
    folder = tmp_path_factory.mktemp("runs")
    factors = ({}, {}, {"A": 1.5})
    folders = [store_run(folder / f"run-{n}", simulated_cases(n, one)) for n, one in enumerate(factors)]
    return str(folders[0]), str(folders[1]), str(folders[2])


@pytest.mark.slow
def test_exit_code_is_1_if_a_condition_fails(runs: tuple[str, str, str], capsys: pytest.CaptureFixture[str]) -> None:
    conditions = ["--fail-on", "time>10%", "--fail-on", "solved<"]
    assert run_command(["compare", *runs[:2], *conditions]) == 0
    assert run_command(["compare", runs[0], runs[2]]) == 0
    assert "slower: A (1." in capsys.readouterr().out
    assert run_command(["compare", runs[0], runs[2], *conditions]) == 1
    assert capsys.readouterr().out.splitlines()[-1].startswith("FAILED time>10%: A (1.")
    assert run_command(["compare", runs[0], runs[2], "--fail-on", "time > 80 %", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_the_comparison_is_written_as_markdown_or_json(
    runs: tuple[str, str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.md"
    assert run_command(["compare", runs[0], runs[2], "--markdown", str(page), "--quiet"]) == 0
    assert capsys.readouterr().out == f"page     {page}\n"
    assert run_command(["compare", runs[0], runs[2], "--markdown", "-"]) == 0
    assert capsys.readouterr().out == page.read_text(encoding="utf-8")
    assert run_command(["compare", runs[0], runs[2], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"].startswith("slower: A")


@pytest.mark.slow
def test_usage_errors_are_one_sentence(runs: tuple[str, str, str], mistake: Callable[[str], str]) -> None:
    both = " ".join(runs[:2])
    for condition in ("time>ten%", "time<10%", "solved>", "speed", "time>10", ""):
        line = f"compare {both} --fail-on={condition}"
        assert "is not a condition; use 'time>10%'" in mistake(line)
    assert "is not a stored run" in mistake(f"compare {runs[0]} nothing")
    assert "cannot write" in mistake(f"compare {both} --markdown {runs[0]}/run.json/page.md")
    assert "--markdown - prints a page" in mistake(f"compare {both} --markdown - --json")
