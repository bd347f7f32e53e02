"""Shared: a finished run of four solvers on three problems, one of which it carries, and its bundle."""

from pathlib import Path

import numpy as np
import pytest
from proxbench.bench import Run, bundle, run
from proxbench.bench.store.bundles.bundle import Bundle, read_bundle
from proxbench.problems import ContactProblem, load


def sliding() -> ContactProblem:
    """Two coupled contacts, of which one slides."""
    diagonal = np.diag([2.0, 1.0, 1.0, 3.0, 1.0, 1.0])
    diagonal[0, 3] = diagonal[3, 0] = 0.5
    return ContactProblem.from_delassus(diagonal, (-1.0, 0.7, 0.1, -2.0, 0.3, -0.2), 0.3, name="sliding pair")


@pytest.fixture(scope="package")
def made(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The run."""
    return run(
        [sliding(), load("funnel-30"), load("hard-groove")],
        ["NSGS", "SORprox", "ClarabelSOCP", "Lemke"],
        results=tmp_path_factory.mktemp("results"),
        run_id="it",
        tolerances=[1e-2, 1e-5],
        passes=2,
    )


@pytest.fixture(scope="package")
def file(made: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its bundle."""
    return bundle(made, tmp_path_factory.mktemp("sent") / "it.bundle")


@pytest.fixture
def honest(file: Path) -> Bundle:
    """What the bundle holds."""
    return read_bundle(file)
