"""Problems of one to twelve contacts, in all forms that a problem can have."""

from typing import Any

import numpy as np
import scipy.sparse as sp
from proxbench.problems import ContactProblem

SWEPT = ["hard-sliding-block", "hard-tower-3", "hard-stack-10", "woodpecker-lower-impact", "hard-sticking-box"]
"""Problems of one to ten contacts that sweeps solve."""

FORMS = ("matrix", "diagonal", "inertia", "uncoupled")
"""G, W with a diagonal M⁻¹, W with one of blocks, and G without coupling."""


def random_problem(rng: np.random.Generator, n_contacts: int, dim: int, form: str) -> ContactProblem:
    """Return a problem with contacts of one or two bodies each, or without coupling."""
    c, mu = rng.normal(size=n_contacts * dim), rng.uniform(0.0, 1.2, size=n_contacts)
    if form == "uncoupled":
        roots = rng.normal(size=(n_contacts, dim, dim + 1))
        return ContactProblem.from_delassus(sp.block_diag([*(roots @ roots.transpose(0, 2, 1))]), c, mu, dim)
    n_bodies = n_contacts // 2 + 1
    directions = np.zeros((6 * n_bodies, n_contacts * dim))
    for contact in range(n_contacts):
        for body in rng.choice(n_bodies, size=min(2, n_bodies), replace=False):
            directions[6 * body : 6 * body + 6, dim * contact : dim * (contact + 1)] = rng.normal(size=(6, dim))
    inverse_mass: Any = rng.uniform(0.5, 2.0, size=6 * n_bodies)
    if form == "inertia":
        roots = rng.normal(size=(2 * n_bodies, 3, 4))
        inverse_mass = sp.block_diag([*(roots @ roots.transpose(0, 2, 1))])
    problem = ContactProblem.from_factors(directions, inverse_mass, c, mu, dim)
    return ContactProblem.from_delassus(problem.delassus(), c, mu, dim) if form == "matrix" else problem


def slow_problem(n_rows: int) -> ContactProblem:
    """Return a frictionless problem with all rows coupled, on which each digit takes at most 70 sweeps."""
    rng = np.random.default_rng(n_rows)
    directions = np.logspace(0.0, -1.45, n_rows)[:, None] * rng.normal(size=(n_rows, n_rows))
    free_velocity = directions.T @ rng.normal(size=n_rows)
    return ContactProblem.from_delassus(directions.T @ directions, free_velocity, 0.0, 1)
