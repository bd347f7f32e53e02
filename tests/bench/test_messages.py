"""Messages contain the names of options in Python, which the command line replaces with its own."""

import ast
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import proxbench.bench
import pytest
from proxbench.bench import resume, run
from proxbench.bench.cli.main import run_command
from proxbench.bench.cli.options import with_option_names
from proxbench.bench.errors import BenchError, InterruptedRunError, InterruptedSimulationError
from proxbench.bench.recordings.file import check_recording_path
from proxbench.bench.report.layout.output_file import check_writable, output_file
from proxbench.problems import ProxbenchError

BENCH = Path(proxbench.bench.__file__).parent
NAMED = re.compile(r"`([a-z_]+)(?:=True)?`")


@pytest.mark.slow
def test_options_in_messages_are_parameters_of_functions_or_commands() -> None:
    names, parameters = set(), set()
    for file in sorted(BENCH.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.arg):
                parameters.add(node.arg)
            if isinstance(node, ast.Raise):
                texts = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant)]
                names |= {name for text in texts if isinstance(text, str) for name in NAMED.findall(text)}
    assert len(names) >= 5
    assert names <= parameters


def test_the_command_line_spells_options_its_own_way() -> None:
    assert (
        with_option_names("choose another `run_id`, or use `force=True`.") == "choose another --run-id, or use --force."
    )
    assert with_option_names("`G` has shape (3, 2); `a.b` has none.") == "`G` has shape (3, 2); `a.b` has none."


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
    ("act", "words"),
    [
        (taken_run, ["`resume`", "`run_id`"]),
        (blocked, ["`results`"]),
        (interrupted, ["resume with: proxbench run --resume {folder}"]),
        (interrupted_simulation, ["resume with: proxbench simulate --resume {folder}/a.npz"]),
        (lambda folder: output_file(taken(folder), "a", ".json", False), ["`resume`", "`force=True`"]),
        (lambda folder: output_file(folder / "a.txt", "a", ".json", False), ["`output` {folder}/a.txt"]),
        (lambda folder: output_file(taken(folder) / "b.json", "a", ".json", False), ["`output`"]),
        (lambda folder: check_writable([taken(folder)], False), ["`force=True`"]),
        (lambda folder: check_recording_path(taken(folder).rename(folder / "a.rrd"), False), ["`force=True`"]),
    ],
)
def test_a_message_names_the_remedy(act: Callable[[Path], object], words: list[str], tmp_path: Path) -> None:
    with pytest.raises(ProxbenchError) as caught:
        act(tmp_path)
    for word in words:
        assert word.format(folder=tmp_path) in str(caught.value)


def test_the_command_line_prints_its_own_spelling(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "it").mkdir()
    taken(tmp_path / "it")
    line = f"run --problem hard-no-motion --solver SORprox --output {tmp_path} --run-id it"
    assert run_command(line.split()) == 2
    printed = capsys.readouterr().err
    assert "--resume" in printed
    assert "--run-id" in printed
    assert "`" not in printed
    with pytest.raises(BenchError, match="not a stored run"):
        resume(tmp_path)


def test_an_interruption_says_that_something_is_kept_only_if_something_is(finished_run: Path, tmp_path: Path) -> None:
    (tmp_path / "cases").mkdir()
    assert "before anything was measured; resume with: " in str(InterruptedRunError(tmp_path))
    assert "measurements are kept; resume with: " in str(InterruptedRunError(finished_run))


@pytest.mark.parametrize("error", [InterruptedRunError, InterruptedSimulationError])
def test_a_path_in_a_command_is_one_word_for_a_shell(error: Callable[[Path], Exception], tmp_path: Path) -> None:
    path = tmp_path / "it's my $HOME; ls"
    command = str(error(path)).partition("resume with: ")[2]
    assert shlex.split(command)[-1] == str(path)
