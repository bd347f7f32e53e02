"""Small problems of every kind for conformance tests, created anew each time."""

from collections.abc import Iterable

import numpy as np
import scipy.sparse as sp

from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Solver
from ...problems.hard import hard_case
from .checks import NotApplicable

_HARD_CASES = (
    "hard-supports-4",
    "hard-stack-10",
    "hard-sliding-block",
    "hard-sticking-box",
    "hard-duplicated-slider",
    "hard-counterexample",
    "hard-tresca-joint",
    "hard-mixed-laws",
    "hard-remote-partner",
    "hard-zero-directions",
    "hard-touching",
    "hard-groove-mu10",
    "hard-painleve-jam",
    "hard-tower-in-um-mg",
    "hard-chain-10",
    "hard-four-bar-redundant",
    "hard-towed-wheel-slides",
    "hard-resisting-sphere-steep",
    "hard-linked-2-axes",
)


def samples() -> list[ContactProblem]:
    """Return problems with 1, 2, 3 or mixed rows per contact, given by factors or G, some redundant or asymmetric."""
    problems = [random_contacts(8, dim) for dim in (1, 2, 3)]
    problems += [three_planar_contacts(), in_delassus_form(random_contacts(8, 3)), asymmetric()]
    return problems + [hard_case(name) for name in _HARD_CASES]


def supported(
    solver: Solver,
    problems: Iterable[ContactProblem] | None = None,
    reason: str = "it supports none of the small problems",
) -> list[ContactProblem]:
    """Return those of ``problems``, or of the samples, that ``solver`` supports.

    Raises:
        NotApplicable: if it supports none; ``reason`` is the message.
    """
    accepted = [
        problem for problem in (samples() if problems is None else problems) if solver.supports(problem) is None
    ]
    if not accepted:
        raise NotApplicable(reason)
    return accepted


def random_contacts(n_contacts: int, dim: int) -> ContactProblem:
    """Return ``n_contacts`` randomly coupled contacts of ``dim`` rows each, given by factors, with a nonsingular G."""
    rng = np.random.default_rng(7)
    n_rows = n_contacts * dim
    directions = rng.normal(size=(n_rows + 16, n_rows)) / np.sqrt(n_rows + 16)
    name = f"{n_contacts} {('frictionless', 'planar', 'spatial')[dim - 1]} contacts"
    free_velocity = rng.normal(size=n_rows)
    return ContactProblem.from_factors(directions, np.ones(n_rows + 16), free_velocity, 0.3, dim=dim, name=name)


def three_planar_contacts() -> ContactProblem:
    """Return three uncoupled planar contacts, for methods that support few contacts."""
    c = np.linspace(-1.0, 1.0, 6)
    return ContactProblem.from_factors(np.eye(6), np.ones(6), c, 0.3, dim=2, name="3 planar contacts")


def in_delassus_form(problem: ContactProblem) -> ContactProblem:
    """Return the same problem with G given instead of its factors."""
    delassus = problem.delassus().toarray()
    return ContactProblem.from_delassus(
        (delassus + delassus.T) / 2, problem.free_velocity, laws=problem.laws, name=f"{problem.name} by G"
    )


def asymmetric() -> ContactProblem:
    """Return planar contacts whose G is not symmetric, as in some public data."""
    delassus = sp.eye_array(6).toarray() + 0.1 * np.triu(np.ones((6, 6)), 1)
    c = np.linspace(-1.0, 1.0, 6)
    name = "3 contacts with asymmetric G"
    return ContactProblem.from_delassus(delassus, c, 0.3, dim=2, allow_asymmetric=True, name=name)


def infeasible() -> ContactProblem:
    """Return two contacts without a solution: the second has G_ii = 0 and c_i < 0."""
    directions = np.array([[1.0, 0.0]])
    return ContactProblem.from_factors(directions, np.ones(1), (-1.0, -1.0), dim=1, name="an immovable contact")


def at_rest(dim: int) -> ContactProblem:
    """Return contacts of ``dim`` rows with c = 0, solved by Λ = 0."""
    return ContactProblem.from_factors(
        np.eye(6), np.ones(6), np.zeros(6), 0.5, dim=dim, name=f"contacts of {dim} rows at rest"
    )


def empty(dim: int) -> ContactProblem:
    """Return a problem without contacts."""
    return ContactProblem.from_factors(np.zeros((3, 0)), np.ones(3), np.zeros(0), 0.5, dim=dim, name="no contacts")
