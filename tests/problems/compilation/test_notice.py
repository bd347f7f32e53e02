"""Long compilations are announced once, also in several processes."""

import subprocess
import sys

import pytest
from proxbench.problems.compilation.notice import NOTICE

COMPILE_SEVERAL = """
import numba
from proxbench.problems.compilation import notice
notice.SECONDS_BEFORE_NOTICE = {seconds}
{before}
for number in range({count}):
    numba.njit(eval(f"lambda x: x + {{number}}"))(1.0)
print(notice.COMPILATION.kernels >= {count}, notice.COMPILATION.seconds > 0.0)
"""


@pytest.mark.parametrize(
    ("count", "seconds", "before", "notices"),
    [
        (3, 0.0, "", 1),
        pytest.param(3, 1e6, "", 0, marks=pytest.mark.slow),
        pytest.param(3, 0.0, "notice.COMPILATION.silence()", 0, marks=pytest.mark.slow),
        pytest.param(1, 1e-3, "", 1, marks=pytest.mark.slow),
    ],
)
def test_long_compilation_is_announced_once_on_standard_error(
    count: int, seconds: float, before: str, notices: int
) -> None:
    code = COMPILE_SEVERAL.format(count=count, seconds=seconds, before=before)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.count(NOTICE) == notices
    assert done.stdout.split() == ["True", "True"]


@pytest.mark.slow
def test_processes_of_one_fork_server_announce_compilation_once_on_its_standard_error() -> None:
    code = """
import os
import numba
from proxbench.problems.compilation import notice
notice.SECONDS_BEFORE_NOTICE = 0.0
notice.COMPILATION.share_with_forks()
for number in range(2):
    if os.fork() == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        numba.njit(lambda x: x + 1.0)(1.0)
        os._exit(0)
    os.wait()
numba.njit(lambda x: x - 1.0)(1.0)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines() == [NOTICE]
