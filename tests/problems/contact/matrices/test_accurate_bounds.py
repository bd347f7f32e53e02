"""The error bound of an accurate velocity holds, even if products underflow, and is as small as documented."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from exact_residual import exact_velocity
from proxbench.problems import ContactProblem

UNIT = Fraction(2.0**-53)


def is_within_bound(problem: ContactProblem, impulses: np.ndarray) -> bool:
    """Whether |ξ̂ − ξ| ≤ u|ξ| + h in every row."""
    found = zip(*problem.accurate_velocity(impulses), exact_velocity(problem, impulses), strict=True)
    return all(abs(Fraction(one) - exact) <= UNIT * abs(exact) + Fraction(hidden) for one, hidden, exact in found)


@pytest.mark.parametrize(
    ("impulse", "pushed", "inverse_mass", "seen"),
    [(-530, -530, 200, 0), (-300, -300, -460, 200), (-300, -300, -100, -360), (-300, -300, -460, 0)],
    ids=["W Λ", "M⁻¹ W Λ", "Wᵀ M⁻¹ W Λ", "the last two"],
)
def test_the_bound_covers_each_product_that_underflows(impulse: int, pushed: int, inverse_mass: int, seen: int) -> None:
    """One row pushes a body and another measures its velocity; products of powers of two are exact."""
    rng = np.random.default_rng(0)
    for mantissas in np.where(rng.random((20, 4)) < 0.5, 1.0, rng.uniform(1.0, 2.0, (20, 4))):
        factors = mantissas * 2.0 ** np.array([impulse, pushed, inverse_mass, seen])
        problem = ContactProblem.from_factors(factors[None, [1, 3]], factors[[2]], np.zeros(2), dim=1)
        assert is_within_bound(problem, np.array([factors[0], 0.0]))
        matrix = np.array([[1.0, factors[1]], [factors[1], 1.0]])
        assert is_within_bound(ContactProblem.from_delassus(matrix, np.zeros(2), dim=1), np.array([factors[0], 0.0]))


def random_problem(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return W, M⁻¹ and Λ."""
    n, dofs = rng.integers(1, 5), rng.integers(1, 4)
    root = rng.normal(size=(dofs, dofs))
    directions = rng.normal(size=(dofs, n)) * (rng.random((dofs, n)) < 0.8)
    return directions, root @ root.T + np.eye(dofs), rng.normal(size=n)


def braced(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a problem with a copy of every row, in another order, and with opposite impulses: WΛ = 0."""
    directions, inverse, impulses = random_problem(rng)
    order = rng.permutation(len(impulses))
    return np.hstack([directions, directions[:, order]]), inverse, np.append(impulses, -impulses[order])


def mirrored(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a problem with a copy of every body and rows between both, in which they do not move: Wᵀ M⁻¹ W Λ = 0."""
    directions, inverse, impulses = random_problem(rng)
    order, between = rng.permutation(len(inverse)), rng.normal(size=directions.shape)
    none = np.zeros_like(inverse)
    of_bodies = np.block([[directions, between], [directions[order], -between[order]]])
    of_both = np.block([[inverse, none], [none, inverse[order][:, order]]])
    return of_bodies, of_both, np.append(impulses, 0.0 * impulses)


@pytest.mark.parametrize("create", [random_problem, braced, mirrored])
def test_the_bound_holds_where_sums_cancel_and_is_that_of_twice_the_precision(
    create: Callable[[np.random.Generator], tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> None:
    """h ≤ (N ε)² (|Wᵀ| |M⁻¹| |W| |Λ| + |c|), with N the terms of the longest rows and a few more."""
    rng = np.random.default_rng(0)
    for _ in range(15):
        directions, inverse, impulses = create(rng)
        (dofs, n), c = directions.shape, rng.choice([1.0, 1e-40]) * rng.normal(size=len(impulses))
        by_factors = ContactProblem.from_factors(directions, inverse, c, dim=1)
        by_matrix = ContactProblem.from_delassus(by_factors.delassus(), c, dim=1)
        pushed = np.abs(directions) @ np.abs(impulses)
        sizes = np.abs(directions).T @ np.abs(inverse) @ pushed, np.abs(by_matrix.delassus()) @ np.abs(impulses)
        for problem, size in zip((by_factors, by_matrix), sizes, strict=True):
            assert is_within_bound(problem, impulses)
            precision = (n + dofs + n + 8) * 2.0**-52
            assert (problem.accurate_velocity(impulses)[1] <= precision**2 * (size + np.abs(c))).all()
