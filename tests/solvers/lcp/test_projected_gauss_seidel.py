"""Projected Gauss–Seidel over scalar laws solves the pyramid model, and the exact one in the plane."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Model, judge, load
from proxbench.problems.contact.projections import onto_polygon
from proxbench.solvers import SolverError, Status, Stop, create, solve


@pytest.mark.parametrize("sides", [4, 6, 8, 16])
def test_it_reaches_the_velocities_of_pivoting(sides: int) -> None:
    problem = load("funnel-30")
    swept = solve(problem, create("PyramidPGS", sides=sides), tolerance=1e-10, max_iterations=100_000)
    pivoted = solve(problem, create("Lemke", sides=sides), tolerance=1e-12)
    assert swept.status is Status.SOLVED
    difference = problem.relative_velocity(swept.impulses) - problem.relative_velocity(pivoted.impulses)
    assert np.abs(difference).max() <= 1e-7 * np.abs(problem.free_velocity).max()


@pytest.mark.parametrize("sides", [4, 6, 10])
def test_an_uncoupled_contact_gets_the_projection_onto_its_polygon(sides: int) -> None:
    """G = I: Λ_T = proj(−c_T) onto the k-gon of radius μ Λ_N."""
    rng = np.random.default_rng(1)
    tangent = rng.normal(size=(50, 2))
    free = np.column_stack([-np.ones(50), tangent]).ravel()
    problem = ContactProblem.from_factors(np.eye(150), np.ones(150), free, 0.7)
    found = solve(problem, create("PyramidPGS", sides=sides), tolerance=1e-13, max_iterations=10_000)
    expected = onto_polygon(-tangent, np.full(50, 0.7), sides)
    assert found.impulses.reshape(-1, 3)[:, 1:] == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("name", ["funnel-planar-100", "funnel-frictionless-100"])
def test_without_spatial_friction_its_iterates_are_those_of_sorprox(name: str) -> None:
    problem = load(name)
    stop = Stop(1e-12, 57)
    swept = create("SORprox").prepare(problem).solve(stop)
    assert np.array_equal(create("PyramidPGS").prepare(problem).solve(stop).impulses, swept.impulses)


def test_mixed_planar_spatial_and_remote_laws_are_solved_in_its_model() -> None:
    problem = load("hard-mixed-laws")
    found = solve(problem, "PyramidPGS", tolerance=1e-10)
    assert found.status is Status.SOLVED
    assert judge(problem, found.impulses, Model.pyramid(8)).residual <= 1e-10


def test_a_warm_start_is_distributed_over_the_segments() -> None:
    problem = load("funnel-100")
    prepared = create("PyramidPGS").prepare(problem)
    solution = prepared.solve(Stop(1e-6)).impulses
    assert prepared.solve(Stop(1e-9, 1), start=solution).iterations == 1
    after_one = prepared.solve(Stop(1e-9, 1), start=solution).impulses
    assert judge(problem, after_one, Model.pyramid(8)).residual <= 1e-3


@pytest.mark.parametrize("options", [{"sides": 5}, {"sides": 2}, {"sides": 4.0}, {"relaxation": 0.0}])
def test_options_out_of_range_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(SolverError):
        create("PyramidPGS", **options)
