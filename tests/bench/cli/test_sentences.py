"""The command line answers each mistake with a sentence and a remedy, and options are alike in all commands."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.cli.main import app, run_command
from simulated_runs import store_run
from stored_cases import case_record
from typer.main import get_command

PLUGIN = Path(__file__).parents[1] / "plugins" / "scene_plugin.py"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a run in a folder of runs, an invalid bundle, an empty folder and a problem file."""
    made = tmp_path_factory.mktemp("here")
    (made / "runs").mkdir()
    store_run(made / "runs" / "one", [case_record()])
    (made / "a.bundle").write_bytes(b"")
    (made / "empty").mkdir()
    np.savez(made / "plain.npz", G=np.eye(3), c=np.ones(3), mu=0.5)
    return made


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("report a.bundle", "a.bundle is not a bundle; name a file that `proxbench bundle` wrote."),
        ("run --resume a.bundle", "unpack it with: proxbench merge a.bundle"),
        ("compare a.bundle runs/one", "a.bundle is not a bundle; name a file"),
        ("rejudge plain.npz", "plain.npz is not a bundle; name a file that `proxbench bundle` wrote."),
        ("report runs", "runs is not a stored run (stored runs in it: 1); name one of them, such as runs/one."),
        ("report empty", "empty is not a stored run (it has no run.json); name the folder of a run."),
        ("report nosuch", "nosuch is not a stored run (it does not exist); name the folder of a run."),
        ("report nosuch.npz", "there is no result file nosuch.npz."),
        (
            "record runs/one",
            "runs/one is a run; to record iterations during a run, use: proxbench run --record",
        ),
        ("record hard-groove", "recording solvers requires --solver and --output; see proxbench record -h."),
        ("check nosuch", "are known, and proxbench list lists them."),
        ("check funnel-10", "did you mean 'funnel-100'?"),
        ("list solvers nosuch", "are known, and proxbench list solvers lists them."),
        ("list nosuch", "there is no kind 'nosuch' to list; known are problems, scenes, solvers, suites."),
        ("list suites --suite hard", "--suite applies to problems only; use: proxbench list problems --suite hard"),
        (
            "run --problem hard-groove --run-id=",
            "--run-id '' is not a valid name of a run; use at most 60 of the characters",
        ),
        (
            "generate funnel-30 --output a.bundle",
            "cannot write to a.bundle: a.bundle is a file, not a folder; choose another folder.",
        ),
        (
            "export npz hard-groove --output a.bundle/deep/mine.npz",
            "cannot write a.bundle/deep/mine.npz: Not a directory; choose another folder.",
        ),
        (
            "run --problem hard-groove --run-id ünï",
            "--run-id 'ünï' is not a valid name of a run; use at most 60 of the characters",
        ),
        (
            "run --tolerance abc",
            "invalid value for '--tolerance': it must be a valid number; see proxbench run -h.",
        ),
        (
            "run --tolerance 1e-2 --tolerance=x",
            "invalid value for '--tolerance': it must be a valid number; see proxbench run -h.",
        ),
        ("run --passes 1.5", "invalid value for '--passes': it must be a valid integer; see proxbench run -h."),
        ("run --tolerance", "option '--tolerance' requires an argument; see proxbench run -h."),
        ("run --quiet=3", "option '--quiet' does not take a value; see proxbench run -h."),
        ("run extra", "got unexpected extra argument(s) (extra); see proxbench run -h."),
        ("record", "missing argument 'PROBLEM|FILE'; see proxbench record -h."),
        ("import", "missing argument 'FORMAT'; choose from fclib, contactbench, kamino, bodies, plain; see proxbench"),
        ("nosuch", "no such command 'nosuch'; see proxbench -h."),
        (
            "import x a",
            "'x' is not one of 'fclib', 'contactbench', 'kamino', 'bodies', 'plain'; see proxbench import -h.",
        ),
        ("run --memory -5", "--memory must be at least 1 MiB and finite, got -5 MiB; omit it for the default."),
        ("run --solve-seconds -1", "--solve-seconds must be positive and finite, got -1; omit it"),
        ("run --case-seconds nan", "--case-seconds must be positive and finite, got nan; omit it"),
        ("run --tolerance 1e-3 --tolerance 0", "--tolerance must be between 0 and 1, got 0; choose one such as 1e-4."),
        ("run --sample 0", "--sample must be at least 1, got 0; omit it to take all problems."),
        ("matrix --problem hard-groove --tolerance 0", "--tolerance must be positive, got 0; choose one such as 1e-6."),
        ("matrix --problem hard-groove --solve-seconds -1", "--solve-seconds must be positive, got -1; choose one"),
        ("simulate funnel --tolerance 1 --output x.npz", "--tolerance must be between 0 and 1, got 1; omit it"),
        ("simulate funnel --step-seconds 0 --output x.npz", "--step-seconds must be positive and finite, got 0;"),
        ("simulate funnel --max-iterations 0 --output x.npz", "--max-iterations must be at least 1, got 0;"),
        ("check NSGS --check-seconds 0", "--check-seconds must be positive, got 0; omit it for the default."),
        ("run --mix", "--mix finishes an interrupted run and needs --resume RUN; omit --mix."),
    ],
)
def test_error_message_contains_the_remedy(
    line: str, sentence: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert run_command(line.split()) == 2
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert printed.err.startswith("proxbench: ")
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert sorted(path.name for path in folder.iterdir()) == ["a.bundle", "empty", "plain.npz", "runs"]


def test_a_simulation_of_a_plugin_asks_for_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from proxbench.problems.exchange.plugins.files import PluginFile
    from proxbench.problems.exchange.plugins.offers import forget

    result = tmp_path / "tower.npz"
    line = f"simulate block(mass=2.0) --duration 0.002 --plugin {PLUGIN} --output {result} --quiet"
    assert run_command(line.split()) == 0
    forget(PluginFile.read(PLUGIN))
    assert run_command(["report", str(result)]) == 2
    said = f"cannot read {result}: the results need the plugin file {PLUGIN}; name it with --plugin."
    assert said in capsys.readouterr().err


def test_an_exported_problem_is_printed_with_its_digest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from proxbench.problems import load

    file = tmp_path / "x.hdf5"
    assert run_command(["export", "fclib", "hard-groove", "--output", str(file)]) == 0
    assert capsys.readouterr().out == f"{file}  problem digest {load('hard-groove').digest[:16]}\n"


def options_of(command: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the name of each command with each of its options."""
    for word, child in getattr(command, "commands", {}).items():
        yield from options_of(child, f"{name} {word}".strip())
    if not hasattr(command, "commands"):
        yield from ((name, parameter) for parameter in command.params if parameter.param_type_name == "option")


def test_an_option_takes_the_same_kind_of_value_in_all_commands() -> None:
    kinds: dict[str, set[str]] = {}
    for _, option in options_of(get_command(app)):
        kinds.setdefault(option.opts[0], set()).add("flag" if option.is_flag else "value")
    assert {name: kind for name, kind in kinds.items() if len(kind) > 1} == {}
    assert len(kinds) > 30


def test_options_for_outputs_and_time_limits_have_consistent_names() -> None:
    names = {option.opts[0] for _, option in options_of(get_command(app))}
    assert names.isdisjoint({"--results", "--folder", "--to", "--out", "--html", "--max-seconds", "--seconds"})
    limits = {name for name in names if name.endswith("-seconds")}
    assert limits == {"--solve-seconds", "--case-seconds", "--step-seconds", "--check-seconds"}
