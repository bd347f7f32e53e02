"""The pytest plugin runs every check on every marked solver, and reports each failure in a sentence."""

import subprocess
import sys
from pathlib import Path

import pytest
from proxbench.bench.conformance import SOLVER_CHECKS

CONFTEST = 'pytest_plugins = ["proxbench.bench.conformance.pytest_plugin"]\n'

GIVES_UP = """
from dataclasses import dataclass

import numpy as np
import pytest
from proxbench.problems import Model
from proxbench.solvers import Solution, Status


class GivesUp:
    name, model = "GivesUp", Model.COULOMB

    def supports(self, problem):
        return None

    def prepare(self, problem):
        return self

    def solve(self, stop, start=None, observe=None):
        return Solution(np.zeros(0), Status.SOLVED, 0)


@pytest.mark.proxbench(GivesUp(), "Enumeration")
def test_conformance(proxbench_check):
    proxbench_check()
"""


def session(folder: Path, test: str, *options: str) -> subprocess.CompletedProcess[str]:
    (folder / "conftest.py").write_text(CONFTEST)
    (folder / "test_mine.py").write_text(test)
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--strict-markers", *options]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600)


@pytest.mark.weekly
def test_each_promise_of_each_solver_is_a_test_that_says_what_is_broken(tmp_path: Path) -> None:
    ran = session(tmp_path, GIVES_UP, "-k", "finite or observed", "-v", "-rs")
    assert ran.returncode == 1
    assert f"collected {2 * len(SOLVER_CHECKS)} items" in ran.stdout
    assert "[GivesUp-finite] FAILED" in ran.stdout
    assert "on 8 frictionless contacts: it returned impulses of shape (0,), not (8,)." in ran.stdout
    assert "[Enumeration-finite] PASSED" in ran.stdout
    assert "[Enumeration-observed] SKIPPED" in ran.stdout
    assert "it has no observable iterates (has_iterates is False)" in ran.stdout
    assert "Traceback" not in ran.stdout


@pytest.mark.slow
def test_a_test_without_a_solver_fails_with_what_to_write(tmp_path: Path) -> None:
    ran = session(tmp_path, "def test_nothing(proxbench_check):\n    proxbench_check()\n")
    assert ran.returncode != 0
    assert "mark it: @pytest.mark.proxbench(MySolver())" in ran.stdout + ran.stderr
