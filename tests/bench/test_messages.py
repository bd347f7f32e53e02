"""Messages name options as their reader gives them: ``--run-id`` on the command line, ``run_id=`` in Python."""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import proxbench.bench
import pytest
from proxbench.bench import resume, run
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError, InterruptedRunError, InterruptedSimulationError
from proxbench.bench.recordings.file import refuse_bad_path
from proxbench.bench.report.layout.output_file import output_file, refuse_taken
from proxbench.problems import ProxbenchError
from proxbench.problems.spelling import for_command_line

BENCH = Path(proxbench.bench.__file__).parent
OF_THE_COMMAND_LINE = ("cli", "simulation", "report/layout/output_file.py")
"""Rooms that only the command line enters."""

OPTION = re.compile(r"(?<![\w-])--[a-z]")


def texts(tree: ast.AST) -> Iterator[str]:
    """Yield all texts of a file but docstrings, names of options by themselves, and what is spelt for each reader."""
    for node in ast.iter_child_nodes(tree):
        is_docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        is_spelt = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "either"
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value.strip():
            yield node.value
        if not (is_docstring or is_spelt):
            yield from texts(node)


@pytest.mark.slow
def test_no_message_that_python_may_raise_spells_an_option_for_the_command_line_alone() -> None:
    for file in sorted(BENCH.rglob("*.py")):
        if not file.relative_to(BENCH).as_posix().startswith(OF_THE_COMMAND_LINE):
            found = [text for text in texts(ast.parse(file.read_text())) if OPTION.search(text)]
            assert found == [], file


@pytest.mark.slow
def test_what_is_spelt_for_python_names_no_option_of_the_command_line() -> None:
    spelt = 0
    for file in sorted(BENCH.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "either":
                command_line, python = map(ast.unparse, node.args)
                assert OPTION.search(command_line.replace("'", " ").replace('"', " ")), file
                assert not OPTION.search(python), file
                spelt += 1
    assert spelt >= 5


def taken(folder: Path) -> Path:
    (folder / "a.json").write_text("{}")
    return folder / "a.json"


def taken_run(folder: Path) -> None:
    (folder / "it").mkdir()
    taken(folder / "it")
    run("hard-no-motion", "SORprox", results=folder, run_id="it")


def blocked(folder: Path) -> None:
    run("hard-no-motion", "SORprox", results=taken(folder))


def interrupted(folder: Path) -> None:
    raise InterruptedRunError(folder)


def interrupted_simulation(folder: Path) -> None:
    raise InterruptedSimulationError(folder / "a.npz")


@pytest.mark.parametrize(
    ("act", "command_line", "python"),
    [
        (taken_run, ["--resume", "--run-id"], ["resume('{folder}/it')", "run_id="]),
        (blocked, ["--output"], ["results="]),
        (interrupted, ["proxbench run --resume {folder}"], ["proxbench.bench.resume('{folder}')"]),
        (interrupted_simulation, ["--resume {folder}/a.npz"], ["resume_simulation('{folder}/a.npz')"]),
        (lambda folder: output_file(taken(folder), "a", ".json", False), ["--resume", "--force"], ["force=True"]),
        (lambda folder: output_file(folder / "a.txt", "a", ".json", False), ["--output {folder}/a.txt"], ["a.txt"]),
        (lambda folder: output_file(taken(folder) / "b.json", "a", ".json", False), ["--output"], ["output="]),
        (lambda folder: refuse_taken([taken(folder)], False), ["--force"], ["force=True"]),
        (lambda folder: refuse_bad_path(taken(folder).rename(folder / "a.rrd"), False), ["--force"], ["force=True"]),
    ],
)
def test_each_reader_gets_its_own_spelling(
    act: Callable[[Path], object], command_line: list[str], python: list[str], tmp_path: Path
) -> None:
    with pytest.raises(ProxbenchError) as caught:
        act(tmp_path)
    error = caught.value
    assert not OPTION.search(str(error))
    for words in python:
        assert words.format(folder=tmp_path) in str(error)
    for words in command_line:
        assert words.format(folder=tmp_path) in for_command_line(error.sentence)


def test_the_command_line_prints_its_own_spelling(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "it").mkdir()
    taken(tmp_path / "it")
    line = f"run --problem hard-no-motion --solver SORprox --output {tmp_path} --run-id it"
    assert run_command(line.split()) == 2
    assert "--resume" in (said := capsys.readouterr().err)
    assert "resume(" not in said
    with pytest.raises(BenchError, match="no stored run"):
        resume(tmp_path)


def test_an_interruption_says_that_something_is_kept_only_if_something_is(finished_run: Path, tmp_path: Path) -> None:
    (tmp_path / "cases").mkdir()
    assert "before anything was measured; resume with: " in str(InterruptedRunError(tmp_path))
    assert "what is measured is kept; resume with: " in str(InterruptedRunError(finished_run))
