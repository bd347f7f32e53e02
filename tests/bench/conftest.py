"""Shared: a finished little run."""

from pathlib import Path

import pytest
from misbehaving_solvers import Misbehaving
from proxbench.bench import run


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of five solvers on three problems at three tolerances, with faults among them."""
    return run(
        problems=["hard-counterexample", "hard-immovable", "funnel-30"],
        solvers=["SORprox(relaxation=0.5)", "SORprox", "ClarabelSOCP", Misbehaving("lie"), Misbehaving("raise")],
        results=tmp_path_factory.mktemp("results"),
        run_id="little",
        tolerances=[1e-2, 1e-4, 1e-6],
        solve_seconds=2.0,
        passes=2,
    ).folder
