"""Linked bodies move according to closed forms, with any number of joints and any solver that supports joints."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Model, judge
from proxbench.problems.hard import GRAVITY, TIME_STEP, hard_case
from proxbench.problems.hard.joints import chain, parallelogram, pendulum, towed_wheel
from proxbench.solvers import Status, available, create, solve

WEIGHT = GRAVITY * TIME_STEP

BOTH_LAWS = [
    *(
        name
        for name in available()
        if not create(name).supports(towed_wheel(4, WEIGHT))
        and create(name).model == Model.COULOMB
        and name not in ("Jprox", "JORprox", "CvxpyCoulomb")
    ),
    "JORprox(relaxation=0.3)",
    "SORprox(form='factors')",
    "Refined(ClarabelCoulomb)",
]
"""All solvers, except for Jacobi's iterations with full steps, which oscillate, and CvxpyCoulomb, which solves the
programs of ClarabelCoulomb."""


def motion(problem: ContactProblem, impulses: np.ndarray) -> np.ndarray:
    """u = u_f + M⁻¹ W Λ of the bodies."""
    assert problem.factors is not None
    assert problem.factors.free_motion is not None
    pushed = problem.factors.inverse_mass.times(problem.factors.force_directions @ impulses)
    return np.asarray(problem.factors.free_motion + pushed)


def known_velocity(problem: ContactProblem) -> np.ndarray:
    assert problem.answer is not None
    assert problem.answer.velocity is not None
    return problem.answer.velocity


@pytest.mark.parametrize("solver", ["SemismoothNewton", "ClarabelCoulomb", "Refined(ClarabelCoulomb)"])
@pytest.mark.parametrize("pull", [0.0, 2.0])
def test_the_tensions_of_a_hundred_links_are_right_to_ten_digits(pull: float, solver: str) -> None:
    masses = np.linspace(1.0, 3.0, 100)
    problem = chain(masses, pull)
    solution = solve(problem, solver, tolerance=1e-13)
    assert judge(problem, solution.impulses).residual <= 1e-12
    tension = [WEIGHT * masses[link:].sum() + pull for link in range(100)]
    assert solution.impulses[1::2] == pytest.approx(tension, rel=1e-10)
    assert np.abs(solution.impulses[0::2]).max() <= 1e-10 * tension[0]


@pytest.mark.parametrize("solver", ["SORprox", "SORprox(form='factors')", "NSGS", "HybridNewton", "SafeguardedSORprox"])
def test_sweeps_converge_to_the_known_tensions(solver: str) -> None:
    problem = chain(np.ones(10))
    solution = solve(problem, solver, tolerance=1e-13, max_iterations=20_000)
    assert solution.status is Status.SOLVED
    assert solution.impulses[1::2] == pytest.approx(WEIGHT * np.arange(10, 0, -1), rel=1e-10)


@pytest.mark.parametrize(("cranks", "rank"), [(2, 8), (3, 11), (5, 17)])
def test_each_parallel_crank_beyond_the_second_is_redundant(cranks: int, rank: int) -> None:
    problem = parallelogram(cranks)
    delassus = problem.delassus().toarray()
    assert np.linalg.matrix_rank(delassus, tol=1e-10) == rank == delassus.shape[0] - (cranks - 2)


@pytest.mark.parametrize("solver", BOTH_LAWS)
@pytest.mark.parametrize("cranks", [2, 3])
def test_a_loop_with_a_redundant_joint_satisfies_lagranges_equation(cranks: int, solver: str) -> None:
    """d/dt ∂T/∂ω of the one angle: (cranks/3 + 1) ω = −(cranks/2 + 1) g Δt cos θ, for 1 kg and 1 m each."""
    problem = parallelogram(cranks, angle=0.4)
    solution = solve(problem, solver, tolerance=1e-9, max_iterations=50_000)
    assert solution.status is Status.SOLVED
    omega = -(cranks / 2 + 1) * WEIGHT * np.cos(0.4) / (cranks / 3 + 1)
    assert motion(problem, solution.impulses)[2 : 3 * cranks : 3] == pytest.approx(np.full(cranks, omega), rel=1e-7)


@pytest.mark.parametrize("solver", [name for name in BOTH_LAWS if not name.startswith("JORprox")])
@pytest.mark.parametrize("cranks", [3, 20])
def test_forces_of_redundant_joints_on_bodies_are_accurate_to_ten_digits(cranks: int, solver: str) -> None:
    """W Λ = M (u − u_f) is unique, though Λ is not."""
    problem = parallelogram(cranks, angle=0.4)
    assert problem.answer is not None
    assert problem.factors is not None
    found = problem.factors.force_directions @ solve(problem, solver, tolerance=1e-12, max_iterations=5000).impulses
    assert found == pytest.approx(problem.answer.values, abs=1e-10 * np.abs(problem.answer.values).max())


def test_eight_copies_of_a_pin_together_carry_a_quarter_of_the_weight_of_the_rod() -> None:
    for copies in (1, 8):
        problem = pendulum(copies)
        impulses = solve(problem, "NSGS", tolerance=1e-12).impulses
        assert impulses.reshape(copies, 2).sum(axis=0) == pytest.approx([0.0, 0.25 * WEIGHT], abs=1e-12)
        assert motion(problem, impulses)[2] == pytest.approx(-1.5 * WEIGHT, rel=1e-10)


@pytest.mark.parametrize(
    ("pull", "speed", "spin"),
    [
        (0.1, 0.0, 0.0),  # P r ≤ μ_r N
        (0.2, 0.0, 0.0),
        (1.0, (1.0 - 0.2) / 2.5, (1.0 - 0.2) / 2.5 / 0.1),  # (2 + J/r²) v = P − μ_r N/r, v = r ω
        (5.0, (5.0 - 0.5) / 2.0, (0.5 * 0.1 - 0.02) / 0.005),  # 2 v = P − μ N, J ω = μ N r − μ_r N
    ],
)
def test_a_towed_wheel_stays_rolls_or_slides_as_it_rolls(pull: float, speed: float, spin: float) -> None:
    problem = towed_wheel(4, pull * WEIGHT)
    normal, tangential, rolling = known_velocity(problem)[-3:] / WEIGHT
    assert normal == pytest.approx(0.0, abs=1e-12)
    assert rolling == pytest.approx(spin, abs=1e-9)
    assert tangential == pytest.approx(speed - 0.1 * spin, abs=1e-10)


@pytest.mark.parametrize("word", ["stays", "rolls", "slides"])
def test_all_solvers_that_take_both_laws_move_the_towed_wheel_alike(word: str) -> None:
    problem = hard_case(f"hard-towed-wheel-{word}")
    for solver in BOTH_LAWS:
        solution = solve(problem, solver, tolerance=1e-8, max_iterations=20_000)
        assert solution.status is Status.SOLVED, solver
        found = problem.relative_velocity(solution.impulses)
        assert found == pytest.approx(known_velocity(problem), abs=1e-6 * np.abs(problem.free_velocity).max()), solver


def test_a_joint_between_walls_that_part_is_infeasible_and_the_solver_says_why() -> None:
    solution = solve(hard_case("hard-immovable-joint"), "SORprox")
    assert solution.status is Status.INFEASIBLE
    assert "bilateral" in solution.message
