"""Random problems have the exact solution from which they are constructed."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import judge
from proxbench.problems.hard.families import (
    STATES,
    Family,
    LinkedFamily,
    random_braced_problem,
    random_linked_problem,
    random_problem,
    random_spectrum_problem,
    single_precision,
)


@st.composite
def families(draw: Any) -> Family:
    return Family(
        n_contacts=draw(st.integers(1, 12)),
        dim=draw(st.integers(1, 3)),
        n_dofs=draw(st.integers(1, 40)),
        mass_exponent=draw(st.integers(0, 12)),
        density=draw(st.sampled_from([0.1, 0.5, 1.0])),
        friction=draw(st.sampled_from([0.0, 0.125, 0.5, 1.0, 10.0])),
        states=tuple(draw(st.lists(st.sampled_from(STATES), min_size=1, unique=True))),
    )


@given(family=families(), seed=st.integers(0, 2**32 - 1), is_braced=st.booleans())
def test_the_chosen_solution_solves_exactly(family: Family, seed: int, is_braced: bool) -> None:
    problem = (random_braced_problem if is_braced else random_problem)(family, seed)
    answer = problem.answer
    assert answer is not None
    assert answer.witness is not None
    assert judge(problem, answer.witness).residual <= 1e-13
    velocity = problem.relative_velocity(answer.witness)
    assert velocity.tolist() == [float(value) for value in exact_velocity(problem, answer.witness.tolist())]
    if answer.velocity is not None:
        assert np.array_equal(velocity, answer.velocity)


@pytest.mark.slow
@given(
    family=families(),
    joints=st.integers(0, 5),
    rolling_rows=st.integers(0, 3),
    rolling=st.sampled_from([0.0, 0.125, 1.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_chosen_solution_solves_problems_with_joints_and_rolling_exactly(
    family: Family, joints: int, rolling_rows: int, rolling: float, seed: int
) -> None:
    linked = LinkedFamily(**vars(family), n_joints=joints, rolling_rows=rolling_rows, rolling_friction=rolling)
    problem = random_linked_problem(linked, seed)
    assert problem.answer is not None
    assert problem.answer.witness is not None
    assert judge(problem, problem.answer.witness).residual <= 1e-13
    velocity = problem.relative_velocity(problem.answer.witness)
    assert velocity.tolist() == [float(value) for value in exact_velocity(problem, problem.answer.witness.tolist())]


def exact_velocity(problem: Any, impulses: list[float]) -> list[Fraction]:
    """ξ = Wᵀ M⁻¹ W Λ + c in rational arithmetic."""
    directions = [[Fraction(v) for v in row] for row in problem.factors.force_directions.toarray().tolist()]
    inverse_mass = [Fraction(v) for v in problem.factors.inverse_mass.matrix.diagonal().tolist()]
    given = [Fraction(v) for v in impulses]
    motion = [
        m * sum((w * v for w, v in zip(row, given, strict=True)), Fraction(0))
        for row, m in zip(directions, inverse_mass, strict=True)
    ]
    return [
        sum((row[i] * u for row, u in zip(directions, motion, strict=True)), Fraction(c))
        for i, c in enumerate(problem.free_velocity.tolist())
    ]


def test_rank_spectrum_and_sparsity_are_as_chosen() -> None:
    eigenvalues = np.array([1e-4, 1e-2, 1.0, 1.0, 0.0, 0.0])
    found = np.linalg.eigvalsh(random_spectrum_problem(eigenvalues, 3, 0.5, 1).delassus().toarray())
    assert found == pytest.approx(np.sort(eigenvalues), abs=1e-14)
    problem = random_problem(Family(20, 3, n_dofs=30, density=0.1), 1)
    assert problem.factors is not None
    assert np.linalg.matrix_rank(problem.delassus().toarray()) <= 30
    assert problem.factors.force_directions.nnz <= 0.2 * 30 * 60
    assert (problem.delassus_diagonal > 0).all()


def test_random_matrices_are_exact_in_single_precision() -> None:
    family = Family(6, 3, n_dofs=20, friction=0.25)
    assert np.array_equal(
        single_precision(family, 3).delassus().toarray(), random_problem(family, 3).delassus().toarray()
    )


def test_every_state_occurs() -> None:
    problem = random_problem(Family(200, 3, n_dofs=20), 0)
    assert problem.answer is not None
    assert problem.answer.witness is not None
    impulses, velocity = (
        v.reshape(-1, 3) for v in (problem.answer.witness, problem.relative_velocity(problem.answer.witness))
    )
    closed, moving = impulses[:, 0] > 0, np.linalg.norm(velocity[:, 1:], axis=1) > 0
    at_bound = np.isclose(np.linalg.norm(impulses[:, 1:], axis=1), 0.5 * impulses[:, 0])
    seen = {
        "open": ~closed & (velocity[:, 0] > 0),
        "graze": ~closed & (velocity[:, 0] == 0),
        "stick": closed & ~moving & ~at_bound,
        "slip": closed & moving & at_bound,
        "edge": closed & ~moving & at_bound,
    }
    assert set(seen) == set(STATES)
    assert all(mask.any() for mask in seen.values())
    assert sum(mask.sum() for mask in seen.values()) == 200
