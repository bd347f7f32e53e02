"""A process that compiles for long says so once, on standard error, and only if nobody has silenced it."""

import os
import subprocess
import sys
from tempfile import TemporaryDirectory

import pytest
from proxbench.problems.compilation import NOTICE

COMPILE_THREE = """
import numba
from proxbench.problems import compilation
compilation.SECONDS_BEFORE_NOTICE = {seconds}
{before}
for number in range(3):
    numba.njit(eval(f"lambda x: x + {{number}}"))(1.0)
print(compilation.COMPILATION.kernels >= 3, compilation.COMPILATION.seconds > 0.0)
"""


@pytest.mark.parametrize(
    ("seconds", "before", "notices"), [(0.0, "", 1), (1e6, "", 0), (0.0, "compilation.silence_notice()", 0)]
)
def test_long_compilation_is_announced_once_on_standard_error(seconds: float, before: str, notices: int) -> None:
    code = COMPILE_THREE.format(seconds=seconds, before=before)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.count(NOTICE) == notices
    assert done.stdout.split() == ["True", "True"]


def test_a_small_problem_is_built_without_compilation() -> None:
    code = """
import numpy as np
from proxbench.problems import ContactProblem
from proxbench.problems.compilation import COMPILATION
ContactProblem.from_delassus(np.eye(6) + 1.0, -np.ones(6), 0.3)
print(COMPILATION.kernels)
"""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "0"}
    with TemporaryDirectory() as folder:
        environment["NUMBA_CACHE_DIR"] = folder
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.split() == ["0"]
