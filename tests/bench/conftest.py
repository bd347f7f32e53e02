"""Shared fixtures: a small finished run, and invalid command lines."""

import fcntl
import os
import shutil
from collections.abc import Callable, Generator
from functools import cache
from pathlib import Path

import pytest
from blank_pictures import draw_blank_pictures
from misbehaving_solvers import Misbehaving
from proxbench.bench import run
from proxbench.bench.cli.main import run_command
from proxbench.bench.measure import machine
from times_under_load import ignore_load

HERE = Path(__file__).parent

SOURCE_DIGEST = cache(machine._source_digest)
"""The digest of the source, which no test changes, computed once."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """For the tests of this folder, ignore the load of the machine, and do not wait for writes to disk.

    The digest of the source is computed once.
    """
    if HERE not in item.path.parents:
        return (yield)
    with pytest.MonkeyPatch.context() as patch:
        ignore_load(patch)
        patch.setattr("os.fsync", lambda descriptor: None)
        patch.setattr("proxbench.bench.measure.machine._source_digest", SOURCE_DIGEST)
        return (yield)


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of a run of five solvers on three problems at three tolerances, some of them faulty.

    The first process of pytest-xdist that needs the run measures it for all of them.
    """
    is_one_of_several = "PYTEST_XDIST_WORKER" in os.environ
    base = tmp_path_factory.getbasetemp().parent if is_one_of_several else tmp_path_factory.getbasetemp()
    shared, own = base / "results" / "little", tmp_path_factory.mktemp("results") / "little"
    with (base / "results.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not shared.exists():
            shared.parent.mkdir(exist_ok=True)
            _measure(own).rename(shared)
    shutil.copytree(shared, own)
    return own


def _measure(folder: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:  # claims a core even while other tests have claimed all of them
        patch.setattr("proxbench.bench.measure.measuring_core.CLAIM", f"test-{os.getpid()}")
        return run(
            problems=["hard-counterexample", "hard-immovable", "funnel-30"],
            solvers=["SORprox(relaxation=0.5)", "SORprox", "ClarabelSOCP", Misbehaving("lie"), Misbehaving("raise")],
            results=folder.parent,
            run_id=folder.name,
            tolerances=[1e-2, 1e-4, 1e-6],
            solve_seconds=2.0,
            passes=1,
        ).folder


@pytest.fixture
def blank_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write blank pictures in place of charts, which takes no time."""
    draw_blank_pictures(monkeypatch)


@pytest.fixture
def mistake(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[[str], str]:
    """Run a command line in an empty folder; check exit code 2 and that no file is written; return its one sentence."""

    def sentence(line: str) -> str:
        monkeypatch.chdir(tmp_path)
        assert run_command(line.split()) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err.startswith("proxbench: ")
        assert printed.err.count("\n") == 1
        assert list(tmp_path.iterdir()) == []
        return printed.err

    return sentence
