"""The reduced Newton systems: both forms solve (Ĝ + D) dr = b, and Ĝ is the problem's own matrix in other units."""

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ContactProblem, load
from proxbench.problems.contact.residual import Residual
from proxbench.solvers.interior.scaled_problem import ScaledProblem
from proxbench.solvers.interior.systems.body_system import BodySystem
from proxbench.solvers.interior.systems.delassus_system import DelassusSystem

FORMS = [DelassusSystem, BodySystem]


def scaled(problem: ContactProblem) -> ScaledProblem:
    return ScaledProblem(problem, Residual(problem))


def coupled(n_contacts: int) -> NDArray[np.float64]:
    """Blocks D that are not symmetric, their symmetric part positive definite."""
    random = np.random.default_rng(n_contacts)
    return 2.0 * np.eye(3) + random.uniform(-0.4, 0.4, size=(n_contacts, 3, 3))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["funnel-30", "funnel-planar-30", "funnel-frictionless-30", "pile-100"])
def test_solutions_satisfy_the_system(form: type[DelassusSystem] | type[BodySystem], name: str) -> None:
    problem = load(name)
    width = problem.layout.width
    system = form(problem, scaled(problem))
    d = coupled(problem.n_contacts)
    right = np.zeros((problem.n_contacts, 3))
    right[:, :width] = np.random.default_rng(1).normal(size=(problem.n_contacts, width))
    assert system.factorise(d)
    found = system.solve(right)
    left = system.times(found)
    left[:, :width] += (d[:, :width, :width] @ found[:, :width, None])[:, :, 0]
    assert np.abs(left - right).max() <= 1e-12 * np.abs(right).max()


@pytest.mark.parametrize(("lanes", "expected"), [(2, [1.0, -1.0, 1.0]), (1, [1.0, -1.0])])
def test_both_forms_agree_on_the_sign_of_the_determinant(lanes: int, expected: list[float]) -> None:
    """One or two lanes of one D become negative: det (Ĝ + D) changes its sign once for each of them."""
    problem = load("funnel-30")
    systems = [form(problem, scaled(problem)) for form in FORMS]
    d, seen = coupled(problem.n_contacts), []
    for entry in np.linspace(-0.05, -4.05, 41):
        d[0] = np.diag([entry] * lanes + [1.0] * (3 - lanes))
        assert all(system.factorise(d) for system in systems)
        first, second = (system.determinant_sign() for system in systems)
        assert first == second
        seen.append(first)
    assert [sign for k, sign in enumerate(seen) if k == 0 or sign != seen[k - 1]] == expected


def test_both_forms_give_the_same_product() -> None:
    problem = load("funnel-100")
    r = np.random.default_rng(2).normal(size=(problem.n_contacts, 3))
    products = [form(problem, scaled(problem)).times(r) for form in FORMS]
    assert np.abs(products[0] - products[1]).max() <= 1e-12 * np.abs(products[0]).max()


@pytest.mark.parametrize("form", FORMS)
def test_a_singular_matrix_is_refused(form: type[DelassusSystem] | type[BodySystem]) -> None:
    problem = load("pile-100")  # its contacts overdetermine the bodies
    assert not form(problem, scaled(problem)).factorise(np.full((problem.n_contacts, 3, 3), np.nan))


def test_velocities_and_impulses_in_scaled_units_are_those_of_the_problem() -> None:
    problem = load("funnel-30")
    units = scaled(problem)
    impulses = np.random.default_rng(3).normal(size=problem.n_rows)
    r, u = units.of_impulses(impulses)
    assert np.abs(units.impulses(r) - impulses).max() <= 1e-14 * np.abs(impulses).max()
    reached = DelassusSystem(problem, units).times(r) + units.free_velocity
    reached[:, 0] += np.hypot(reached[:, 1], reached[:, 2])
    assert np.abs(reached - u).max() <= 1e-12 * np.abs(u).max()


@pytest.mark.parametrize("name", ["hard-stack-10-top-1e8", "hard-scaled-rows-15", "hard-sticking-box"])
def test_the_masses_and_units_of_contacts_leave_their_normal_diagonal_entry_near_one(name: str) -> None:
    problem = load(name)
    units = scaled(problem)
    entries = units.velocity_scale[:, 0] * units.impulse_scale[:, 0]
    diagonal = entries * problem.layout.pad(problem.delassus_diagonal)[:, 0]
    assert diagonal.min() > 0.1
    assert diagonal.max() <= 1.0 + 1e-12


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_of_mass_and_time_leave_the_scaled_problem_as_it_is(factor: float) -> None:
    problem = load("funnel-30")
    other = ContactProblem.from_delassus(
        factor * problem.delassus(), factor**2 * problem.free_velocity, laws=problem.laws
    )
    assert np.allclose(scaled(other).free_velocity, scaled(problem).free_velocity, rtol=1e-12, atol=0.0)
    r = np.ones((problem.n_contacts, 3))
    products = [DelassusSystem(one, scaled(one)).times(r) for one in (problem, other)]
    assert np.allclose(products[0], products[1], rtol=1e-10, atol=1e-12)
