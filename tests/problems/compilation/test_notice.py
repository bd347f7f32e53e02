"""Long compilations are announced once, also in several processes."""

import subprocess
import sys

import pytest
from proxbench.problems.compilation.notice import NOTICE

COMPILE_SEVERAL = """
import os
import numba
from proxbench.problems.compilation import notice
for count, seconds, is_silent in {cases}:
    if os.fork() == 0:
        notice.SECONDS_BEFORE_NOTICE = seconds
        if is_silent:
            notice.COMPILATION.silence()
        for number in range(count):
            numba.njit(eval(f"lambda x: x + {{number}}"))(1.0)
        print(notice.COMPILATION.kernels >= count, notice.COMPILATION.seconds > 0.0, flush=True)
        os.write(2, b"end of a process\\n")
        os._exit(0)
    os.wait()
"""


def test_long_compilation_is_announced_once_on_standard_error() -> None:
    """Forks of a process that has imported numba compile several kernels, or one."""
    cases = {(3, 0.0, False): 1, (3, 1e6, False): 0, (3, 0.0, True): 0, (1, 1e-3, False): 1}
    code = COMPILE_SEVERAL.format(cases=list(cases))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    *of_cases, rest = done.stderr.split("end of a process\n")
    assert [printed.count(NOTICE) for printed in of_cases] == list(cases.values())
    assert rest == ""
    assert done.stdout.split() == ["True", "True"] * len(cases)


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
