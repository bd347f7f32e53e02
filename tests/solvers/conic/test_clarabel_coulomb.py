"""The fixed point over cone programs gives Coulomb friction, not the associated law."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, judge, load
from proxbench.solvers import SolverError, Status, Stop, create, solve

FORMS = ["delassus", "factors"]


def sliding_block(pull: float, friction: float = 0.3) -> ContactProblem:
    """A unit point mass pressed down by 1 m/s and pulled along the ground by ``pull`` m/s."""
    return ContactProblem.from_factors(np.eye(3), np.ones(3), (-1.0, pull, 0.0), friction)


@pytest.mark.parametrize("form", FORMS)
def test_a_sliding_contact_stays_closed(form: str) -> None:
    """By hand: Λ_N = 1, Λ_T = −μ, ξ = (0, v − μ, 0); the associated law would separate with ξ_N = μ‖ξ_T‖."""
    problem = sliding_block(5.0)
    solution = solve(problem, f"ClarabelCoulomb(form={form!r})", tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert solution.impulses == pytest.approx([1.0, -0.3, 0.0], abs=1e-7)
    assert problem.relative_velocity(solution.impulses) == pytest.approx([0.0, 4.7, 0.0], abs=1e-7)


@pytest.mark.parametrize("memory", [0, 5])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["funnel-30-early", "funnel-30", "woodpecker-beak-impact"])
def test_it_agrees_with_projected_gauss_seidel_in_velocity(name: str, form: str, memory: int) -> None:
    problem = load(name)
    conic = create("ClarabelCoulomb", form=form, memory=memory).prepare(problem).solve(Stop(1e-6, 200))
    swept = create("SORprox", relaxation=1.5).prepare(problem).solve(Stop(1e-11, 100_000))
    assert conic.status is Status.SOLVED
    assert swept.status is Status.SOLVED
    assert judge(problem, conic.impulses).residual <= 1e-6
    scale = float(np.abs(problem.free_velocity).max())
    difference = problem.relative_velocity(conic.impulses) - problem.relative_velocity(swept.impulses)
    assert np.abs(difference).max() <= 1e-4 * scale


def test_acceleration_needs_fewer_cone_programs() -> None:
    problem = load("funnel-100")
    counts = [
        create("ClarabelCoulomb", memory=memory).prepare(problem).solve(Stop(1e-6, 200)).iterations for memory in (0, 5)
    ]
    assert counts[1] < counts[0]


def test_a_new_right_hand_side_is_the_same_as_a_new_set_up() -> None:
    """An earlier solve to 1e-4 has no effect: the updates replace all data that differ."""
    problem = load("funnel-30")
    used = create("ClarabelCoulomb").prepare(problem)
    used.solve(Stop(1e-4, 200))
    again, fresh = used.solve(Stop(1e-6, 200)), create("ClarabelCoulomb").prepare(problem).solve(Stop(1e-6, 200))
    assert again.iterations == fresh.iterations
    assert again.impulses == pytest.approx(fresh.impulses, rel=1e-6, abs=1e-9)


def test_every_outer_iteration_is_observed() -> None:
    problem = load("funnel-30-early")
    seen: list[tuple[int, np.ndarray]] = []
    solution = (
        create("ClarabelCoulomb")
        .prepare(problem)
        .solve(Stop(1e-6, 200), observe=lambda iteration, impulses: seen.append((iteration, impulses)))
    )
    assert [iteration for iteration, _ in seen] == list(range(1, solution.iterations + 1))
    assert not seen[0][1].flags.writeable
    assert np.array_equal(seen[-1][1], solution.impulses)


def test_a_start_at_the_solution_needs_no_cone_program() -> None:
    problem = load("funnel-30-early")
    prepared = create("ClarabelCoulomb").prepare(problem)
    solution = prepared.solve(Stop(1e-6, 200))
    again = prepared.solve(Stop(1e-6, 200), start=solution.impulses)
    assert again.iterations == 0
    assert np.array_equal(again.impulses, solution.impulses)


def test_the_factor_form_declines_fixed_bounds_with_the_reason() -> None:
    laws = Laws(np.array([1]), np.array([0]), np.zeros(1), np.array([0.2]), np.array([-1]))
    problem = ContactProblem.from_factors(np.eye(1), np.ones(1), (1.0,), laws=laws)
    reason = create("ClarabelCoulomb", form="factors").supports(problem)
    assert reason is not None
    assert "fixed bound" in reason
    assert solve(problem, "ClarabelCoulomb", tolerance=1e-8).impulses == pytest.approx([-0.2], abs=1e-8)


@pytest.mark.parametrize("options", [{"form": "dual"}, {"memory": -1}, {"memory": 2.5}, {"memory": True}])
def test_error_names_the_invalid_option(options: dict[str, object]) -> None:
    with pytest.raises(SolverError, match=next(iter(options))):
        create("ClarabelCoulomb", **options)


def test_empty_and_motionless_problems_need_no_cone_program() -> None:
    for problem in (
        ContactProblem.from_delassus(np.zeros((0, 0)), np.zeros(0)),
        ContactProblem.from_delassus(np.eye(3), np.zeros(3), 0.3),
    ):
        solution = solve(problem, "ClarabelCoulomb")
        assert solution.status is Status.SOLVED
        assert solution.iterations == 0
