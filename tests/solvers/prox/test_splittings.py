"""Splittings and gradient methods over cones agree with other methods, and do not support other laws."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, Model, judge, load
from proxbench.solvers import Status, create, solve
from proxbench.solvers.sweeps.cone import ConeProblem

COULOMB = ["ProximalADMM", "ProximalADMM(memory=0)", "ProximalPoint"]
OVER_CONES = ["ProximalADMM", "APGD"]


def slider(friction: float) -> ContactProblem:
    """A point of 2 kg slides at 1 m/s on the ground, and a normal impulse of 0.5 N s presses it down."""
    return ContactProblem.from_factors(np.eye(3), np.full(3, 0.5), [-0.25, 0.6, -0.8], friction)


@pytest.mark.parametrize("name", COULOMB)
def test_a_sliding_point_is_braked_by_mu_times_its_normal_impulse_and_does_not_lift_off(name: str) -> None:
    solution = solve(slider(0.3), name, tolerance=1e-9)
    assert solution.status is Status.SOLVED
    assert solution.impulses == pytest.approx([0.5, -0.3 * 0.5 * 0.6, 0.3 * 0.5 * 0.8], abs=1e-8)


@pytest.mark.parametrize("name", [*COULOMB, "APGD", "SAP"])
def test_point_within_the_friction_limit_stops(name: str) -> None:
    """Both models agree here: −ξ = 0 lies in every normal cone."""
    solution = solve(slider(5.0), name, tolerance=1e-9)
    assert solution.impulses == pytest.approx([0.5, -1.2, 1.6], abs=1e-7)


@pytest.mark.parametrize("name", ["APGD", "SAP"])
def test_methods_for_the_convex_model_lift_a_sliding_point_off(name: str) -> None:
    """With G = I/2 the associated answer is the projection of −2c onto the cone, and ξ_N = μ‖ξ_T‖."""
    problem = slider(0.3)
    solution = solve(problem, name, tolerance=1e-10)
    velocity = problem.relative_velocity(solution.impulses)
    assert velocity[0] == pytest.approx(0.3 * np.hypot(velocity[1], velocity[2]), abs=1e-8)
    assert judge(problem, solution.impulses, Model.CONVEX).residual <= 1e-9


@pytest.mark.parametrize("name", ["ProximalADMM", "ProximalPoint"])
def test_splitting_methods_reach_the_velocities_of_sweeps_on_a_flow(name: str) -> None:
    problem = load("funnel-30-early")
    solution, swept = (solve(problem, each, tolerance=1e-9) for each in (name, "NSGS"))
    assert solution.status is Status.SOLVED
    difference = problem.relative_velocity(solution.impulses) - problem.relative_velocity(swept.impulses)
    assert np.abs(difference).max() <= 1e-6 * np.abs(problem.free_velocity).max()


@pytest.mark.parametrize("name", OVER_CONES)
def test_friction_that_another_contact_bounds_is_declined(name: str) -> None:
    laws = Laws.in_order([0, 0, 1], np.array([0.0, 0.0, 0.5]), np.zeros(3), np.array([-1, -1, 0]))
    problem = ContactProblem.from_delassus(np.eye(3), [-1.0, -1.0, 0.2], laws=laws)
    assert "has no friction cone" in str(create(name).supports(problem))


def test_acceleration_saves_most_passes_where_masses_differ() -> None:
    problem = load("hard-stack-10-top-heavy")
    fast, slow = (solve(problem, name, max_iterations=2000) for name in ("ProximalADMM", "ProximalADMM(memory=0)"))
    assert fast.status is Status.SOLVED
    assert 5 * fast.iterations < slow.iterations


def test_regularisation_solves_a_problem_on_which_newton_alone_diverges() -> None:
    problem = load("hard-duplicated-slider-mu10")
    solution = solve(problem, "ProximalPoint", tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-8


def test_units_of_contacts_make_the_diagonal_one_and_keep_every_velocity() -> None:
    problem = load("hard-tower-10-top-1e4")
    cone = ConeProblem.of(problem)
    impulses = np.random.default_rng(1).uniform(size=problem.n_rows)
    velocity = cone.matrix @ (impulses / cone.size) + cone.free
    assert cone.layout.pad(cone.matrix.diagonal()).max(axis=1) == pytest.approx(1.0)
    assert velocity / cone.size == pytest.approx(problem.relative_velocity(impulses), rel=1e-9, abs=1e-12)
