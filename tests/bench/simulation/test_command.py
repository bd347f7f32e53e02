"""The command: mistakes get one sentence, and a signal loses at most the steps since the last checkpoint."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.simulation.file import read_simulation

LITTLE = "pile(balls=5) --duration 0.01 --stepper Moreau(step=1e-3)"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "name a scene (funnel, pile, woodpecker, bouncing_ball,"),
        ("funel", "'funnel'"),
        ("funnel(bals=3)", "did you mean 'balls'"),
        ("funnel(3)", "cannot read"),
        ("funnel(pile)", "cannot read"),
        ("funnel --stepper", "--stepper"),
        ("funnel --stepper Moreu", "did you mean 'Moreau'?"),
        ("funnel(balls=0)", "balls must be a whole number between 1 and"),
        ("funnel(balls='many')", "balls"),
        ("funnel(outlet=-1)", "outlet"),
        ("funnel(friction=1e999)", "friction"),
        ("funnel(restitution=2)", "between 0 and 1"),
        ("funnel(start='cycle')", "no option 'start'"),
        ("woodpecker(balls=3)", "no option 'balls'"),
        ("woodpecker(planar=True)", "no option 'planar'"),
        ("woodpecker(start='cylce')", "'cycle'"),
        ("pile(outlet=3)", "no option 'outlet'"),
        ("pile --stepper Moreau(step=0)", "step of Moreau must be positive"),
        ("pile --duration -1", "duration"),
        ("pile --solver SORprx", "'SORprox'"),
        ("pile --tolerance 2", "between 0 and 1"),
        ("pile --max-iterations 0", "--max-iterations must be at least 1"),
        ("pile --start hot", "there is no start 'hot'; known are cold, scaled, warm, warm-then-cold"),
        ("--resume nowhere.npz", "there is no result file nowhere.npz"),
        ("--resume nowhere.npz --output there", "--output"),
        ("--resume nowhere.npz --force", "--force"),
    ],
)
def test_errors_are_reported_in_one_sentence_and_leave_no_file(
    line: str, words: str, mistake: Callable[[str], str]
) -> None:
    assert words in mistake(f"simulate {line}")


def test_a_simulation_prints_its_table_and_says_where_the_result_is(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "a.npz"
    line = f"simulate pile(balls=5,friction=None,drag=0.1) --duration 0.01 --stepper Moreau(step=1e-3) --output {file}"
    assert run_command(line.split()) == 0
    printed = capsys.readouterr().out
    for words in ("t [s]", "total  0.01 s in 10 steps", "per simulated second", f"result  {file}"):
        assert words in printed
    options = read_simulation(file).plan.scene.options
    assert (options["balls"], options["friction"], options["drag"]) == (5, None, 0.1)
    assert run_command(line.split()) == 2
    assert "exists already" in capsys.readouterr().err
    assert run_command([*line.split(), "--force"]) == 0


def test_json_is_one_document_and_nothing_else(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_command(f"simulate {LITTLE} --output {tmp_path}/a.npz --json".split()) == 0
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    assert printed.err == ""
    assert document["plan"]["options"]["balls"] == 5
    assert document["summary"]["steps"] == 10
    assert [row["steps"] for row in document["windows"]] == [10]


def test_a_step_that_is_not_solved_makes_the_exit_code_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = "simulate pile(balls=30) --duration 0.2 --stepper Moreau(step=1e-3) --max-iterations 1 --tolerance 1e-10"
    assert run_command([*line.split(), "--output", f"{tmp_path}/a.npz"]) == 1
    assert "steps are not solved to 1e-10" in capsys.readouterr().out


def test_resuming_accepts_matching_options_and_refuses_contradicting_ones(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "a.npz"
    assert run_command(f"simulate {LITTLE} --output {file}".split()) == 0
    before = file.read_bytes()
    capsys.readouterr()
    for wrong in (
        "pile(balls=6)",
        "pile(gravity=None)",
        "pile(planar=True)",
        "funnel",
        "--stepper Moreau(step=2e-3)",
        "--states 3",
    ):
        assert run_command(f"simulate {wrong} --resume {file}".split()) == 2
        printed = capsys.readouterr()
        assert printed.err.count("\n") == 1
        assert "omit it to resume" in printed.err
    assert file.read_bytes() == before
    assert run_command(f"simulate pile(balls=5) --resume {file} --duration 0.02".split()) == 0
    assert read_simulation(file).n_steps == 20


def test_an_output_that_cannot_be_written_is_named(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    assert run_command(f"simulate {LITTLE} --output {tmp_path}/plain/a.npz".split()) == 2
    assert "cannot write" in capsys.readouterr().err


def long_simulation(file: Path) -> subprocess.Popen[str]:
    """Start a simulation that takes minutes, and wait until it has taken some steps."""
    code = (
        "import sys, proxbench.bench.simulation.run as running\n"
        "running.CHECKPOINT_SECONDS = 0.05\n"
        "from proxbench.bench.cli.main import run_command\n"
        "sys.exit(run_command(sys.argv[1:]))"
    )
    line = f"simulate pile(balls=30) --duration 1000 --no-progress --output {file}"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *line.split()], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 600.0
    while time.monotonic() < deadline and process.poll() is None:
        try:
            if read_simulation(file).n_steps > 20:
                return process
        except BenchError:
            pass
        time.sleep(0.02)
    process.kill()
    raise AssertionError(process.communicate())


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.weekly)])
def test_an_interruption_stores_the_steps_prints_the_table_and_says_how_to_go_on(number: int, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    process = long_simulation(file)
    process.send_signal(number)
    out, err = process.communicate(timeout=600)
    assert process.returncode == 130
    assert err == f"proxbench: interrupted; the steps taken are kept; resume with: proxbench simulate --resume {file}\n"
    assert f"in {read_simulation(file).n_steps} steps" in out
    assert "stopped before its end" in out


@pytest.mark.weekly
def test_a_killed_simulation_leaves_a_whole_file_from_its_last_checkpoint(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    process = long_simulation(file)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=600)
    kept = read_simulation(file).n_steps
    assert kept > 20
    code = run_command(f"simulate --resume {file} --duration {(kept + 3) * 5e-4} --no-progress".split())
    assert code in (0, 1)  # 1 if it was killed after a step that is not solved
    assert read_simulation(file).n_steps == kept + 3


@pytest.mark.slow
def test_a_simulation_that_goes_on_renews_its_recording_and_replaces_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result, film = tmp_path / "a.npz", tmp_path / "a.rrd"
    begin = f"simulate {LITTLE} --output {result} --recording {film} --no-progress"
    assert run_command(begin.split()) == 0
    assert f"rerun {film}" in capsys.readouterr().out
    before, other = film.read_bytes(), tmp_path / "other.rrd"
    other.write_text("mine")
    assert run_command(f"simulate --resume {result} --duration 0.02 --recording {other} --no-progress".split()) == 2
    assert "--force" in capsys.readouterr().err
    assert (read_simulation(result).n_steps, other.read_text()) == (10, "mine")
    assert run_command(f"simulate --resume {result} --duration 0.02 --no-progress".split()) == 0
    assert f"rerun {film}" in capsys.readouterr().out
    assert film.read_bytes() != before
    line = f"simulate --resume {result} --duration 0.03 --recording {other} --no-progress --force"
    assert run_command(line.split()) == 0
    assert other.stat().st_size > 1000


def test_a_recording_that_cannot_be_written_is_refused_before_the_first_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = f"simulate {LITTLE} --output {tmp_path / 'a.npz'} --recording {tmp_path / 'film.mp4'} --no-progress"
    assert run_command(line.split()) == 2
    assert "must end in .rrd" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
