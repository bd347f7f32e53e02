"""``proxbench warm`` compiles every kernel, in as many processes as there are cores, and says how many."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from proxbench.bench.cli.compilation import processes, warm
from proxbench.bench.cli.compilation.processes import Compiled
from proxbench.bench.cli.main import run_command
from proxbench.solvers.registry import compiled_solvers


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of processes that are asked for; nothing is compiled."""
    numbers: list[int] = []

    def compile_nothing(parts: str, n_parts: int, n_processes: int) -> Compiled:
        assert (parts, n_parts) == (f"{warm.__name__}:parts", len(warm.parts()))
        numbers.append(n_processes)
        return Compiled(5, 2.4)

    monkeypatch.setattr(processes, "compile_in_processes", compile_nothing)
    monkeypatch.setattr(processes, "compile_here", lambda parts: numbers.append(1) or Compiled(5, 2.4))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "kernels")
    return numbers


@pytest.mark.parametrize(("cores", "number"), [(1, 1), (2, 2), (64, warm.MAX_PROCESSES)])
def test_there_is_a_process_for_each_core_up_to_a_limit(
    cores: int, number: int, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("proxbench.solvers.iteration.cores.usable_cores", lambda: cores)
    assert run_command(["warm", "--quiet"]) == 0
    assert asked == [number]


@pytest.mark.usefixtures("asked")
def test_counts_and_times_are_printed_as_a_sentence_or_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["warm"]) == 0
    assert capsys.readouterr().out == "Compiled 5 kernels in 2 s (0 s in total); they are cached in kernels.\n"
    assert run_command(["warm", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document.keys() == {"compiled", "compile_seconds", "seconds", "cache"}
    assert (document["compiled"], document["compile_seconds"], document["cache"]) == (5, 2.4, "kernels")
    assert run_command(["warm", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_parts_are_those_of_every_solver_and_simulation() -> None:
    calls = [(part.func.__name__, *part.args) for part in warm.parts() if hasattr(part, "func")]
    assert [name for kind, name, *_ in calls if kind == "_solve"] == [*compiled_solvers(), *warm.VARIANTS]
    assert [tuple(words) for kind, *words in calls if kind == "_simulate"] == list(warm.SIMULATIONS)


@pytest.mark.weekly
def test_second_warm_command_compiles_nothing(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    words = [sys.executable, "-c", "from proxbench.bench.cli.main import main; main()", "warm", "--json"]
    counts = []
    for _ in range(2):
        done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
        counts.append(json.loads(done.stdout)["compiled"])
    assert counts[0] > 500
    assert counts[1] == 0
