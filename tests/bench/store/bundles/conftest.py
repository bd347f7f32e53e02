"""Shared fixtures: a finished run of four solvers on three problems, one of which it stores, and its bundle."""

from pathlib import Path

import numpy as np
import pytest
from proxbench.bench import Run, bundle
from proxbench.bench import load as load_run
from proxbench.bench.store.bundles.bundle import Bundle, read_bundle
from proxbench.problems import ContactProblem, load
from proxbench.problems.contact.judge import JUDGE
from simulated_runs import store_run
from stored_cases import solved_case

SOLVERS = ("NSGS", "SORprox", "ClarabelSOCP", "Lemke")
TOLERANCES = (1e-2, 1e-5)


def sliding() -> ContactProblem:
    """Two coupled contacts, of which one slides."""
    diagonal = np.diag([2.0, 1.0, 1.0, 3.0, 1.0, 1.0])
    diagonal[0, 3] = diagonal[3, 0] = 0.5
    return ContactProblem.from_delassus(diagonal, (-1.0, 0.7, 0.1, -2.0, 0.3, -0.2), 0.3, name="sliding pair")


@pytest.fixture(scope="package")
def made(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The run."""
    problems = (sliding(), load("funnel-30"), load("hard-groove"))
    cases = [solved_case(problem, solver, TOLERANCES) for problem in problems for solver in SOLVERS]
    folder = tmp_path_factory.mktemp("results") / "it"
    return load_run(store_run(folder, cases, problems=problems[:1], passes=2, judge=JUDGE))


@pytest.fixture(scope="package")
def file(made: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its bundle."""
    return bundle(made, tmp_path_factory.mktemp("sent") / "it.bundle")


@pytest.fixture
def honest(file: Path) -> Bundle:
    """The content of the bundle."""
    return read_bundle(file)
