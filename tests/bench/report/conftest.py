"""Shared fixtures: the reference run, and the tables of its profiles."""

from pathlib import Path

import pandas as pd
import pytest
from proxbench.bench import Run, load
from proxbench.bench.report.profiles import profile_tables
from proxbench.bench.store.frames import RunFrames

REFERENCE = Path(__file__).parents[3] / "results/reference.bundle"


@pytest.fixture(scope="session")
def finished(finished_run: Path) -> RunFrames:
    """The small finished run, read once; tests change copies of its tables."""
    return load(finished_run)


@pytest.fixture(scope="session")
def reference_run() -> Run:
    """A run of fifteen solvers on eight problems; tests change copies of its tables."""
    return load(REFERENCE)


@pytest.fixture(scope="session")
def reference_tables(reference_run: RunFrames) -> dict[str, pd.DataFrame]:
    """The tables of its profiles, with NSGS as baseline."""
    return profile_tables(reference_run, "NSGS")
