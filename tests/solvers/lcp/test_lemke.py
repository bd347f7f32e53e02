"""Lemke's method on contact problems: exact for planar ones, a pyramid for spatial ones, and no false claims."""

import itertools
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, Model, judge, load, suite
from proxbench.problems.contact.residual import Residual
from proxbench.problems.exchange.index import stored_summaries
from proxbench.problems.hard import HARD_CASES, hard_case
from proxbench.problems.hard.families import Family, random_braced_problem
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.lcp.formulation import complementarity
from scipy.sparse.csgraph import connected_components


def speed_difference(problem: ContactProblem, one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference of relative velocities over the largest free velocity."""
    difference = problem.relative_velocity(one) - problem.relative_velocity(other)
    return float(np.abs(difference).max() / np.abs(problem.free_velocity).max())


@pytest.mark.slow
@pytest.mark.parametrize("most", [3, pytest.param(5, marks=pytest.mark.weekly)])
@settings(max_examples=60, deadline=None)
@given(data=st.data(), seed=st.integers(0, 2**31), friction=st.floats(0.0, 1.5))
def test_a_solution_of_lemke_is_among_those_of_enumeration(
    most: int, data: st.DataObject, seed: int, friction: float
) -> None:
    n = data.draw(st.integers(1, most), label="contacts")
    rng = np.random.default_rng(seed)
    problem = ContactProblem.from_factors(
        rng.normal(size=(3 * n, 2 * n)), np.ones(3 * n), rng.normal(size=2 * n), friction, dim=2
    )
    found = solve(problem, "Lemke", tolerance=1e-9)
    known = create("Enumeration").prepare(problem).all_solutions(1e-8)  # type: ignore[attr-defined]
    if found.status is Status.SOLVED:
        scale = max(1.0, float(np.abs(found.impulses).max()))
        assert min(np.abs(found.impulses - other).max() for other in known) <= 1e-6 * scale
    else:
        assert found.message


def test_woodpecker_steps_agree_in_velocity_with_enumeration_sweeps_and_the_conic_fixed_point() -> None:
    for problem in suite("woodpecker"):
        found = solve(problem, "Lemke", tolerance=1e-12)
        assert found.status is Status.SOLVED
        for name, tolerance, agreement in (
            ("Enumeration", 1e-12, 1e-10),
            ("SORprox(relaxation=0.8)", 1e-12, 1e-9),
            ("ClarabelCoulomb", 1e-8, 1e-6),
        ):
            other = solve(problem, name, tolerance=tolerance, max_iterations=100_000)
            assert other.status is Status.SOLVED, name
            assert speed_difference(problem, found.impulses, other.impulses) <= agreement


@pytest.mark.parametrize(
    "name", ["funnel-planar-30", "funnel-planar-100", pytest.param("funnel-planar-300", marks=pytest.mark.slow)]
)
def test_planar_funnel_steps_are_solved_to_rounding_where_sweeps_are_slow(name: str) -> None:
    problem = load(name)
    found = solve(problem, "Lemke", tolerance=1e-12)
    assert found.status is Status.SOLVED
    assert judge(problem, found.impulses).residual <= 1e-12


def test_a_planar_funnel_step_of_unique_motion_agrees_with_sweeps() -> None:
    problem = load("funnel-planar-300")
    found = solve(problem, "Lemke", tolerance=1e-12)
    swept = solve(problem, "SORprox(relaxation=1.5)", tolerance=1e-12, max_iterations=400_000)
    assert swept.status is Status.SOLVED
    assert speed_difference(problem, found.impulses, swept.impulses) <= 1e-9


@cache
def small() -> list[ContactProblem]:
    """Hard cases of at most thirty rows, except for those that Lemke does not support."""
    return [
        problem
        for problem in map(hard_case, (name for name in HARD_CASES if stored_summaries()[name].rows <= 30))
        if not create("Lemke").supports(problem)
    ]


ROUNDED = {
    "hard-stack-10-top-1e8",
    "hard-stack-10-growing-1e8",
    "hard-parallel-friction-1e-3",
}
"""Cases that rounding decides: two beyond double precision, and one with nearly parallel normals and tiny pivots."""


@pytest.mark.parametrize("sides", [3, pytest.param(4, marks=pytest.mark.slow), 8])
def test_hard_cases_are_solved_in_its_model_or_refused_with_a_reason(sides: int) -> None:
    untrue, unsolved = {}, {}
    for problem in small():
        found = solve(problem, create("Lemke", sides=sides), tolerance=1e-8)
        if found.status is Status.SOLVED:
            residual = judge(problem, found.impulses, Model.pyramid(sides)).residual
            if not residual <= 1e-8:
                untrue[problem.name] = residual
        elif problem.name not in ROUNDED:
            unsolved[problem.name] = found.status
    assert untrue == {}
    assert {name for name, status in unsolved.items() if status is not Status.INFEASIBLE} == set()
    assert {name for name in unsolved if name != "hard-squeezed" and not name.startswith("hard-immovable")} == set()


def test_ray_from_a_small_pivot_does_not_prove_infeasibility() -> None:
    for name in ("hard-stack-2-top-1e8", "hard-stack-10-top-1e8"):
        problem = load(name)
        assert problem.answer is not None
        found = solve(problem, "Lemke", tolerance=1e-7)
        assert found.status is Status.SOLVED
        assert found.impulses == pytest.approx(problem.answer.impulses[0], rel=1e-6)
    assert solve(load("hard-squeezed"), "Lemke").status is Status.INFEASIBLE


def test_the_counterexample_that_makes_gauss_seidel_cycle_is_solved_to_rounding() -> None:
    for name in ("hard-counterexample", "hard-counterexample-mu4", "hard-painleve-jam"):
        problem = load(name)
        assert problem.answer is not None
        found = solve(problem, "Lemke", tolerance=1e-13)
        assert min(np.abs(found.impulses - known).max() for known in problem.answer.impulses) <= 1e-13


@pytest.mark.parametrize(("most", "part"), [(16, 3.0), pytest.param(32, 5.0, marks=pytest.mark.weekly)])
def test_the_distance_of_pyramids_from_the_cone_falls_with_their_sides(most: int, part: float) -> None:
    problem = load("funnel-30")
    residuals = []
    for sides in [sides for sides in (4, 8, 16, 32) if sides <= most]:
        found = solve(problem, create("Lemke", sides=sides), tolerance=1e-10)
        assert found.status is Status.SOLVED
        residuals.append(judge(problem, found.impulses).residual)
    assert all(after < before for before, after in itertools.pairwise(residuals))
    assert residuals[-1] < residuals[0] / part


def test_groups_of_contacts_that_do_not_touch_are_solved_one_by_one() -> None:
    one = ContactProblem.from_factors(np.eye(3), np.ones(3), (-1.0, 0.4, -0.3), 0.3)
    many = ContactProblem.from_factors(np.eye(60), np.ones(60), np.tile((-1.0, 0.4, -0.3), 20), 0.3)
    prepared = create("Lemke").prepare(many)
    assert len(prepared.groups) == 20  # type: ignore[attr-defined]
    alone = solve(one, "Lemke", tolerance=1e-12).impulses
    assert prepared.solve(Stop(1e-12)).impulses == pytest.approx(np.tile(alone, 20), abs=1e-15)


def test_inseparable_frictionless_contacts_are_proved_infeasible() -> None:
    """A massless wedge between two walls that close: G = [[1, −1], [−1, 1]]."""
    problem = ContactProblem.from_delassus(np.array([[1.0, -1.0], [-1.0, 1.0]]), (-1.0, -1.0), dim=1)
    found = solve(problem, "Lemke")
    assert found.status is Status.INFEASIBLE
    assert "ray" in found.message


def test_a_friction_law_bounded_by_a_contact_elsewhere_is_solved() -> None:
    laws = Laws(
        np.array([0, 0, 1, 2]),
        np.array([0, 1, 2, 3]),
        np.array([0.0, 0.0, 0.4, 0.2]),
        np.array([0.0, 0.0, 0.0, 0.1]),
        np.array([-1, -1, 0, 1]),
    )
    problem = ContactProblem.from_delassus(np.eye(5), (-1.0, -2.0, 3.0, 0.9, 0.0), laws=laws)
    found = solve(problem, create("Lemke", sides=4), tolerance=1e-12)
    assert found.status is Status.SOLVED
    assert found.impulses == pytest.approx([1.0, 2.0, -0.4, -0.5, 0.0], abs=1e-14)


def test_limits_are_respected_and_reported() -> None:
    problem = load("funnel-30")
    few = solve(problem, "Lemke", tolerance=1e-6, max_iterations=10)
    assert (few.status, few.iterations) == (Status.ITERATION_LIMIT, 10)
    late = solve(problem, "Lemke", tolerance=1e-6, max_seconds=1e-9)
    assert late.status is Status.TIME_LIMIT
    assert np.isfinite(late.impulses).all()


@pytest.mark.parametrize("sides", [2, 0, -4, 2.5])
def test_fewer_than_three_sides_are_refused(sides: float) -> None:
    with pytest.raises(SolverError, match="whole number of at least 3"):
        create("Lemke", sides=sides)


def test_a_group_too_large_for_a_tableau_is_refused_with_its_size() -> None:
    """The size is computed without the formulation, which would exceed the time limit of ``supports``."""
    problem = load("funnel-1000")
    reason = create("Lemke", sides=8).supports(problem)
    matrix = complementarity(problem, Residual(problem), 8).matrix
    _, group = connected_components(matrix, directed=False)
    assert reason is not None
    assert reason.startswith(f"a group of {np.bincount(group).max()} unknowns is coupled")


@pytest.mark.parametrize("seed", [1, 372, 927, 1325, 1550, 2914, 2962])
def test_ray_at_the_rounding_limit_does_not_prove_infeasibility(seed: int) -> None:
    """A solution exists, because c = −G (λ, 0); paths over opposite contacts may still end on rays by rounding."""
    if seed == 1:
        family = Family(n_contacts=6, dim=2, n_dofs=6, mass_exponent=4, density=1.0, friction=0.0)
    else:
        rng = np.random.default_rng(seed)
        n_contacts, dim, n_dofs, mass_exponent = (int(rng.integers(*ends)) for ends in ((1, 8), (1, 4), (1, 9), (0, 7)))
        family = Family(n_contacts, dim, n_dofs, mass_exponent, 1.0, 0.0)
    assert solve(random_braced_problem(family, seed), "Lemke", tolerance=1e-6).status in (Status.SOLVED, Status.STALLED)
