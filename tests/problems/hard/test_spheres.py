"""Spheres with rolling resistance rest, roll and slide according to closed forms, also in a pile of the library."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError, judge, load
from proxbench.problems.hard import GRAVITY, TIME_STEP, hard_case
from proxbench.problems.hard.spheres import (
    RADIUS,
    random_spheres_with_rolling_friction,
    slowing_sphere,
    sphere_on_slope,
    with_rolling_friction,
)
from proxbench.solvers import Status, solve

WEIGHT = GRAVITY * TIME_STEP

SOLVERS = ["SORprox", "SORprox(form='factors')", "SafeguardedSORprox", "NSGS", "SemismoothNewton", "HybridNewton"]


def rolling(problem: ContactProblem, impulses: np.ndarray) -> tuple[float, float]:
    """Speed of the centre along T1, and angular velocity about T2 times the radius, of one sphere [m/s]."""
    velocity = problem.relative_velocity(impulses)
    return float(velocity[1] + RADIUS * velocity[4]), float(RADIUS * velocity[4])


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("share", [0.05, 0.2])
def test_a_sphere_stays_on_a_slope_up_to_the_critical_angle_and_rolls_beyond(share: float, solver: str) -> None:
    """tan θ = μ_r/r; beyond, 7/5 v = g Δt (sin θ − μ_r/r cos θ)."""
    for excess in (-0.05, 0.0, 0.05, 0.3):
        problem, slope = sphere_on_slope(excess, share=share), np.arctan(share) + excess
        solution = solve(problem, solver, tolerance=1e-11)
        assert solution.status is Status.SOLVED
        expected = max(0.0, 5.0 / 7.0 * WEIGHT * (np.sin(slope) - share * np.cos(slope)))
        assert rolling(problem, solution.impulses) == pytest.approx((expected, expected), abs=1e-9 * WEIGHT)


@pytest.mark.parametrize("solver", SOLVERS)
def test_on_a_steep_slope_it_slides_and_rolls_against_both_frictions(solver: str) -> None:
    """v = g Δt (sin θ − μ cos θ) and 2/5 r ω = g Δt (μ − μ_r/r) cos θ."""
    problem, slope = sphere_on_slope(1.0), np.arctan(0.2) + 1.0
    speed, turned = rolling(problem, solve(problem, solver, tolerance=1e-11).impulses)
    assert speed == pytest.approx(WEIGHT * (np.sin(slope) - 0.5 * np.cos(slope)), rel=1e-9)
    assert turned == pytest.approx(2.5 * WEIGHT * (0.5 - 0.2) * np.cos(slope), rel=1e-9)
    assert speed > turned > 0.0


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_rolling_sphere_stops_when_its_speed_is_used_up(solver: str) -> None:
    loss = 5.0 / 7.0 * 0.2 * WEIGHT
    for speed in (0.5 * loss, 0.99 * loss, 1.01 * loss, 10.0 * loss):
        problem = slowing_sphere(speed)
        found = rolling(problem, solve(problem, solver, tolerance=1e-11).impulses)
        left = max(0.0, speed - loss)
        assert found == pytest.approx((left, left), abs=1e-9 * speed)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_spheres_that_stick_roll_and_slide_in_all_directions_have_known_impulses(axes: int) -> None:
    problem = random_spheres_with_rolling_friction(60, axes)
    assert problem.answer is not None
    (known,) = problem.answer.impulses
    assert judge(problem, known).residual <= 1e-13
    velocity, (n_t, n_r) = problem.relative_velocity(known).reshape(60, -1), (slice(1, 3), slice(3, None))
    slides = np.linalg.norm(velocity[:, n_t], axis=1) > 1e-12
    rolls = np.linalg.norm(velocity[:, n_r], axis=1) > 1e-12
    assert {(True, True), (False, True), (False, False)} <= set(zip(slides.tolist(), rolls.tolist(), strict=True))
    for solver in ("SORprox", "NSGS"):
        assert solve(problem, solver, tolerance=1e-10).impulses == pytest.approx(known, abs=1e-8)


@pytest.mark.parametrize("axes", [2, 3])
def test_a_pile_of_the_library_gets_the_angular_velocities_of_its_balls(axes: int) -> None:
    pile = load("pile-100")
    resisting = with_rolling_friction(pile, 1e-3, axes)
    rows = resisting.layout.pad(resisting.free_velocity)
    assert (resisting.n_contacts, resisting.n_rows) == (pile.n_contacts, pile.n_rows + axes * pile.n_contacts)
    assert rows[:, :3].ravel() == pytest.approx(pile.free_velocity)
    assert pile.factors is not None
    assert pile.factors.free_motion is not None
    assert resisting.factors is not None
    directions = resisting.factors.force_directions.toarray().reshape(-1, 6, pile.n_contacts, 3 + axes)
    spin = pile.factors.free_motion.reshape(-1, 6)[:, 3:]
    axis_of_row = [1, 2, 0][:axes]
    for lane, direction in enumerate(axis_of_row):
        assert np.array_equal(directions[:, 3:, :, 3 + lane], directions[:, :3, :, direction])
        assert not directions[:, :3, :, 3 + lane].any()
        assert rows[:, 3 + lane] == pytest.approx(
            np.einsum("bkc,bk->c", directions[:, :3, :, direction], spin), abs=1e-12
        )


def test_without_resistance_the_pile_keeps_its_solutions() -> None:
    """μ_r = 0: rolling impulses are zero, and the others solve as before."""
    pile = load("pile-100")
    resisting = with_rolling_friction(pile, 0.0)
    found = solve(resisting, "SORprox", tolerance=1e-4)
    assert found.status is Status.SOLVED
    lanes = resisting.layout.pad(found.impulses)
    assert not lanes[:, 3:].any()
    assert judge(pile, lanes[:, :3].ravel()).residual == pytest.approx(1e-4, rel=1.0, abs=1e-4)


@pytest.mark.weekly
@pytest.mark.parametrize("axes", [2, 3])
def test_a_hundred_balls_at_rest_that_resist_rolling_are_solved_to_eight_digits(axes: int) -> None:
    problem = with_rolling_friction(load("pile-100"), 1e-3, axes)
    found = solve(problem, "ClarabelCoulomb", tolerance=1e-8, max_iterations=200)
    assert found.status is Status.SOLVED
    assert judge(problem, found.impulses).residual <= 1.001e-8


@pytest.mark.parametrize("name", ["funnel-planar-30", "hard-mixed-laws", "hard-four-bar"])
def test_only_spatial_contacts_of_balls_can_be_given_rolling_friction(name: str) -> None:
    with pytest.raises(ProblemError, match="cannot have rolling friction"):
        with_rolling_friction(load(name), 1e-3)


def test_the_critical_sphere_stays_and_a_slightly_steeper_slope_makes_it_roll() -> None:
    speeds = [
        rolling(problem, problem.answer.impulses[0])[0]  # type: ignore[union-attr]
        for problem in (hard_case(f"hard-resisting-sphere-{word}") for word in ("below", "critical", "above"))
    ]
    assert speeds[:2] == pytest.approx([0.0, 0.0], abs=1e-16)
    assert speeds[2] == pytest.approx(5.0 / 7.0 * WEIGHT * 1e-9 / np.cos(np.arctan(0.2)), rel=1e-5)
