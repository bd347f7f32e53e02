"""``--chart`` of ``proxbench simulate``, with a fixed step and with a variable one."""

from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.report.charts import drawing

pytestmark = pytest.mark.usefixtures("blank_pictures")

FIXED = "simulate pile(balls=5) --duration 0.01 --stepper Moreau(step=1e-3) --no-progress"
VARIABLE = "simulate woodpecker(start='cycle') --duration 0.005 --no-progress"
both = pytest.mark.parametrize("line", [FIXED, VARIABLE], ids=["fixed", "variable"])


@pytest.fixture
def broken_drawing(blank_pictures: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every drawing fail."""

    def fail(specification: str) -> str:
        raise ValueError("nothing\ncan be drawn")

    monkeypatch.setattr(drawing.vl_convert, "vegalite_to_svg", fail)


@both
@pytest.mark.parametrize("chart", ["", "..", "plain/a", "folder.png", "c.pdf"])
def test_a_chart_that_cannot_be_written_is_refused_before_the_simulation(
    line: str, chart: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("plain").write_text("")
    Path("folder.png").mkdir()
    assert run_command([*line.split(), "--force", "--chart", chart]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("proxbench: ")
    assert printed.err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"plain", "folder.png"}


@pytest.mark.slow
@both
@pytest.mark.parametrize("taken", ["mine.svg", "mine.png"])
def test_a_chart_that_exists_is_replaced_only_by_force(
    line: str, taken: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / taken).write_text("mine")
    arguments = [*line.split(), "--output", f"{tmp_path}/a.npz", "--chart", f"{tmp_path}/mine"]
    assert run_command(arguments) == 2
    assert f"{taken} exists already" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [taken]
    assert (tmp_path / taken).read_text() == "mine"
    assert run_command([*arguments, "--force"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"a.npz", "mine.svg", "mine.png"}
    assert (tmp_path / taken).read_bytes() != b"mine"


@pytest.mark.slow
def test_a_picture_beside_a_new_result_is_replaced_only_by_force(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "a.png").write_text("mine")
    arguments = [*VARIABLE.split(), "--output", f"{tmp_path}/a.npz"]
    assert run_command(arguments) == 2
    assert "a.png exists already" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert run_command([*arguments, "--force"]) == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_result_may_be_called_like_another_format(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_command([*VARIABLE.split(), "--output", f"{tmp_path}/a.pdf.npz"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"a.pdf.npz", "a.pdf.svg", "a.pdf.png"}


@pytest.mark.slow
@both
def test_a_resumed_simulation_replaces_no_chart_of_another_name(
    line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, other = tmp_path / "a.npz", tmp_path / "mine.svg"
    assert run_command([*line.split(), "--output", str(file)]) == 0
    other.write_text("mine")
    more = ["simulate", "--resume", str(file), "--duration", "0.02", "--no-progress", "--chart", str(other)]
    capsys.readouterr()
    before = file.read_bytes()
    assert run_command(more) == 2
    assert "mine.svg exists already" in capsys.readouterr().err
    assert file.read_bytes() == before
    assert run_command([*more, "--force"]) == 0
    assert "<svg" in other.read_text(encoding="utf-8")


@pytest.mark.slow
@both
@pytest.mark.usefixtures("broken_drawing")
def test_a_drawing_that_fails_comes_after_the_table_and_loses_nothing(
    line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, chart = tmp_path / "a.npz", tmp_path / "b.svg"
    assert run_command([*line.split(), "--output", str(file), "--chart", str(chart)]) == 2
    printed = capsys.readouterr()
    assert "total  " in printed.out
    assert f"result  {file}" in printed.out
    assert printed.err.count("\n") == 1
    assert f"{file} is kept, but its chart is missing: ValueError: nothing can be drawn" in printed.err
    monkeypatch.undo()
    assert run_command(["simulate", "--resume", str(file), "--no-progress", "--chart", str(chart)]) == 0
    assert chart.is_file()


@pytest.mark.usefixtures("broken_drawing")
def test_json_is_printed_before_a_drawing_fails(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = [*VARIABLE.split(), "--json", "--output", f"{tmp_path}/a.npz"]
    assert run_command(line) == 2
    assert capsys.readouterr().out.endswith("}\n")
