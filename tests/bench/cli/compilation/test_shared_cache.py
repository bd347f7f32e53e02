"""A kernel that fails to compile keeps no other process waiting once its part has ended."""

import subprocess
import sys
from pathlib import Path

import pytest

FAILING = """
import fcntl, pathlib, sys
from contextlib import suppress
from numba import njit
from numba.core.errors import TypingError
from proxbench.bench.cli.compilation.shared_cache import share_cache

folder = pathlib.Path(sys.argv[1])
release = share_cache(folder)

@njit(cache=True)
def kernel(value):
    return value.missing

def is_locked():
    (claim,) = folder.iterdir()
    with open(claim) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False

with suppress(TypingError):
    kernel(1)
print(is_locked())
release()
print(is_locked())
"""


@pytest.mark.slow
def test_lock_is_released_if_a_kernel_fails_to_compile(tmp_path: Path) -> None:
    locks, program = tmp_path / "locks", tmp_path / "failing.py"
    locks.mkdir()
    program.write_text(FAILING)
    words = [sys.executable, str(program), str(locks)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600)
    assert done.stdout.split() == ["True", "False"], done.stderr
