"""InteriorPoint: known answers under every law, Newton's speed at the end, and true statuses."""

import itertools
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.laws import Laws
from proxbench.problems.contact.transformations import in_units
from proxbench.problems.hard.families import Family, random_problem
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.interior.progress import proves_infeasibility
from threadpoolctl import threadpool_limits


@pytest.mark.parametrize(
    "name",
    [
        "hard-supports-32",
        "hard-sticking-box",
        "hard-counterexample",
        "hard-painleve-jam",
        "hard-tresca-joint",
        "hard-scaled-rows-3",
        "hard-remote-partner",
        "hard-resting-block-mu10",
        "hard-groove-frictionless",
    ],
)
def test_known_answers_are_met_under_every_law(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "InteriorPoint", tolerance=1e-6)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-6
    assert problem.answer is not None
    error = problem.answer.error(
        solution.impulses, problem.relative_velocity(solution.impulses), np.abs(problem.free_velocity).max()
    )
    assert error is None or error <= 1e-6 * problem.answer.sensitivity


def test_convergence_is_quadratic_in_the_end_where_the_answer_is_strictly_complementary() -> None:
    """σ and 1 − α fall with τ there, so an order above one shows in the last steps."""
    problem = random_problem(Family(6, dim=3, n_dofs=60, friction=0.5, states=("stick",)), 3)
    seen: list[float] = []
    create("InteriorPoint").prepare(problem).solve(
        Stop(1e-11, 60), observe=lambda _, impulses: seen.append(judge(problem, impulses).residual)
    )
    assert seen[-1] <= 1e-11
    last = [after / before for before, after in itertools.pairwise(seen)][-2:]
    assert last[-1] < last[-2] < 0.1
    assert len(seen) <= 20


@pytest.mark.parametrize("n_contacts", [2, 32, pytest.param(512, marks=pytest.mark.slow)])
def test_the_number_of_steps_hardly_depends_on_the_number_of_contacts(n_contacts: int) -> None:
    solution = solve(load(f"hard-supports-{n_contacts}"), "InteriorPoint", tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert solution.iterations <= 12


def test_both_forms_take_the_same_first_steps() -> None:
    problem = load("funnel-100")
    reached = [
        create("InteriorPoint", form=form).prepare(problem).solve(Stop(1e-12, 8)).impulses
        for form in ("delassus", "factors")
    ]
    assert np.abs(reached[0] - reached[1]).max() <= 1e-6 * np.abs(reached[0]).max()


def test_a_start_near_the_answer_takes_fewer_steps_than_a_cold_one() -> None:
    problem = load("funnel-100")
    prepared = create("InteriorPoint").prepare(problem)
    cold = prepared.solve(Stop(1e-6, 200))
    assert cold.status is Status.SOLVED
    near = cold.impulses * (1.0 + 1e-3 * np.random.default_rng(0).uniform(-1.0, 1.0, problem.n_rows))
    warm = prepared.solve(Stop(1e-6, 200), near)
    assert warm.status is Status.SOLVED
    assert warm.iterations < cold.iterations


@pytest.mark.parametrize(("name", "friction"), [("funnel-30", 0.0), ("funnel-30", 1e-9), ("hard-sticking-box", 1e4)])
def test_problems_without_friction_and_with_huge_friction_are_solved(name: str, friction: float) -> None:
    problem = load(name)
    other = ContactProblem.from_delassus(problem.delassus(), problem.free_velocity, friction)
    solution = solve(other, "InteriorPoint", tolerance=1e-6)
    assert solution.status is Status.SOLVED
    assert judge(other, solution.impulses).residual <= 1e-6


def test_a_body_between_approaching_walls_is_proved_infeasible() -> None:
    """Two opposite contacts whose gaps both close: Λ₁ = Λ₂ moves nothing, and c·(1, 1) < 0."""
    problem = ContactProblem.from_delassus([[1.0, -1.0], [-1.0, 1.0]], [-1.0, -0.5], dim=1)
    solution = solve(problem, "InteriorPoint", max_iterations=500)
    assert solution.status is Status.INFEASIBLE


def test_walls_that_leave_just_enough_room_are_not_called_infeasible() -> None:
    problem = ContactProblem.from_delassus([[1.0, -1.0], [-1.0, 1.0]], [-1.0, 1.0 + 1e-9], dim=1)
    assert solve(problem, "InteriorPoint", tolerance=1e-6).status is Status.SOLVED


def test_a_matrix_that_is_not_symmetric_is_solved_as_it_is() -> None:
    matrix = load("funnel-30").delassus().toarray()
    matrix[0, 5] += 1e-3 * matrix[0, 0]
    problem = ContactProblem.from_delassus(matrix, load("funnel-30").free_velocity, 0.3, allow_asymmetric=True)
    assert solve(problem, "InteriorPoint", tolerance=1e-8).status is Status.SOLVED


def test_a_time_limit_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit is in processor time of one thread, which excludes other programs."""
    problem = load("pile-1000")
    prepared = create("InteriorPoint").prepare(problem)
    prepared.solve(Stop(1e-12, 1))
    clock = SimpleNamespace(perf_counter=time.thread_time)
    monkeypatch.setattr("proxbench.solvers.iteration.stopping.time", clock)
    began = time.thread_time()
    with threadpool_limits(1):
        solution = prepared.solve(Stop(1e-14, max_seconds=0.5))
    assert solution.status is Status.TIME_LIMIT
    assert time.thread_time() - began <= 0.5 + 0.2


def test_friction_with_fixed_bounds_and_bounds_of_other_contacts_is_solved() -> None:
    """A contact, a joint with dry friction, and a brake that the contact's impulse presses."""
    laws = Laws.in_order([0, 1, 1], np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.3, 0.1]), np.array([-1, -1, 0]))
    problem = ContactProblem.from_delassus(np.eye(3), [-1.0, 2.0, -3.0], laws=laws)
    solution = solve(problem, "InteriorPoint", tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert solution.impulses == pytest.approx([1.0, -0.3, 0.6], abs=1e-7)


def test_unknown_form_is_refused() -> None:
    with pytest.raises(SolverError, match="must be"):
        create("InteriorPoint", form="dense")


@pytest.mark.parametrize("small", [1e-9, 1e-6, 1.0, 1e6])
def test_small_motions_do_not_prove_infeasibility(small: float) -> None:
    """G d is compared with the size of its own terms, however small both are relative to c."""
    stack = load("hard-stack-2-top-1e8")
    pressed = replace(in_units(stack, mass=small, length=small).problem, name="pressed", answer=None)
    assert not proves_infeasibility(pressed, np.ones(pressed.n_rows))
