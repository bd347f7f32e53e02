"""``proxbench record`` writes a recording, or prints one sentence."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command

HANGING = """
import time
from proxbench.problems import Model

class Hanging:
    name, model, has_iterates = "Hanging", Model.COULOMB, False

    def supports(self, problem):
        return None

    def prepare(self, problem):
        return self

    def solve(self, stop, start=None, observe=None):
        time.sleep(1000)

SOLVERS = [Hanging]
"""


def test_solvers_are_recorded_and_listed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "a.rrd"
    line = f"record hard-sticking-box --solver SORprox --solver ClarabelCoulomb --tolerance 1e-4 --output {file}"
    assert run_command(line.split()) == 0
    printed = capsys.readouterr().out
    assert "SORprox: " in printed
    assert "ClarabelCoulomb: " in printed
    assert f"rerun {file}" in printed
    assert file.is_file()
    assert run_command([*line.split(), "--force", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["file"] == str(file)
    assert [row["solver"] for row in document["solves"]] == ["SORprox", "ClarabelCoulomb"]
    assert document["solves"][0]["residual"] < 1e-4


def test_json_is_valid_even_if_a_residual_is_not_finite(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = f"record hard-immovable --solver SORprox --output {tmp_path}/a.rrd --json"
    assert run_command(line.split()) == 0
    document = json.loads(capsys.readouterr().out, parse_constant=lambda word: pytest.fail(word))
    assert document["solves"][0]["residual"] is None


@pytest.mark.weekly
def test_a_solver_that_hangs_is_ended_a_second_after_its_time_limit(tmp_path: Path) -> None:
    plugin = tmp_path / "hanging.py"
    plugin.write_text(HANGING)
    line = f"record hard-groove --solver Hanging --solve-seconds 1 --plugin {plugin} --output {tmp_path}/a.rrd"
    program = (sys.executable, "-c", "from proxbench.bench.cli.main import main; main()")  # plugins stay registered
    began = time.monotonic()
    done = subprocess.run([*program, *line.split()], capture_output=True, encoding="utf-8")
    assert done.returncode == 1
    assert time.monotonic() - began < 40.0  # the limit, the grace period, and the start of processes
    assert "It did not end at its time limit of 1 s." in done.stdout


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("record funel-30 --solver SORprox --output new.rrd", "'funnel-30'"),
        ("record funnel-30 --solver SORprx --output new.rrd", "'SORprox'"),
        ("record funnel-30 --output new.rrd", "--solver"),
        ("record funnel-30 --solver SORprox", "--output"),
        ("record funnel-30 --solver SORprox --output old.rrd", "--force"),
        ("record funnel-30 --solver SORprox --output new.mp4", ".rrd"),
        ("record funnel-30 --solver SORprox --output old.rrd/new.rrd", "cannot write"),
        ("record funnel-30 --solver SORprox --output new.rrd --tolerance 0", "between 0 and 1"),
        (
            "record funnel-30 --solver SORprox --output new.rrd --max-iterations -1",
            "--max-iterations must not be negative, got -1",
        ),
        ("record funnel-30 --solver SORprox --solver SORprox --output new.rrd", "more than once"),
    ],
)
def test_errors_are_reported_in_one_sentence_and_leave_files_unchanged(
    line: str, words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("old.rrd").write_text("precious")
    assert run_command(line.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("proxbench: ")
    assert printed.err.count("\n") == 1
    assert words in printed.err
    assert [(path.name, path.read_text()) for path in Path().iterdir()] == [("old.rrd", "precious")]
