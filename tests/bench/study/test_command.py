"""``proxbench simulate --study``: mistakes get one sentence, and a study leaves its table, points and chart."""

import csv
import json
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.report import drawing
from proxbench.bench.study.plan import StudyPlan
from proxbench.bench.study.running import run_study
from proxbench.bench.study.study import Study, read_study

from .conftest import fixed_case, toy_case, toy_plan


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--study", "name a scene"),
        ("funel --study", "'funnel'"),
        ("woodpecker(gravity=1) --study", "leave gravity out"),
        ("woodpecker --study --stepper Moreau(step=1e-4)", "--stepper"),
        ("woodpecker --study --stepper Moreau", "--stepper"),
        ("funnel --study --tolerance 1e-4", "--tolerance"),
        ("funnel(balls=0) --study", "balls"),
        ("funnel --study --duration 1e-9", "step of Moreau"),
        ("funnel --study --record a.rrd", "--record"),
        ("funnel --study --step-seconds 3", "leave --step-seconds out"),
        ("funnel --study --solver SORprx", "'SORprox'"),
        ("--study --resume nowhere.npz", "holds no study"),
        ("--resume nowhere.json", "there is no study nowhere.json"),
        ("--resume nowhere.json --duration 3", "--duration"),
    ],
)
def test_a_mistake_gets_one_sentence_and_leaves_no_file(
    line: str, words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(["simulate", *line.split()]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("proxbench: ")
    assert printed.err.count("\n") == 1
    assert words in printed.err
    assert list(tmp_path.iterdir()) == []


def test_a_study_of_the_woodpecker_prints_stores_and_draws_its_points(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "study.json"
    Study(toy_plan(fixed_case(100, members=(0.99, 1.0)), toy_case()), file).store()
    assert run_command(["simulate", "woodpecker", "--resume", str(file), "--no-progress"]) == 0
    printed = capsys.readouterr().out
    assert "woodpecker · 0.145976 s · 3 of 3 simulations" in printed
    assert "Extrapolated" in printed
    assert {path.name for path in tmp_path.iterdir()} == {"study.json", "study.csv", "study.svg", "study.png"}
    with (tmp_path / "study.csv").open(encoding="utf-8", newline="") as opened:
        rows = list(csv.DictReader(opened))
    assert [row["series"] for row in rows] == ["fixed", "Extrapolated"]
    assert float(rows[1]["error"]) < float(rows[0]["error"])
    assert "one-step solves" in (tmp_path / "study.svg").read_text(encoding="utf-8")
    for drawn in ("study.csv", "study.svg", "study.png"):
        (tmp_path / drawn).unlink()
    assert run_command(["report", str(file)]) == 0
    assert capsys.readouterr().out == printed
    assert {path.name for path in tmp_path.iterdir()} == {"study.json", "study.csv", "study.svg", "study.png"}
    for drawn in ("study.svg", "study.png"):
        (tmp_path / drawn).unlink()
    assert run_command(["report", str(file), "--quiet", "--no-charts"]) == 0
    assert capsys.readouterr().out == f"result  {file}\npoints  {tmp_path / 'study.csv'}\n"
    assert not (tmp_path / "study.svg").exists()


def test_a_report_of_no_study_is_one_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text("{}")
    for name in ("none.json", "other.json"):
        assert run_command(["report", str(tmp_path / name)]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"other.json"}


def test_a_finished_study_of_a_pour_is_shown_again_as_json(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, pour_plan: StudyPlan
) -> None:
    file = tmp_path / "study.json"
    run_study(pour_plan, file)
    assert run_command(["simulate", "--resume", str(file), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["finished"]
    assert {point["quantity"] for point in document["points"]} >= {"mean height", "energy lost"}
    assert set(document["reference"]) == {"flow rate", "mean height", "energy lost"}
    assert (tmp_path / "study.png").is_file()


def test_an_output_that_exists_is_not_replaced(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "study.json"
    file.write_text("mine")
    assert run_command(["simulate", "woodpecker", "--study", "--output", str(file)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert file.read_text() == "mine"


def little_study(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the command line plan a study of one short simulation."""
    plan = toy_plan(fixed_case(50))
    monkeypatch.setattr("proxbench.bench.cli.study.make_study_plan", lambda *args, **numbers: plan)


@pytest.mark.parametrize("chart", ["", "plain/a"])
def test_a_chart_that_cannot_be_written_is_refused_before_the_study(
    chart: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    little_study(monkeypatch)
    monkeypatch.chdir(tmp_path)
    Path("plain").write_text("")
    assert run_command(["simulate", "woodpecker", "--study", "--chart", chart]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["plain"]


@pytest.mark.parametrize("taken", ["study.csv", "study.svg", "study.png"])
def test_what_lies_beside_a_new_study_is_replaced_only_by_force(
    taken: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    little_study(monkeypatch)
    (tmp_path / taken).write_text("mine")
    line = ["simulate", "woodpecker", "--study", "--no-progress", "--output", f"{tmp_path}/study.json"]
    assert run_command(line) == 2
    assert f"{taken} exists already" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [taken]
    assert run_command([*line, "--force"]) == 0
    assert (tmp_path / taken).read_bytes() != b"mine"


def test_a_resumed_study_replaces_no_chart_of_another_name(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, other = tmp_path / "study.json", tmp_path / "mine.svg"
    Study(toy_plan(fixed_case(50)), file).store()
    other.write_text("mine")
    line = ["simulate", "--resume", str(file), "--no-progress", "--chart", str(other)]
    assert run_command(line) == 2
    assert "mine.svg exists already" in capsys.readouterr().err
    assert not read_study(file).measured
    assert run_command([*line, "--force"]) == 0
    assert "<svg" in other.read_text(encoding="utf-8")


def test_a_drawing_that_fails_comes_after_the_table_and_the_points(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(specification: str) -> str:
        raise ValueError("nothing can be drawn")

    little_study(monkeypatch)
    monkeypatch.setattr(drawing.vl_convert, "vegalite_to_svg", fail)
    file = tmp_path / "study.json"
    assert run_command(["simulate", "woodpecker", "--study", "--no-progress", "--output", str(file)]) == 2
    printed = capsys.readouterr()
    assert f"result  {file}\npoints  {tmp_path}/study.csv" in printed.out
    assert "its chart is missing: ValueError: nothing can be drawn" in printed.err
    assert printed.err.count("\n") == 1
    assert read_study(file).is_finished
