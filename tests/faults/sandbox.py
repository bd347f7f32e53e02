"""Runs in separate processes, and what they leave: processes, temporary files, verdicts."""

import os
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
from proxbench.bench.store.records import CaseRecord
from proxbench.bench.store.store import Store

PLUGINS = Path(__file__).parents[1] / "bench" / "plugins"

HEAD = """
from functools import partial
import pytest
from misbehaving_solvers import Misbehaving
from proxbench.bench import resume, run
from proxbench.bench.store.plans import Limits
from times_under_load import ignore_load
ignore_load(pytest.MonkeyPatch())
results = {results!r}
run = partial(run, results=results, run_id="it")
"""


JUDGED = ("iterations", "residual", "model_residual", "verdict", "impulse_error")
"""Fields of a point that do not depend on a clock."""


class Sandbox:
    """A folder with its own results and temporary files, and a mark that identifies its processes."""

    def __init__(self, folder: Path) -> None:
        self.results, self.temporary = folder / "results", folder / "temporary"
        for path in (self.results, self.temporary):
            path.mkdir(parents=True)
        self._mark = f"PROXBENCH_TEST_MARK={uuid.uuid4()}"
        name, _, value = self._mark.partition("=")
        path = os.pathsep.join([str(PLUGINS), *filter(None, [os.environ.get("PYTHONPATH")])])
        self.environment = {**os.environ, name: value, "TMPDIR": str(self.temporary), "PYTHONPATH": path}

    def start(self, code: str, before: Callable[[], None] | None = None) -> subprocess.Popen[str]:
        """Start a process that calls ``before`` and then runs ``code``; a run in it is stored as "it"."""
        return subprocess.Popen(
            [sys.executable, "-c", HEAD.format(results=str(self.results)) + code],
            env=self.environment,
            cwd=self.temporary.parent,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=before,
        )

    def run(self, code: str, before: Callable[[], None] | None = None) -> "subprocess.CompletedProcess[str]":
        """Run ``code`` to its end; a process that hangs is an error."""
        process = self.start(code, before)
        output, errors = process.communicate(timeout=600)
        return subprocess.CompletedProcess(process.args, process.returncode, output, errors)

    def done(self, code: str) -> "Verdicts":
        """Run ``code``, check that it succeeds and leaves nothing behind, and return the verdicts of its run."""
        done = self.run(code)
        assert done.returncode == 0, done.stderr
        assert self.left_behind() == []
        return verdicts(self.results / "it")

    def processes(self) -> list[psutil.Process]:
        """Return the living processes that come from this sandbox."""
        found = []
        for process in psutil.process_iter():
            try:
                marks = Path(f"/proc/{process.pid}/environ").read_bytes().split(b"\0")
                if self._mark.encode() in marks and process.status() != psutil.STATUS_ZOMBIE:
                    found.append(process)
            except (OSError, psutil.Error):
                continue
        return found

    def left_behind(self, allowed: Callable[[Path], bool] = lambda file: False, patience: float = 30.0) -> list[str]:
        """Return the processes and files, except for allowed ones, that remain after at most ``patience`` [s]."""
        deadline = time.monotonic() + patience
        while True:
            files = [file for file in self._stray_files() if not allowed(file)]
            left = [str(process) for process in self.processes()] + [str(file) for file in files]
            if not left or time.monotonic() > deadline:
                return left
            time.sleep(0.05)

    def _stray_files(self) -> list[Path]:
        parts = [file for file in self.results.rglob("*") if file.is_file() and file.suffix != ".json"]
        return [*self.temporary.iterdir(), *parts]


Verdicts = dict[tuple[str, str], Any]


def verdicts(run: Path) -> Verdicts:
    """Return the untimed results of the judge and the solver for each case."""
    cases, damaged = Store.open(run).read_cases()
    assert damaged == []
    return {(case.problem, case.solver): _untimed(case) for case in cases}


def _untimed(case: CaseRecord) -> Any:
    points = [[getattr(point, name) for name in ("tolerance", "outcome", "status", "reason")] for point in case.points]
    judged = [[getattr(point.measured, name, None) for name in JUDGED] for point in case.points]
    return [case.digest, case.outcome, case.curve, points, judged]
