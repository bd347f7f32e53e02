"""Shared fixtures of the Jacobi iterations: problems, and first iterates."""

from collections.abc import Callable

import numpy as np
import pytest
from proxbench.problems import ContactProblem
from proxbench.solvers import Stop, create


@pytest.fixture
def random_spatial() -> Callable[[int], ContactProblem]:
    """Make ten spatial contacts from a seed, coupled by a dense positive definite matrix."""

    def made(seed: int) -> ContactProblem:
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(40, 30))
        return ContactProblem.from_delassus(root.T @ root, rng.normal(size=30), 0.4)

    return made


@pytest.fixture
def first_iterates() -> Callable[[ContactProblem, str, int], np.ndarray]:
    """Return the first ``count`` iterates of a solver on a problem, shape (count, n_rows)."""

    def iterates(problem: ContactProblem, solver: str, count: int) -> np.ndarray:
        seen: list[np.ndarray] = []
        create(solver).prepare(problem).solve(Stop(1e-300, count), observe=lambda _, x: seen.append(x.copy()))
        return np.array(seen)

    return iterates
