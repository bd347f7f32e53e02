"""Processes that compile at the same time lose no kernel, and compile none twice."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from parts_of_kernels import VALUES
from proxbench.bench.cli.compilation.processes import Compiled, compile_in_processes
from proxbench.bench.errors import BenchError


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of kernels."""
    folder = tmp_path / "cache"
    folder.mkdir()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
    return folder


def compiled(parts: str, n_parts: int) -> Compiled:
    return compile_in_processes(f"parts_of_kernels:{parts}", n_parts, 2)


@pytest.mark.slow
def test_kernels_of_one_function_for_different_types_are_all_kept(cache: Path) -> None:
    assert compiled("different", len(VALUES)).kernels == len(VALUES)
    assert len(list(cache.rglob("*.doubled-*.nbc"))) == len(VALUES)
    assert compiled("different", len(VALUES)) == Compiled(0, 0.0)


@pytest.mark.slow
def test_a_kernel_that_two_processes_need_is_compiled_by_one() -> None:
    assert compiled("equal", 4).kernels == 1


@pytest.mark.slow
def test_failure_in_a_compiling_process_raises_and_shows_its_traceback(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BenchError, match="a process that compiles kernels has failed"):
        compiled("failing", 3)
    assert "ValueError: invalid literal for int()" in capfd.readouterr().err


@pytest.mark.slow
def test_a_process_ends_with_the_one_that_started_it(cache: Path) -> None:
    code = "from proxbench.bench.cli.compilation.processes import serve; serve('parts_of_kernels:endless', '.', False)"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    child = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, cwd=cache, env=environment)
    assert child.stdin is not None
    child.stdin.write(b"0\n")
    child.stdin.close()
    assert child.wait(timeout=60) == 0
