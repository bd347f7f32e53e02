"""A result records which solver, tolerance, start and step made which steps."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.plugins.files import use_plugin_files
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.history import check_segments, planned_segment
from proxbench.bench.simulation.plan import SimulationPlan
from proxbench.bench.simulation.run import resume_simulation, simulate
from proxbench.problems.exchange.plugins.files import PluginFile
from proxbench.problems.exchange.plugins.offers import forget

LITTLE = "simulate pile(balls=30) --stepper Moreau(step=1e-3) --no-progress"

Pour = Callable[..., SimulationPlan]


def test_steps_keep_the_solver_that_made_them_when_another_one_goes_on(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "a.npz"
    assert run_command([*LITTLE.split(), *f"--duration 0.14 --solver NSGS --output {file}".split()]) == 0
    assert "pile · Moreau(step=0.001) · NSGS · warm" in capsys.readouterr().out
    more = f"simulate --resume {file} --duration 0.16 --solver SORprox --tolerance 1e-6 --start cold --no-progress"
    assert run_command(more.split()) == 0
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == "pile · 2 segments"
    assert "1–140 Moreau(step=0.001) NSGS 1e-04 warm –" in lines
    assert "141–160 Moreau(step=0.001) SORprox 1e-06 cold –" in lines
    assert run_command(["report", str(file), "--json"]) == 0
    segments = json.loads(capsys.readouterr().out)["segments"]
    assert [(one["first"], one["last"], one["solver"]) for one in segments] == [(1, 140, "NSGS"), (141, 160, "SORprox")]


def test_segments_that_differ_in_their_limit_of_iterations_show_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "a.npz"
    assert run_command([*LITTLE.split(), *f"--duration 0.01 --solver NSGS --output {file}".split()]) == 0
    more = f"simulate --resume {file} --duration 0.02 --max-iterations 7 --no-progress"
    assert run_command(more.split()) == 0
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert "1–10 Moreau(step=0.001) NSGS 1e-04 20000 warm –" in lines
    assert "11–20 Moreau(step=0.001) NSGS 1e-04 7 warm –" in lines


def test_a_finished_simulation_that_is_resumed_keeps_its_solver_and_says_that_nothing_was_simulated(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "a.npz"
    assert run_command([*LITTLE.split(), *f"--duration 0.02 --solver NSGS --output {file}".split()]) == 0
    before, _ = file.read_bytes(), capsys.readouterr()
    assert run_command(f"simulate --resume {file} --solver SORprox --no-progress".split()) == 0
    printed = capsys.readouterr()
    assert "· NSGS ·" in printed.out
    assert "SORprox" not in printed.out
    assert "is already finished; nothing was simulated." in printed.err
    assert file.read_bytes() == before


def test_steps_are_held_against_the_tolerance_that_they_were_solved_to(pour: Pour, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    missed = simulate(pour(150, max_iterations=1, tolerance=1e-10), file).unsolved.sum()
    assert missed
    resumed = resume_simulation(file, {"tolerance": 1e-1, "max_iterations": 1000}, duration=0.16)
    np.testing.assert_array_equal(np.unique(resumed.tolerances), [1e-10, 1e-1])
    assert resumed.unsolved.sum() == missed
    assert read_simulation(file).segments == resumed.segments


def test_resuming_with_equal_settings_adds_no_segment(pour: Pour, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    simulate(pour(10), file)
    assert len(resume_simulation(file, duration=0.02).segments) == 1


def test_a_failed_change_of_solver_leaves_no_segment_without_steps(pour: Pour, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    simulate(pour(10), file)
    resume_simulation(file, {"solver": "NSGS"}, duration=0.02, should_stop=lambda: True)
    assert [segment.solver for segment in read_simulation(file).segments] == ["MomentumFallback"]


MINE = """
from proxbench.solvers import Model, create

class Mine:
    name, model = "Mine", Model.COULOMB
    def supports(self, problem): return None
    def prepare(self, problem): return create("SORprox").prepare(problem)

SOLVERS = [Mine]
"""


def test_a_changed_plugin_file_is_refused_after_another_solver_went_on(pour: Pour, tmp_path: Path) -> None:
    """Otherwise segments of two versions would have one name."""
    plugin, file = tmp_path / "mine.py", tmp_path / "a.npz"
    plugin.write_text(MINE)
    use_plugin_files([plugin])
    try:
        simulate(pour(3, solver="Mine"), file)
        resume_simulation(file, {"solver": "NSGS"}, duration=0.005)
        plugin.write_text(MINE.replace("SORprox", "NSGS"))
        use_plugin_files([plugin])
        with pytest.raises(BenchError, match=r"mine\.py has changed since the run began"):
            resume_simulation(file, {"solver": "Mine"}, duration=0.007)
    finally:
        forget(PluginFile.read(plugin))


@pytest.mark.parametrize("firsts", [[], [1], [0, 0], [0, 5], [0, 6]])
def test_segments_that_do_not_cover_the_steps_are_refused(firsts: list[int], pour: Pour) -> None:
    with pytest.raises(ValueError, match="do not cover"):
        check_segments([planned_segment(pour(5), first) for first in firsts], 5)


def test_a_start_that_does_not_exist_is_refused(pour: Pour) -> None:
    with pytest.raises(BenchError, match="there is no start 'wram'; did you mean 'warm'"):
        pour(5, start="wram")
