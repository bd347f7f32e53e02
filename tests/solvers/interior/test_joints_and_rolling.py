"""Interior points support joints, even redundant ones, and rolling resistance about any number of axes."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, judge, load
from proxbench.problems.contact.transformations import in_units
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem
from proxbench.solvers import Status, Stop, create, solve

JOINTS = ["InteriorPoint", "InteriorPoint(form='factors')", "CentralPath", "CentralPath(form='factors')"]


def joints(n_rows: int, n_dofs: int) -> ContactProblem:
    rng = np.random.default_rng(n_dofs)
    directions = rng.normal(size=(n_dofs, n_rows))
    free = directions.T @ rng.normal(size=n_dofs)
    return ContactProblem.from_factors(directions, np.ones(n_dofs), free, laws=Laws.joints(n_rows))


@pytest.mark.parametrize("solver", JOINTS)
def test_impulses_of_joints_alone_solve_a_linear_system(solver: str) -> None:
    problem = joints(4, 9)
    solution = solve(problem, solver, tolerance=1e-10)
    assert solution.status is Status.SOLVED
    expected = np.linalg.solve(problem.delassus().toarray(), -problem.free_velocity)
    assert solution.impulses == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("solver", JOINTS)
@pytest.mark.parametrize("name", ["hard-four-bar-redundant-20", "hard-pendulum-copies-8", "hard-chain-10-bottom-1e4"])
def test_redundant_joints_and_heavy_chains_agree_with_their_known_answers(solver: str, name: str) -> None:
    problem = load(name)
    solution = solve(problem, solver, tolerance=1e-9)
    assert solution.status is Status.SOLVED
    assert problem.answer is not None
    velocity = problem.relative_velocity(solution.impulses)
    error = problem.answer.error(solution.impulses, velocity, np.abs(problem.free_velocity).max())
    assert error is not None
    assert error <= 1e-9 * problem.answer.sensitivity


@pytest.mark.parametrize("solver", JOINTS)
def test_contradicting_joints_are_proved_infeasible(solver: str) -> None:
    problem = ContactProblem.from_factors([[1.0, 1.0]], [1.0], [1.0, -1.0], laws=Laws.joints(2))
    assert solve(problem, solver, max_iterations=500).status is Status.INFEASIBLE


@pytest.mark.parametrize(
    "name",
    [
        "hard-resisting-sphere-above",
        "hard-resisting-sphere-1-axes",
        "hard-resisting-sphere-3-axes",
        "hard-slowing-sphere-stops",
        "hard-slowing-sphere-rolls-on",
        "hard-towed-wheel-stays",
        "hard-towed-wheel-slides",
        "hard-linked-3-axes",
    ],
)
def test_bodies_with_rolling_friction_agree_with_their_known_answers(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "InteriorPoint", tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-8
    assert problem.answer is not None
    velocity = problem.relative_velocity(solution.impulses)
    error = problem.answer.error(solution.impulses, velocity, np.abs(problem.free_velocity).max())
    assert error is None or error <= 1e-8 * problem.answer.sensitivity


def test_a_pile_that_resists_rolling_takes_no_more_steps_than_one_that_does_not() -> None:
    plain, rolling = (solve(load(name), "InteriorPoint", tolerance=1e-8) for name in ("pile-100", "pile-100-rolling"))
    assert plain.status is rolling.status is Status.SOLVED
    assert rolling.iterations <= 1.5 * plain.iterations


def test_rolling_rows_without_resistance_have_no_impulse() -> None:
    problem = random_linked_problem(LinkedFamily(4, 3, 40, rolling_rows=2, rolling_friction=0.0), 1)
    solution = solve(problem, "InteriorPoint", tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert np.array_equal(solution.impulses[problem.laws.first_row[problem.laws.is_rolling]], np.zeros(4))


@pytest.mark.parametrize("fixed", [0.0, 0.1])
def test_a_fixed_part_of_the_bound_adds_to_what_the_normal_impulse_gives(fixed: float) -> None:
    """With G = I, Λ_N = 2, and sliding and rolling are stopped as far as μ Λ_N and a + μ_r Λ_N allow."""
    laws = Laws.in_order([0, 1, 4], np.array([0.0, 0.5, 0.25]), np.array([0.0, 0.0, fixed]), np.array([-1, 0, 0]))
    problem = ContactProblem.from_delassus(np.eye(3), (-2.0, 3.0, 1.0), laws=laws)
    solution = solve(problem, "InteriorPoint", tolerance=1e-10)
    assert solution.impulses == pytest.approx([2.0, -1.0, -0.5 - fixed], abs=1e-8)


def test_the_unit_of_length_leaves_the_steps_as_they_are() -> None:
    problem = load("hard-linked-2-axes")
    other = in_units(problem, length=1e3)
    reached = [create("InteriorPoint").prepare(one).solve(Stop(1e-12, 6)) for one in (problem, other.problem)]
    assert other.impulses(reached[1].impulses) == pytest.approx(reached[0].impulses, rel=1e-6, abs=1e-9)


def test_a_start_near_the_answer_takes_fewer_steps_than_a_cold_one() -> None:
    prepared = create("InteriorPoint").prepare(load("hard-linked-2-axes"))
    cold = prepared.solve(Stop(1e-6, 200))
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, len(cold.impulses))
    warm = prepared.solve(Stop(1e-6, 200), cold.impulses * (1.0 + 1e-3 * noise))
    assert warm.status is Status.SOLVED
    assert warm.iterations < cold.iterations
