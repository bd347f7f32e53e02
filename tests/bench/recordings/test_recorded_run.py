"""``proxbench run --record`` records the cases without faults, one file per problem, in the folder of the run."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from misbehaving_solvers import Misbehaving
from proxbench.bench import run
from proxbench.bench.cli.main import run_command
from proxbench.bench.recordings.solves import record_run
from proxbench.solvers import create


@pytest.mark.weekly
def test_every_problem_of_the_run_gets_a_recording(
    tmp_path: Path, read_back: Callable[[Path], Any], capsys: pytest.CaptureFixture[str]
) -> None:
    line = "run --problem hard-groove --problem hard-sticking-box --solver SORprox --solver Lemke --tolerance 1e-4"
    assert run_command([*line.split(), "--record", "--no-charts", "--output", str(tmp_path), "--run-id", "a"]) == 0
    assert "rerun" in capsys.readouterr().out
    for name in ("hard-groove", "hard-sticking-box"):
        recording = read_back(tmp_path / "a" / "recordings" / f"{name}.rrd")
        for solver in (0, 1):
            assert min(recording.curve(f"/curves/residual/{solver}").values()) <= -8.0


@pytest.mark.slow
def test_a_crashing_solver_is_omitted_from_the_recording_without_other_losses(
    tmp_path: Path, read_back: Callable[[Path], Any]
) -> None:
    folder = run(
        ["hard-groove"], [Misbehaving("segfault"), create("SORprox")], results=tmp_path, run_id="a", tolerances=[1e-2]
    )
    [made] = record_run(folder)
    assert [trace.solver for trace in made.traces] == ["SORprox"]
    assert ("/curves/residual/1", "Scalars:scalars") not in read_back(made.file).logged
