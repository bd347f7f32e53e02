"""The command line: one sentence and an exit code for every mistake."""

import gc
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from proxbench.bench import load
from proxbench.bench.cli.main import OBJECTS_OF_IMPORTS, main, run_command
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import load as load_problem
from proxbench.problems import save_problem
from proxbench.problems.motion.scenes.registry import SCENES
from simulated_runs import store_run
from stored_cases import case_record, solved_case


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("rnu", "'run'"),
        ("run --suit quick", "--suite"),
        ("run --suite quik", "'quick'"),
        ("run --solver SORprx", "'SORprox'"),
        ("run --solver SORprox(relaxtion=1)", "'relaxation'"),
        ("run --solver SORprox(relaxation=-1)", "relaxation"),
        ("run --solver __import__('os').getcwd()", "cannot read"),
        ("run --problem funel-30", "'funnel-30'"),
        ("run --tolerance 3", "between 0 and 1"),
        ("run --solve-seconds -1", "--solve-seconds must be positive"),
        ("list solvrs", "'solvers'"),
        ("list solvers SORprx", "'SORprox'"),
        ("report nowhere --residual locl", "'local'"),
        ("generate", "--suite"),
        ("generate funnel-31", "'funnel-3"),
        ("generate --suite hard", "no problem of the suite 'hard' comes from a scene"),
        ("report nowhere", "not a stored run"),
        ("run --resume nowhere", "not a stored run"),
        ("run --resume nowhere --solver SORprox", "--solver"),
        ("run --retry-failed", "--resume"),
        ("run --quiet --json", "--quiet and --json"),
        ("check SORprox --quiet --json", "--quiet and --json"),
        ("matrix --quiet --json", "--quiet and --json"),
        ("matrix --quiet", "--output"),
        ("record hard-groove --quiet --json", "--quiet and --json"),
        ("list solvers --suite hard", "list problems --suite hard"),
        ("list problems --suite hrad", "'hard'"),
        ("report nowhere --quiet --json", "--quiet and --json"),
        ("run --suite hard --problem hard-no-motion", "--problem"),
        ("run --problem hard-no-motion --run-id ../elsewhere", "'../elsewhere'"),
    ],
)
def test_errors_are_reported_in_one_sentence_with_exit_code_2(
    line: str, words: str, mistake: Callable[[str], str]
) -> None:
    assert words in mistake(line)


def test_unwritable_output_is_reported(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for line in (f"run --output {tmp_path}/file", f"generate woodpecker-beak-impact --output {tmp_path}/file"):
        assert run_command(line.split()) == 2
        assert "cannot write" in capsys.readouterr().err


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_a_run_prints_its_tables_and_says_where_the_files_are(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    line = f"run --problem hard-tresca-joint --solver SORprox --tolerance 1e-4 --output {tmp_path} --run-id one"
    assert run_command([*line.split(), "--passes", "1"]) == 0
    printed = capsys.readouterr().out
    assert "hard-tresca-joint" in printed
    for folder in ("cases", "tables"):
        assert any((tmp_path / "one" / folder).iterdir())
    assert (tmp_path / "one" / "report.html").is_file()
    assert f"page     {tmp_path / 'one' / 'report.html'}" in printed


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_a_quiet_run_without_a_page_prints_where_its_files_are_and_draws_none(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    run = tmp_path / "one"
    line = f"run --problem hard-tresca-joint --solver SORprox --tolerance 1e-4 --output {tmp_path} --run-id one"
    assert run_command([*line.split(), "--passes", "1", "--quiet", "--no-page"]) == 0
    printed = capsys.readouterr()
    assert printed.out == f"results  {run}\ntables   {run}/tables\n"
    assert printed.err == ""
    assert not (run / "charts").exists()
    assert not (run / "report.html").exists()
    assert run_command(["report", str(run), "--quiet"]) == 0
    assert capsys.readouterr().out == f"results  {run}\ntables   {run}/tables\ncharts   {run}/charts\n"
    assert any((run / "charts").iterdir())


@pytest.mark.slow
def test_a_quiet_check_prints_what_failed_and_nothing_of_what_passed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", "hard-groove", "--quiet"]) == 0
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "")


@pytest.mark.slow
def test_a_quiet_matrix_prints_where_its_page_is(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    page = tmp_path / "matrix.md"
    line = f"matrix --problem hard-groove --problem hard-empty --solver SORprox --quiet --output {page}"
    assert run_command(line.split()) == 0
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == (f"matrix   {page}\ntable    {page.with_suffix('.csv')}\n", "")
    assert "hard-groove" in page.read_text()


def test_problem_file_is_recorded_like_the_named_problem(tmp_path: Path) -> None:
    save_problem(load_problem("hard-groove"), tmp_path / "groove.npz")
    line = f"record {tmp_path}/groove.npz --solver SORprox --quiet --output {tmp_path}/groove.rrd"
    assert run_command(line.split()) == 0
    assert (tmp_path / "groove.rrd").is_file()


@pytest.mark.parametrize(
    ("content", "words"), [(None, "there is no file x.npz"), (b"PK", "neither a simulation nor a problem")]
)
def test_invalid_files_to_record_are_reported(
    content: bytes | None,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path("x.npz").write_bytes(content)
    assert run_command(["record", "x.npz", "--solver", "SORprox", "--output", "x.rrd"]) == 2
    assert words in capsys.readouterr().err
    assert not Path("x.rrd").exists()


def test_quiet_record_prints_the_command_that_opens_the_recording(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "a.rrd"
    assert run_command(f"record hard-groove --solver SORprox --quiet --output {file}".split()) == 0
    assert capsys.readouterr().out == f"open it with: rerun {file}\n"


def test_json_is_one_document_and_nothing_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A solver that crashed on the second problem makes the exit code one."""
    cases = [solved_case(load_problem("funnel-30"), name, [1e-2, 1e-4]) for name in ("NSGS", "SORprox")]
    crashed = case_record(problem="hard-groove", solver="NSGS", outcome=Outcome.CRASHED, reason="why")
    run = store_run(tmp_path / "run", [*cases, crashed])
    assert run_command(["report", str(run), "--json", "--no-charts"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert len(document["results"]) == 3
    assert document["damaged"] == []


@pytest.mark.slow
def test_a_report_by_local_residuals_says_so_and_leaves_the_judged_tables_alone(
    finished_run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    load(finished_run).report(charts=False)
    before = (finished_run / "tables" / "results.csv").read_bytes()
    assert run_command(["report", str(finished_run), "--residual", "local", "--no-charts"]) == 1
    printed = capsys.readouterr().out
    assert "residuals are local" in printed
    assert f"tables   {finished_run}/local/tables" in printed
    assert (finished_run / "tables" / "results.csv").read_bytes() == before


@pytest.mark.slow
def test_a_table_that_goes_to_a_pipe_keeps_names_and_commands_in_one_piece(
    finished_run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(sys, "__stdout__", None)  # as into a pipe, even if the tests run in a terminal
    assert run_command(["report", str(finished_run), "--no-charts"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert (
        sum(line.startswith("SORprox(relaxation=0.5) ") for line in lines) == 5
    )  # three problems, and the summary to two accuracies
    assert any(line.startswith("claimed: ") and line.endswith("time limit.") for line in lines)


@pytest.mark.slow
def test_list_names_solvers_suites_problems_and_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert {"SORprox", "Jprox", "JORprox", "ClarabelSOCP"} <= {row["name"] for row in listed["solvers"]}
    assert {"quick", "funnel", "piles", "woodpecker", "bodies", "sequences", "hard", "all"} == {
        row["name"] for row in listed["suites"]
    }
    assert list(SCENES) == [row["name"] for row in listed["scenes"]]
    slider = next(row for row in listed["problems"] if row["name"] == "hard-duplicated-slider")
    assert (slider["contacts"], slider["rows"]) == (10, 30)
    assert slider["laws"] == ["unilateral", "spatial friction"]


def test_missing_command_prints_the_help_and_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command([]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "Usage: proxbench [OPTIONS] COMMAND" in printed.err
    assert "generate" in printed.err


@pytest.mark.parametrize(
    ("line", "unused"),
    [
        ("--help", {"numpy", "numba", "scipy", "pandas", "altair", "clarabel", "importlib.metadata"}),
        ("run --help", {"numpy", "numba", "scipy", "pandas", "altair", "clarabel", "proxbench.problems"}),
        pytest.param("--version", {"numpy", "numba", "scipy", "rich", "proxbench.problems"}, marks=pytest.mark.slow),
        pytest.param("list suites", {"proxbench.problems.motion", "proxbench.solvers.sweeps"}, marks=pytest.mark.slow),
        pytest.param("list solvers", {"proxbench.problems.motion"}, marks=pytest.mark.slow),
        pytest.param(
            "list",
            {
                *("pandas", "altair", "rerun", "rich", "psutil", "msgspec", "cloudpickle"),
                *("multiprocessing.connection", "proxbench.bench.isolation", "proxbench.bench.store"),
                "proxbench.bench.plugins.descriptions",
            },
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_command_loads_only_what_it_uses(line: str, unused: set[str]) -> None:
    code = (
        f"import sys; from proxbench.bench.cli.main import run_command; run_command({line.split()});"
        f"print(sorted({unused} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert len(done.stdout) > 10


@pytest.mark.slow
def test_imports_of_a_command_are_not_searched_for_garbage() -> None:
    """The collections are those between the start of the command and the end of the interpreter."""
    code = """
import atexit, gc, sys
from proxbench.bench.cli.main import main
begun = []
gc.callbacks.append(lambda phase, _: begun.append(phase))
gc.collect()
begun.clear()
atexit.register(lambda: print(begun, gc.get_freeze_count() > 100_000, file=sys.stderr))
sys.argv = ["proxbench", "list"]
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "[] True\n"
    assert "solvers" in done.stdout


def test_garbage_is_collected_as_usual_after_the_first_collection(monkeypatch: pytest.MonkeyPatch) -> None:
    before, counts = (gc.isenabled(), gc.get_threshold(), [*gc.callbacks]), list[int]()

    def command(arguments: list[str]) -> int:
        counts.append(gc.get_threshold()[0])
        assert gc.isenabled()
        child = os.fork()
        if not child:
            os._exit(gc.get_threshold() != before[1])
        assert os.waitpid(child, 0)[1] == 0, "a child collects garbage as usual"
        gc.collect()
        counts.append(gc.get_threshold()[0])
        return 0

    monkeypatch.setattr("proxbench.bench.cli.main.run_command", command)
    monkeypatch.setattr(gc, "freeze", lambda: None)  # it would also freeze the garbage of other tests
    with pytest.raises(SystemExit):
        main()
    assert counts == [OBJECTS_OF_IMPORTS, before[1][0]]
    assert (gc.isenabled(), gc.get_threshold()) == before[:2]
    del gc.callbacks[len(before[2]) :]


@pytest.mark.slow
def test_commands_called_from_python_leave_the_garbage_collector_alone() -> None:
    code = """
import gc, sys
def state():
    return gc.isenabled(), gc.get_threshold(), gc.get_freeze_count(), len(gc.callbacks)
before = state()
from proxbench.bench.cli.main import run_command
run_command(["list", "suites"])
print(state() == before, file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "True\n"


@pytest.mark.parametrize("word", ["funnel", "stack(masses=(1.0,))", "woodpecker"])
def test_a_scene_is_listed_with_the_meaning_of_its_options(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["list", "scenes", word]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    for name, option in SCENES[word.partition("(")[0]].options.items():
        assert f"{name}={option.default!r}" in printed
        assert option.meaning in printed
