"""A run survives kill -9 of any of its processes at any moment, and can be finished after kill -9 of itself.

PROXBENCH_KILLS is the number of kills of each kind; without it there are a few, as continuous integration needs them.
"""

import os
import random
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
import pytest
from proxbench.bench import load
from sandbox import Sandbox, verdicts

KILLS = int(os.environ.get("PROXBENCH_KILLS", "2"))

PLAN = """
    ["hard-sticking-box", "funnel-30", "hard-tresca-joint"],
    ["SORprox", "JORprox(relaxation=0.5)", "ClarabelSOCP", "PyramidPGS(sides=8)"],
    tolerances=[1e-1, 1e-3],
    limits=Limits(solve_seconds=30.0, case_seconds=120.0), passes=2,
"""


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[tuple[str, str], Any], float]:
    """Verdicts of a run that is not killed, and its wall time."""
    sandbox, start = Sandbox(tmp_path_factory.mktemp("undisturbed")), time.monotonic()
    found = verdicts(begun(sandbox, "it"))
    return found, time.monotonic() - start


@pytest.fixture(scope="module")
def undisturbed(reference: tuple[dict[tuple[str, str], Any], float]) -> dict[tuple[str, str], Any]:
    return reference[0]


def begun(sandbox: Sandbox, name: str) -> Path:
    done = sandbox.run(f"run({PLAN} results={str(sandbox.results)!r}, run_id={name!r})")
    assert done.returncode == 0, done.stderr
    return sandbox.results / name


def resumed(folder: Path, retry: bool) -> str:
    return f"resume({str(folder)!r}, retry_failed={retry})"


def test_killing_workers_costs_their_own_cases(sandbox: Sandbox, undisturbed: dict[tuple[str, str], Any]) -> None:
    chance, kills, runs = random.Random(5), 0, 0
    while kills < KILLS:
        runs += 1
        folder = sandbox.results / f"run-{runs}"
        process = sandbox.start(f"run({PLAN} results={str(sandbox.results)!r}, run_id={folder.name!r})")
        while process.poll() is None:
            time.sleep(chance.uniform(0.0, 0.6))
            kills += killed_one(sandbox, process.pid, chance)
        _, errors = process.communicate()
        assert process.returncode == 0, errors
        found = verdicts(folder)
        assert found.keys() == undisturbed.keys()
        for case, verdict in found.items():
            assert verdict == undisturbed[case] or verdict[1] == "crashed"
        assert sandbox.left_behind() == []
        done = sandbox.run(resumed(folder, retry=True))
        assert done.returncode == 0, done.stderr
        assert verdicts(folder) == undisturbed
    assert sandbox.left_behind() == []


def killed_one(sandbox: Sandbox, run: int, chance: random.Random) -> bool:
    """Kill a server, a supervisor or a case of a run, whichever it hits; return whether there was one."""
    workers = sorted(process.pid for process in sandbox.processes() if process.pid != run)
    if not workers:
        return False
    try:
        psutil.Process(chance.choice(workers)).kill()
    except psutil.NoSuchProcess:
        return False
    return True


def test_a_killed_run_leaves_nothing_behind_and_is_finished_later(
    sandbox: Sandbox, undisturbed: dict[tuple[str, str], Any]
) -> None:
    chance, kills, runs = random.Random(7), 0, 0
    while kills < KILLS:
        runs += 1
        folder = sandbox.results / f"run-{runs}"
        code = f"run({PLAN} results={str(sandbox.results)!r}, run_id={folder.name!r})"
        while True:
            process = sandbox.start(code)
            if kills < KILLS:
                wait_for_server(sandbox, process)
                time.sleep(chance.uniform(0.0, 2.0))
                kills += process.poll() is None
                process.kill()
            _, errors = process.communicate()
            if process.returncode == 0:
                break
            assert process.returncode == -9, errors
            assert left_by_a_killed_run(sandbox) == []
            if (folder / "run.json").exists():
                code = resumed(folder, retry=False)
        assert verdicts(folder) == undisturbed
    assert sandbox.left_behind() == []


def rounds_of_points(folder: Path) -> pd.DataFrame:
    """Return the points of a run with the number of their rounds."""
    run, place = load(folder), ["problem", "solver", "tolerance"]
    counts = run.rounds.groupby(place).size().rename("rounds").reset_index()
    return run.points.merge(counts, how="left", on=place)


SAYS_POINTS = """
def say(event):
    if type(event).__name__ == "PointFinished":
        print(event.problem, event.solver, event.tolerance, sep="|", flush=True)
"""


def test_a_killed_run_has_stored_every_point_that_it_has_finished(
    sandbox: Sandbox, reference: tuple[dict[tuple[str, str], Any], float]
) -> None:
    """It names a point after that is stored, so that all it has named is there, with as many rounds."""
    chance, kills, runs, named = random.Random(11), 0, 0, 0
    while kills < KILLS:
        runs += 1
        folder = sandbox.results / f"run-{runs}"
        where = f"results={str(sandbox.results)!r}, run_id={folder.name!r}, on_event=say"
        process = sandbox.start(f"{SAYS_POINTS}\nrun({PLAN} {where})")
        wait_for_server(sandbox, process)
        time.sleep(chance.uniform(0.0, reference[1]))
        kills += process.poll() is None
        process.kill()
        output, _ = process.communicate()
        said = Counter(line for line in output.splitlines(keepends=True) if line.endswith("\n"))
        named += len(said)
        points = rounds_of_points(folder) if said else pd.DataFrame()
        for line, count in said.items():
            problem, solver, value = line.strip().split("|")
            own = points[(points["problem"] == problem) & (points["solver"] == solver)]
            (found,) = own[own["tolerance"] == float(value)].itertuples()
            assert found.outcome != "solved" or found.rounds >= count
        assert left_by_a_killed_run(sandbox) == []
    assert named > 0


def wait_for_server(sandbox: Sandbox, process: Any) -> None:
    """Wait until the run has started its first process, so that kills do not only hit imports."""
    while process.poll() is None and len(sandbox.processes()) < 2:
        time.sleep(0.01)


def left_by_a_killed_run(sandbox: Sandbox) -> list[str]:
    """Return what a killed run leaves, but for the file it was writing, which goes when the run is resumed."""
    return [left for left in sandbox.left_behind() if not left.endswith(".part")]
