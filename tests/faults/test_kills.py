"""A run survives kill -9 of any of its processes at any moment, and can be resumed after kill -9 of itself.

A slow test kills one run; weekly tests kill as many workers and runs as PROXBENCH_KILLS states.
"""

import itertools
import os
import random
import subprocess
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import psutil
import pytest
from proxbench.bench import load, resume
from sandbox import Sandbox, Verdicts, verdicts

KILLS = int(os.environ.get("PROXBENCH_KILLS", "2"))


RUNS = """
def say(event):
    if type(event).__name__ == "PointFinished":
        print(event.problem, event.solver, event.tolerance, sep="|", flush=True)

run(
    {problems!r},
    ["SORprox", "ClarabelSOCP"],
    tolerances=[1e-1, 1e-3],
    limits=Limits(solve_seconds=30.0, case_seconds=120.0),
    passes={passes},
    on_event=say,
)
"""

SHORT = RUNS.format(problems=["hard-sticking-box"], passes=1)
LONGER = RUNS.format(problems=["hard-sticking-box", "funnel-30"], passes=2)


@dataclass
class Undisturbed:
    """A run that is not killed: its code, verdicts and wall time [s]."""

    run: str
    verdicts: Verdicts
    seconds: float


@pytest.fixture(scope="module", params=[SHORT, pytest.param(LONGER, marks=pytest.mark.weekly)], ids=["short", "longer"])
def undisturbed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    sandbox, start = Sandbox(tmp_path_factory.mktemp("undisturbed")), time.monotonic()
    return Undisturbed(request.param, sandbox.done(request.param), time.monotonic() - start)


def resumed(sandbox: Sandbox, retry: bool) -> Verdicts:
    """Resume the run in this process, check that it leaves nothing behind, and return its verdicts."""
    folder = resume(sandbox.results / "it", retry_failed=retry).folder
    assert sandbox.left_behind() == []
    return verdicts(folder)


@pytest.mark.weekly
def test_killed_workers_lose_only_their_own_cases(tmp_path: Path, undisturbed: Undisturbed) -> None:
    chance, numbers, kills = random.Random(5), itertools.count(), 0
    while kills < KILLS:
        sandbox = Sandbox(tmp_path / str(next(numbers)))
        process = sandbox.start(undisturbed.run)
        while process.poll() is None:
            time.sleep(chance.uniform(0.0, 0.6))
            kills += killed_one(sandbox, process.pid, chance)
        _, errors = process.communicate()
        assert process.returncode == 0, errors
        found = verdicts(sandbox.results / "it")
        assert found.keys() == undisturbed.verdicts.keys()
        for case, verdict in found.items():
            assert verdict == undisturbed.verdicts[case] or verdict[1] == "crashed"
        assert sandbox.left_behind() == []
        assert resumed(sandbox, retry=True) == undisturbed.verdicts


def killed_one(sandbox: Sandbox, run: int, chance: random.Random) -> bool:
    """Kill a random process of a run: a server, a supervisor or a case; return whether there was one."""
    workers = sorted(process.pid for process in sandbox.processes() if process.pid != run)
    if not workers:
        return False
    try:
        psutil.Process(chance.choice(workers)).kill()
    except psutil.NoSuchProcess:
        return False
    return True


@pytest.mark.parametrize("least", [1, pytest.param(KILLS, marks=pytest.mark.weekly)])
def test_a_killed_run_keeps_its_reported_points_leaves_no_process_and_can_be_resumed(
    least: int, tmp_path: Path, undisturbed: Undisturbed
) -> None:
    """The run names a point after it is stored, so every named point is in the file with as many rounds.

    Every other run is killed in the second half of its time.
    """
    chance, numbers, kills, named = random.Random(7), itertools.count(1), 0, 0
    while kills < least or not named:
        number = next(numbers)
        sandbox = Sandbox(tmp_path / str(number))
        process = sandbox.start(undisturbed.run)
        wait_for_server(sandbox, process)
        time.sleep((number % 2 + chance.random()) / 2.0 * undisturbed.seconds)
        kills += process.poll() is None
        process.kill()
        output, _ = process.communicate()
        # a partly written file is removed when the run is resumed
        assert sandbox.left_behind(lambda file: file.suffix == ".part") == []
        said = Counter(line for line in output.splitlines(keepends=True) if line.endswith("\n"))
        named += len(said)
        points = rounds_of_points(sandbox.results / "it") if said else pd.DataFrame()
        for line, count in said.items():
            problem, solver, value = line.strip().split("|")
            own = points[(points["problem"] == problem) & (points["solver"] == solver)]
            (found,) = own[own["tolerance"] == float(value)].itertuples()
            assert found.outcome != "solved" or found.rounds >= count
        is_begun = (sandbox.results / "it" / "run.json").exists()
        finished = resumed(sandbox, retry=False) if is_begun else sandbox.done(undisturbed.run)
        assert finished == undisturbed.verdicts


def rounds_of_points(folder: Path) -> pd.DataFrame:
    """Return the points of a run with the number of their rounds."""
    run, place = load(folder), ["problem", "solver", "tolerance"]
    counts = run.rounds.groupby(place).size().rename("rounds").reset_index()
    return run.points.merge(counts, how="left", on=place)


def wait_for_server(sandbox: Sandbox, process: "subprocess.Popen[str]") -> None:
    """Wait until the run has started its first process, so that kills do not only hit imports."""
    while process.poll() is None and len(sandbox.processes()) < 2:
        time.sleep(0.01)
