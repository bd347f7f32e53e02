"""A real dask cluster: if a worker is killed, its problem is measured again, and nothing is lost or changed."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from proxbench.bench import bundle, rejudge, run
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.execution.cluster import dask_executor
from proxbench.bench.measure.execution.events import Event, ProblemPassFinished
from proxbench.bench.store.outcome import Outcome
from proxbench.problems.exchange.catalog import suite_members

SOLVERS = ["NSGS", "SORprox"]

SAME = ["problem", "solver", "tolerance", "outcome", "residual", "iterations"]
"""Columns of points that depend on no clock."""

N_PROBLEMS = int(os.environ.get("PROXBENCH_CLUSTER", "4"))
"""Number of problems of the run; PROXBENCH_CLUSTER=200 gives a run that is large enough to need a cluster."""


def test_without_dask_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(BenchError, match="dask is not installed; run pip"), dask_executor("local"):
        pass


@pytest.mark.slow
def test_a_cluster_measures_what_one_machine_does(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    given: dict[str, Any] = {"tolerances": [1e-2], "passes": 1, "results": tmp_path}
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with (
        distributed.LocalCluster(**options) as cluster,
        dask_executor(cluster.scheduler_address) as executor,
    ):
        swept = run(["hard-groove"], SOLVERS, run_id="swept", executor=executor, **given)
    here = run(["hard-groove"], SOLVERS, run_id="here", **given)
    assert swept.is_finished
    assert swept.points[SAME].equals(here.points[SAME])


@pytest.mark.weekly
def test_two_workers_of_which_one_is_killed_measure_what_one_machine_does(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    problems = suite_members("hard")[:N_PROBLEMS]
    given: dict[str, Any] = {"tolerances": [1e-2, 1e-4], "passes": 1, "results": tmp_path, "solve_seconds": 5.0}
    killed = threading.Event()

    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        victim = next(iter(cluster.workers.values())).pid

        def kill(event: Event) -> None:
            if isinstance(event, ProblemPassFinished) and event.done >= 2 and not killed.is_set():
                killed.set()
                os.kill(victim, signal.SIGKILL)

        with dask_executor(cluster.scheduler_address) as executor:
            swept = run(problems, SOLVERS, run_id="swept", executor=executor, on_event=kill, **given)
    assert killed.is_set()
    assert swept.is_finished
    assert swept.damaged == []
    here = run(problems, SOLVERS, run_id="here", **given)
    timed = (swept.points["outcome"] == Outcome.TIME_LIMIT) | (here.points["outcome"] == Outcome.TIME_LIMIT)
    assert swept.points[~timed][SAME].equals(here.points[~timed][SAME])
    assert not timed.all()
    assert rejudge(bundle(swept, tmp_path / "swept.bundle")).disagreements == []


@pytest.mark.slow
def test_an_unreachable_cluster_is_reported_in_one_sentence(
    mistake: Callable[[str], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("proxbench.bench.measure.execution.cluster.CONNECT_SECONDS", 0.5)
    for address in ("tcp://127.0.0.1:1", "nonsense://x"):
        said = mistake(f"run --problem hard-groove --dask {address}")
        assert f"there is no dask cluster with workers at {address}" in said
