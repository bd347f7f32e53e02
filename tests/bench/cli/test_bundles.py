"""Commands pack, rejudge and merge runs, and report each mistake in one sentence."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace
from proxbench.bench import load
from proxbench.bench.cli.main import run_command
from proxbench.bench.store.store import Store

PROBLEMS = ["hard-groove", "funnel-30", "hard-counterexample"]


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two shards of a run."""
    folder = tmp_path_factory.mktemp("shards")
    for number in (1, 2):
        line = "run --solver NSGS --tolerance 1e-3 --passes 1 --no-charts --quiet"
        words = [*line.split(), *(word for name in PROBLEMS for word in ("--problem", name))]
        assert run_command([*words, "--shard", f"{number}/2", "--output", str(folder), "--run-id", f"{number}"]) == 0
    return folder


@pytest.mark.slow
def test_bundled_shards_merge_into_one_run(
    shards: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for number in (1, 2):
        assert run_command(["bundle", str(shards / f"{number}")]) == 0
        assert run_command(["rejudge", f"{number}.bundle"]) == 0
    printed = capsys.readouterr().out
    assert "packed  1.bundle" in printed
    assert "2 of 2 cases judged again: 4 residuals, all bit-identical; no case disagrees" in printed
    assert run_command(["merge", "1.bundle", "2.bundle", "--run-id", "whole", "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == {"run": "results/whole", "is_finished": True, "missing": []}
    assert printed.err == ""
    assert load("results/whole").info.plan.problems == PROBLEMS
    assert run_command(["report", "results/whole", "--no-charts"]) == 0


@pytest.mark.slow
def test_merge_reports_a_missing_shard_and_combines_the_rest(
    shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["merge", str(shards / "2"), "--output", str(tmp_path), "--run-id", "half"]) == 0
    printed = capsys.readouterr()
    assert "1 of 1 cases" in printed.out
    assert "proxbench: shard 1/2 is missing." in printed.err


@pytest.mark.slow
def test_rejudge_names_a_false_case_and_exits_with_1(
    shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = Path(shutil.copytree(shards / "2", tmp_path / "lie"))
    store = Store(folder)
    (case,), _ = store.read_cases()
    (point,) = case.points
    measured = point.measured
    assert measured is not None
    (kept,) = measured.impulses
    kept = replace(kept, residual=0.0, model_residual=0.0)
    verdict = {**measured.verdict, "residual": 0.0}
    lie = replace(measured, residual=0.0, model_residual=0.0, verdict=verdict, impulses=[kept])
    store.write_case(replace(case, points=[replace(point, measured=lie)]))
    assert run_command(["bundle", str(folder), "--output", str(tmp_path / "lie.bundle")]) == 0
    capsys.readouterr()
    for options, is_quiet in (([], False), (["--quiet"], True)):
        assert run_command(["rejudge", str(tmp_path / "lie.bundle"), *options]) == 1
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].startswith("NSGS on funnel-30: the bundle reports residual 0.0")
        assert len(lines) == (1 if is_quiet else 2)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("bundle nowhere", "is not a stored run"),
        ("rejudge nowhere.bundle", "there is no bundle nowhere.bundle"),
        ("merge nowhere.bundle", "there is no bundle nowhere.bundle"),
        ("rejudge x --quiet --json", "are mutually exclusive"),
        ("run --shard 3/2", "--shard must be i/n"),
        ("run --resume x --shard 1/2", "--shard is stored with the run"),
    ],
)
def test_errors_are_reported_in_one_sentence(line: str, reason: str, mistake: Callable[[str], str]) -> None:
    assert reason in mistake(line)
