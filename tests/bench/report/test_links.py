"""No result is written through a link out of its folder, and results that cannot be written are still printed."""

import os
import shutil
from pathlib import Path

import pytest
from proxbench import bench
from proxbench.bench import load
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.report.layout.output_file import write_file

pytestmark = pytest.mark.usefixtures("blank_pictures")

MINE = "not a result"
LITTLE = "pile(balls=5) --duration 0.01 --stepper Moreau(step=1e-3) --no-progress"


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A folder with a file that no command may touch."""
    folder = tmp_path / "outside"
    folder.mkdir()
    (folder / "mine").write_text(MINE)
    return folder


@pytest.fixture
def run(finished_run: Path, tmp_path: Path) -> Path:
    """A finished run with the tables and charts of an earlier report, and a place for a local one."""
    folder = Path(shutil.copytree(finished_run, tmp_path / "run"))
    for place in ("tables", "charts", "local/tables", "local/charts"):
        (folder / place).mkdir(parents=True, exist_ok=True)
    return folder


def untouched(outside: Path) -> bool:
    return {path.name: path.read_text() for path in outside.iterdir()} == {"mine": MINE}


def content(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def replaced_by_link(place: Path, target: Path) -> None:
    if place.is_dir():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    place.symlink_to(target)


LINKS: dict[str, tuple[str, str, str]] = {
    "table": ("tables/results.csv", "mine", "report {}"),
    "nothing yet": ("tables/matrix.md", "new", "report {}"),
    "folder of tables": ("tables", ".", "report {} --no-charts"),
    "chart": ("charts/funnel-30.svg", "mine", "report {}"),
    "folder of charts": ("charts", ".", "report {}"),
    "below the charts": ("charts/deeper", ".", "report {}"),
    "local folder": ("local", ".", "report {} --residual local"),
    "local table": ("local/tables/results.csv", "mine", "report {} --residual local"),
}
FEW = ("table", "folder of charts", "local folder")
"""Links that slow tests try; the others are weekly."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "target", "line"),
    [pytest.param(*link, id=name, marks=[] if name in FEW else pytest.mark.weekly) for name, link in LINKS.items()],
)
def test_links_out_of_a_run_are_refused_when_its_tables_are_printed_and_nothing_is_written(
    place: str, target: str, line: str, run: Path, outside: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    replaced_by_link(run / place, outside / target)
    before = content(run)
    assert run_command(line.format(run).split()) == 2
    printed = capsys.readouterr()
    assert "funnel-30 · " in printed.out
    assert printed.err.count("\n") == 1
    assert f", outside {run};" in printed.err
    assert untouched(outside)
    assert content(run) == before


@pytest.fixture(scope="module")
def of_one_case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of one case, without tables."""
    results = tmp_path_factory.mktemp("results")
    return bench.run("hard-tresca-joint", "SORprox", results=results, run_id="it", tolerances=1e-2, passes=1).folder


@pytest.mark.slow
@pytest.mark.parametrize(("place", "option"), [("tables", "--no-charts"), ("charts", ""), ("recordings", "--record")])
def test_links_out_are_refused_at_the_end_of_a_run_too(
    place: str,
    option: str,
    of_one_case: Path,
    outside: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = Path(shutil.copytree(of_one_case, tmp_path / "it"))
    (folder / place).symlink_to(outside)
    assert run_command(f"run --resume {folder} --no-progress {option}".split()) == 2
    printed = capsys.readouterr()
    assert "hard-tresca-joint · " in printed.out
    assert f"{folder / place} is a symbolic link to {outside}, outside {folder};" in printed.err
    assert untouched(outside)


@pytest.mark.slow
def test_internal_links_are_followed_and_hard_links_are_replaced(run: Path, outside: Path) -> None:
    shutil.rmtree(run / "tables")
    (run / "elsewhere").mkdir()
    (run / "tables").symlink_to("elsewhere")
    os.link(outside / "mine", run / "elsewhere" / "results.csv")
    assert load(run).report(charts=False).unwritten == ""
    assert (run / "elsewhere" / "results.csv").read_text().startswith("problem,")
    assert untouched(outside)


@pytest.mark.slow
def test_a_run_may_itself_be_reached_over_a_link(run: Path, tmp_path: Path) -> None:
    (tmp_path / "latest").symlink_to(run)
    assert load(tmp_path / "latest").report(charts=False).tables
    assert (run / "tables" / "summary.csv").is_file()


@pytest.mark.weekly
@pytest.mark.parametrize("charts", ["", " --no-charts"])
def test_a_run_whose_files_cannot_be_written_is_printed_and_says_why(
    charts: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(f"report {run} --no-charts".split()) == 1  # a claim of the run is wrong
    whole = capsys.readouterr().out
    shutil.rmtree(run / "tables")
    (run / "tables").write_text("no folder")
    assert run_command(f"report {run}{charts}".split()) == 1
    printed = capsys.readouterr()
    assert printed.out == "".join(
        line for line in whole.splitlines(True) if not line.startswith(("tables ", "charts "))
    )
    assert printed.err.startswith(f"proxbench: cannot write {run}/tables/results.csv: ")
    assert printed.err.count("\n") == 1
    assert run_command(f"report {run} --quiet".split()) == 2  # only the files are wanted
    assert capsys.readouterr().out == ""


@pytest.mark.weekly
def test_report_files_that_cannot_be_written_do_not_make_a_successful_run_fail(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = f"run --problem hard-tresca-joint --solver SORprox --tolerance 1e-4 --output {tmp_path} --run-id it"
    assert run_command([*line.split(), "--quiet", "--no-charts"]) == 0
    (tmp_path / "it" / "charts").write_text("no folder")
    capsys.readouterr()
    assert run_command(["report", str(tmp_path / "it")]) == 0
    printed = capsys.readouterr()
    assert f"tables   {tmp_path}/it/tables" in printed.out
    assert f"cannot write {tmp_path}/it/charts/" in printed.err


@pytest.mark.slow
def test_a_simulation_whose_chart_cannot_be_written_is_printed_and_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result, chart = tmp_path / "a.npz", tmp_path / "there" / "chart.svg"
    assert run_command(f"simulate {LITTLE} --output {result} --chart {chart}".split()) == 0
    shutil.rmtree(chart.parent)
    chart.parent.write_text("no folder")
    capsys.readouterr()
    assert run_command(["report", str(result)]) == 0
    printed = capsys.readouterr()
    assert "total  0.01 s in 10 steps" in printed.out
    assert "cannot write" in printed.err
    assert printed.err.count("\n") == 1
    assert run_command(["report", str(result), "--quiet"]) == 2


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("page.md", "matrix --problem hard-groove --solver SORprox --output {link}"),
        ("a.npz", f"simulate {LITTLE} --force --output {{link}}"),
        ("a.svg", f"simulate {LITTLE} --force --output {{parent}}/b.npz --chart {{link}}"),
        ("a.png", f"simulate {LITTLE} --force --output {{parent}}/b.npz --chart {{link}}"),
        ("a.rrd", f"simulate {LITTLE} --force --output {{parent}}/b.npz --recording {{link}}"),
        ("a.rrd", "record hard-groove --solver SORprox --force --output {link}"),
        ("a.png", "record hard-groove --solver SORprox --output {parent}/b.rrd --force --still {link}"),
    ],
)
def test_a_file_that_is_a_link_elsewhere_is_refused_before_any_work(
    name: str, line: str, outside: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "inside").mkdir()
    link = tmp_path / "inside" / name
    link.symlink_to(outside / "mine")
    assert run_command(line.format(link=link, parent=link.parent).split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert f"{link} is a symbolic link to {outside / 'mine'}, outside {link.parent};" in printed.err
    assert untouched(outside)
    assert list(link.parent.iterdir()) == [link]


def test_resume_rejects_a_linked_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result, link = tmp_path / "a.npz", tmp_path / "inside" / "a.npz"
    assert run_command(f"simulate {LITTLE} --output {result}".split()) == 0
    before = result.read_bytes()
    link.parent.mkdir()
    link.symlink_to(result)
    assert run_command(f"simulate --resume {link} --duration 0.02 --no-progress".split()) == 2
    assert f"is a symbolic link to {result}, outside {link.parent}; remove it" in capsys.readouterr().err
    assert result.read_bytes() == before


def test_a_file_is_written_as_a_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write_file(tmp_path / "new" / "a", b"old")

    def fail(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(BenchError, match=r"cannot write .* No space left on device"):
        write_file(file, b"new")
    assert content(tmp_path) == {file: b"old"}
