"""A fault of a plugin in a study affects only its own curve; a killed study resumes from its points."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import scene_plugin
from misbehaving_solvers import Misbehaving
from proxbench.bench import load, study
from proxbench.bench.errors import BenchError
from proxbench.bench.plugins.files import use_plugin_files
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.problems.exchange.plugins.offers import forget, registered

pytestmark = pytest.mark.slow

GOOD = "Moreau with SORprox"


@pytest.fixture
def scenes() -> Iterator[None]:
    """Register the scenes of a plugin for one test."""
    use_plugin_files([Path(scene_plugin.__file__)])
    yield
    for file, _ in registered():
        forget(file)


@pytest.mark.parametrize(
    ("action", "outcome", "words"),
    [
        ("raise", Outcome.CRASHED, "the plugin gave up"),
        ("exit", Outcome.CRASHED, "exit code 7"),
        pytest.param("leave", Outcome.CRASHED, "SystemExit: enough", marks=pytest.mark.weekly),
        ("segfault", Outcome.CRASHED, "SIGSEGV"),
        pytest.param("sleep", Outcome.TIMEOUT, "its 3 s", marks=pytest.mark.weekly),
        ("allocate", Outcome.OUT_OF_MEMORY, "256 MiB"),
    ],
)
def test_a_fault_of_a_solver_costs_its_curve_only(action: str, outcome: Outcome, words: str, tmp_path: Path) -> None:
    limits = Limits(solve_seconds=60.0, case_seconds=3.0 if action == "sleep" else 120.0, memory_bytes=2**28)
    run = study(
        "sliding_sphere",
        Misbehaving(action),
        tmp_path,
        limits=limits,
        duration=0.002,
        members=[1.0],
        methods={GOOD: (1e-3,)},
    )
    good, bad = run.cases.to_dict("records")
    assert (good["solver"], good["outcome"]) == (GOOD, Outcome.MEASURED)
    assert bad["outcome"] == outcome
    assert words in bad["reason"]
    assert run.points["solver"].tolist() == [GOOD]
    assert run.is_finished


@pytest.mark.parametrize("fault", ["raise", "exit", "eat"])
@pytest.mark.usefixtures("scenes")
def test_a_failed_reference_solution_is_reported_in_one_sentence(fault: str, tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=rf"the reference of faulty\(fault='{fault}'\) cannot be simulated") as caught:
        study(f"faulty(fault={fault!r})", results=tmp_path, duration=0.2, methods={GOOD: (1e-3,)})
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("scenes")
def test_a_scene_of_a_plugin_is_studied(tmp_path: Path) -> None:
    ladder = {GOOD: (4e-3, 1e-3)}
    run = study("block(mass=2.0)", results=tmp_path, duration=0.3, members=(0.95, 1.0, 1.05), methods=ladder)
    coarse, fine = run.points["residual"]
    assert 0.0 < fine < coarse < 1.0
    assert [use.name for use in run.info.plugins] == ["block"]


BEGIN = """
from proxbench.bench import study
study("sliding_sphere", results={results!r}, run_id="it", members=[1.0], duration=0.3,
      methods={{"Moreau with SORprox": (1e-1, 1e-2, 1e-3, 4e-4, 2e-4)}})
"""


@pytest.mark.weekly
def test_a_study_that_is_killed_keeps_its_points_and_goes_on(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", BEGIN.format(results=str(tmp_path))])
    folder = tmp_path / "it"
    while not list(folder.glob("cases/*.json")):
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    begun = load(folder)
    kept = len(begun.points)
    assert 1 <= kept < 5
    assert not begun.is_finished
    done = begun.resume()
    assert done.is_finished
    assert done.points["total_seconds"].iloc[:kept].tolist() == begun.points["total_seconds"].tolist()
    assert (done.points["outcome"] == Outcome.SOLVED).all()
