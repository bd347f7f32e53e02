"""ClarabelSOCP solves the associated law and never claims Coulomb friction."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, Model, judge
from proxbench.solvers import Status, Stop, create, solve


def block_on_ground(pull: float, friction: float = 0.3) -> ContactProblem:
    """A unit point mass pressed down by 1 m/s and pulled along the ground by ``pull`` m/s."""
    return ContactProblem.from_delassus(np.eye(3), (-1.0, pull, 0.0), friction)


def test_sliding_contact_separates_according_to_the_associated_law() -> None:
    """−ξ ∈ N_K(Λ) on the boundary of K: ξ_N = μ‖ξ_T‖; by hand Λ_N = (1 + μ v)/(1 + μ²) with Λ_T = −μ Λ_N."""
    friction, pull = 0.3, 5.0
    solution = solve(block_on_ground(pull, friction), "ClarabelSOCP", tolerance=1e-9)
    normal = (1.0 + friction * pull) / (1.0 + friction**2)
    assert solution.status is Status.SOLVED
    assert solution.impulses == pytest.approx([normal, -friction * normal, 0.0], abs=1e-7)
    velocity = block_on_ground(pull, friction).relative_velocity(solution.impulses)
    assert velocity[0] == pytest.approx(friction * np.hypot(velocity[1], velocity[2]), abs=1e-7)


def test_its_solution_of_a_sliding_problem_is_not_a_coulomb_solution() -> None:
    problem = block_on_ground(5.0)
    impulses = solve(problem, "ClarabelSOCP", tolerance=1e-9).impulses
    assert create("ClarabelSOCP").model == Model.CONVEX
    assert judge(problem, impulses, Model.CONVEX).residual <= 1e-9
    assert judge(problem, impulses).residual > 0.1


def test_sticking_contacts_obey_both_laws() -> None:
    problem = block_on_ground(0.2)
    impulses = solve(problem, "ClarabelSOCP", tolerance=1e-9).impulses
    assert impulses == pytest.approx([1.0, -0.2, 0.0], abs=1e-8)
    assert judge(problem, impulses).residual <= 1e-8


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_without_friction_it_agrees_with_projected_gauss_seidel_in_velocity(dim: int) -> None:
    rng = np.random.default_rng(dim)
    root = rng.normal(size=(30, 8 * dim))
    problem = ContactProblem.from_delassus(root.T @ root, rng.normal(size=8 * dim), 0.0, dim=dim)
    conic = solve(problem, "ClarabelSOCP", tolerance=1e-10)
    swept = solve(problem, "SORprox", tolerance=1e-12)
    assert conic.status is Status.SOLVED
    assert swept.status is Status.SOLVED
    assert problem.relative_velocity(conic.impulses) == pytest.approx(
        problem.relative_velocity(swept.impulses), abs=1e-8
    )


def test_fixed_friction_bounds_are_exact_because_they_are_convex() -> None:
    """A joint with dry friction a = 0.2, pushed by 1 m/s: Λ = −0.2; pushed by 0.1 m/s: it holds with Λ = −0.1."""
    laws = Laws(np.array([1, 1]), np.array([0, 1]), np.zeros(2), np.array([0.2, 0.2]), np.array([-1, -1]))
    problem = ContactProblem.from_delassus(np.eye(2), (1.0, 0.1), laws=laws)
    solution = solve(problem, "ClarabelSOCP", tolerance=1e-9)
    assert solution.impulses == pytest.approx([-0.2, -0.1], abs=1e-8)
    assert judge(problem, solution.impulses).residual <= 1e-8


def test_friction_bounded_by_another_contact_is_declined_with_the_reason() -> None:
    laws = Laws(np.array([0, 0, 1]), np.arange(3), np.array([0, 0, 0.5]), np.zeros(3), np.array([-1, -1, 0]))
    problem = ContactProblem.from_delassus(np.eye(3), np.ones(3), laws=laws)
    reason = create("ClarabelSOCP").supports(problem)
    assert reason is not None
    assert "friction law 2" in reason


def test_units_do_not_change_the_answer() -> None:
    problem = block_on_ground(5.0)
    impulses = solve(problem, "ClarabelSOCP", tolerance=1e-9).impulses
    for mass, speed in ((1e-9, 1e-3), (1e6, 1e3)):
        scaled = ContactProblem.from_delassus(np.eye(3) / mass, speed * problem.free_velocity, 0.3)
        solution = create("ClarabelSOCP").prepare(scaled).solve(Stop(1e-9))
        assert solution.impulses / (mass * speed) == pytest.approx(impulses, abs=1e-7)


def test_an_iteration_limit_is_reported() -> None:
    solution = create("ClarabelSOCP").prepare(block_on_ground(5.0)).solve(Stop(1e-9, max_iterations=2))
    assert solution.status is Status.ITERATION_LIMIT
    assert np.isfinite(solution.impulses).all()


def test_no_iteration_is_done_if_none_is_allowed() -> None:
    solution = create("ClarabelSOCP").prepare(block_on_ground(5.0)).solve(Stop(1e-9, max_iterations=0))
    assert (solution.status, solution.iterations) == (Status.ITERATION_LIMIT, 0)


def test_a_time_limit_is_not_called_an_iteration_limit() -> None:
    """Clarabel itself has at least 1 ms, so that its run may end by itself after the limit of the solve."""
    solution = create("ClarabelSOCP").prepare(block_on_ground(5.0)).solve(Stop(1e-17, max_seconds=1e-6))
    assert solution.status is Status.TIME_LIMIT
