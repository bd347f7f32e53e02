"""Kernels of small problems are interpreted, in the same bits."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import scipy.sparse as sp
from numba import config, njit
from proxbench.problems import load
from proxbench.problems.compilation import interpretation
from proxbench.problems.compilation.interpretation import (
    DeferredKernels,
    compiled_kernels,
    interpretable,
    interprets_kernels,
)
from proxbench.problems.contact.matrices import delassus, factors
from proxbench.problems.exchange.files.problem_file import save_problem

VARIED_PROBLEMS = [
    "funnel-30",
    "funnel-planar-30",
    "hard-counterexample",
    "hard-disconnected-parts-few",
    "hard-linked-3-axes",
    "hard-mixed-laws-21",
    "hard-remote-brakes-40",
    "hard-resisting-sphere-3-axes",
]


@pytest.mark.slow
def test_listing_compiles_nothing_and_loads_no_generated_problem(tmp_path: Path) -> None:
    save_problem(load("hard-groove"), tmp_path / "bodies-box-sticking.npz")
    code = f"""
import os
os.environ["PROXBENCH_CACHE"] = {str(tmp_path)!r}
from contextlib import redirect_stdout
from io import StringIO
from proxbench.bench.cli.main import run_command
from proxbench.problems.compilation.notice import COMPILATION
from proxbench.problems.exchange.catalog import is_available
with redirect_stdout(StringIO()) as text:
    code = run_command(["list"])
print(code, is_available("bodies-box-sticking"), "SORprox" in text.getvalue(), COMPILATION.kernels)
"""
    assert _run_on_an_empty_cache(code) == ["0", "True", "True", "0"]


def test_two_coupled_contacts_are_built_and_one_is_solved_without_compilation() -> None:
    code = """
import numpy as np
from proxbench import ContactProblem, solve
from proxbench.problems.compilation.notice import COMPILATION
for dim in (1, 2, 3):
    ContactProblem.from_delassus(np.eye(6) + 1.0, -np.ones(6), 0.3, dim=dim)
    problem = ContactProblem.from_delassus(np.eye(dim), [-1.0, 0.2, 0.1][:dim], 0.3, dim=dim)
    print(solve(problem).status, COMPILATION.kernels)
"""
    assert _run_on_an_empty_cache(code) == ["solved", "0"] * 3


@pytest.mark.slow
def test_interpreted_kernels_do_not_change_a_bit_of_a_solution_or_a_verdict() -> None:
    code = """
from proxbench import judge, load, solve
from proxbench.problems.compilation import interpretation
from proxbench.problems.contact.residual import write_squared_violations

def results():
    for name in {names}:
        problem, found = load(name), []
        for solver in ("Robust", "NSGS"):
            solution = solve(problem, solver, tolerance=1e-9, max_iterations=100)
            verdict = judge(problem, solution.impulses)
            found += [solution.message, solution.iterations, solution.impulses.tobytes(), verdict.numeric_fields()]
        yield found

interpretation.MAX_INTERPRETED_SECONDS = interpretation.MAX_INTERPRETED_NUMBERS = float("inf")
interpreted = list(results())
assert not write_squared_violations.overloads
interpretation.MAX_INTERPRETED_SECONDS = 0.0
compiled = list(results())
assert write_squared_violations.overloads
print(*(name for name, one, other in zip({names}, interpreted, compiled) if repr(one) == repr(other)))
"""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, "-c", code.format(names=VARIED_PROBLEMS)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.split() == VARIED_PROBLEMS


@pytest.mark.skipif(config.DISABLE_JIT, reason="numba is switched off")
def test_a_kernel_is_interpreted_only_where_allowed_for_few_numbers_and_a_short_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def is_interpreted(n_numbers: int) -> bool:
        kernel = interpretable(njit(lambda x: len(x) + 1))
        call = interprets_kernels(lambda: kernel(np.zeros(n_numbers)))
        assert [call(), call()] == [n_numbers + 1, n_numbers + 1]
        return not kernel.overloads

    outside = interpretable(njit(lambda x: len(x) + 1))
    assert outside(np.zeros(3)) == 4
    assert outside.overloads
    assert is_interpreted(3)
    with compiled_kernels():
        assert not is_interpreted(3)
    dear = interpretable(njit(lambda x: len(x) + 1), count=lambda x: 10 ** len(x))
    assert interprets_kernels(dear)(np.zeros(9)) == 10
    assert dear.overloads
    assert not is_interpreted(interpretation.MAX_INTERPRETED_NUMBERS + 1)
    monkeypatch.setattr(interpretation, "MAX_INTERPRETED_SECONDS", 1e-9)
    assert not is_interpreted(3)


@pytest.mark.skipif(config.DISABLE_JIT, reason="numba is switched off")
def test_deferred_kernels_are_used_where_nothing_is_interpreted_and_else_after_many_uses_of_the_others() -> None:
    kernels = DeferredKernels([], uses_before_loading=10**9, uses_before_compiling=3)
    should_use = interprets_kernels(kernels.should_use)
    assert [should_use() for _ in range(5)] == [False, False, False, True, True]
    with compiled_kernels():
        assert DeferredKernels([], 10**9, 10**9).should_use()
    others = DeferredKernels([], 10**9, 10**9)
    assert others.should_use()
    assert interprets_kernels(others.should_use)()  # they are already compiled


@pytest.mark.slow
@pytest.mark.skipif(config.DISABLE_JIT, reason="numba is switched off")
def test_deferred_kernels_are_loaded_early_if_they_are_in_the_cache(tmp_path: Path) -> None:
    (tmp_path / "doubling.py").write_text(
        "from numba import njit\n\n\n@njit(cache=True)\ndef double(x):\n    return 2.0 * x\n"
    )
    code = """
from doubling import double
from proxbench.problems.compilation.interpretation import DeferredKernels, interprets_kernels
should_use = interprets_kernels(DeferredKernels([double], 2, 10**9).should_use)
print(*(int(should_use()) for _ in range(3)), len(double.overloads))
double(1.0)
"""
    environment = {
        **os.environ,
        "NUMBA_DISABLE_JIT": "0",
        "NUMBA_CACHE_DIR": f"{tmp_path}",
        "PYTHONPATH": f"{tmp_path}",
    }
    first, second = (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
        for _ in range(2)
    )
    assert first.stdout.split() == ["0", "0", "0", "0"]
    assert second.stdout.split() == ["0", "1", "1", "1"]


def test_the_products_of_kernels_over_pairs_are_counted() -> None:
    pieces = load("hard-supports-32").factor_pieces()
    count = delassus._count_products(pieces.starts, pieces.chunks, pieces.values, pieces.n_chunks)
    assert count == (pieces.n_blocks * pieces.width) ** 2 * pieces.length  # one body moves
    root, directions = sp.random_array((7, 7), density=0.4, rng=1).tocsr(), sp.random_array((7, 9), density=0.4, rng=2)
    columns = directions.tocsc()
    count = factors._count_products(root.indptr, root.indices, root.data, columns.indptr, columns.indices, columns.data)
    assert count == ((root != 0.0).astype(int).T @ (columns != 0.0).astype(int)).sum()


def _run_on_an_empty_cache(code: str) -> list[str]:
    """Return the words that a fresh process prints."""
    with TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_DISABLE_JIT": "0", "NUMBA_CACHE_DIR": folder}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    return done.stdout.split()
