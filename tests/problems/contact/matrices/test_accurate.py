"""Sums in twice the working precision give the same numbers if kernels run as Python."""

import os
import subprocess
import sys

import pytest
from proxbench.problems.contact.matrices.accurate import _fused_product

JUDGED = """
import numpy as np
from proxbench.problems import judge, load, project
for name in ("hard-mixed-laws", "hard-linked-3-axes", "hard-sticking-box", "funnel-30"):
    problem = load(name)
    impulses = project(problem.laws, np.abs(np.random.default_rng(0).normal(size=problem.n_rows)))
    velocity, rounding = problem.accurate_velocity(impulses)
    verdict = judge(problem, impulses)
    print(name, float(verdict.residual).hex(), float(verdict.local_residual).hex())
    print(velocity.tobytes().hex(), rounding.tobytes().hex())
"""


def output(**environment: str) -> str:
    """Return what the code above prints in a process with these variables."""
    command = [sys.executable, "-c", JUDGED]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, **environment})
    return done.stdout


@pytest.mark.slow
def test_the_judge_finds_the_same_numbers_without_compilation() -> None:
    assert output(NUMBA_DISABLE_JIT="1") == output(NUMBA_DISABLE_JIT="0")


def test_the_python_form_of_a_fused_product_rounds_once_and_passes_on_what_is_not_finite() -> None:
    tiny = 2.0**-30
    assert (1.0 + tiny) * (1.0 - tiny) - 1.0 == 0.0
    assert _fused_product(1.0 + tiny, 1.0 - tiny, -1.0) == -(tiny**2)
    assert _fused_product(1e300, 1e300, 0.0) == float("inf")
    assert _fused_product(float("inf"), 1.0, 0.0) == float("inf")
    assert _fused_product(float("nan"), 1.0, 0.0) != _fused_product(float("nan"), 1.0, 0.0)
