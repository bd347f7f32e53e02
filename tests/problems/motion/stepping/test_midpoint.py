"""Moreau's midpoint step against motions known in closed form."""

from collections.abc import Callable

import numpy as np
import pytest
from proxbench.problems import ProblemError, judge
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.effects import Friction, Gravity, Restitution, ball_system
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import StepError
from proxbench.solvers import Status, Stop, create

GROUND = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def stepper(system: BallSystem | MechanicalSystem, time_step: float, warm_start: bool = True) -> MidpointRule:
    return MidpointRule(system, create("SORprox"), Stop(1e-12, 20_000), time_step, warm_start)


def one_ball(*effects: object, surfaces: tuple[Plane, ...] = (GROUND,)) -> BallSystem:
    return ball_system(np.array([0.1]), np.array([2.0]), surfaces, effects)  # type: ignore[arg-type]


def last(moreau: MidpointRule, state: State, count: int) -> State:
    for step in moreau.steps(state, count):
        state = step.state
    return state


def test_free_fall_is_exact_for_the_midpoint_rule() -> None:
    system = one_ball(Gravity(9.81))
    state = last(stepper(system, 1e-3), State(0.0, np.array([0.0, 0.0, 100.0]), np.array([1.0, 0.0, 0.0])), 500)
    assert state.position == pytest.approx([0.5, 0.0, 100.0 - 0.5 * 9.81 * 0.25], abs=1e-11)


@pytest.mark.parametrize(("restitution", "after"), [(0.0, 0.0), (0.5, 1.5), (1.0, 3.0)])
def test_an_impact_obeys_newtons_law(restitution: float, after: float) -> None:
    system = one_ball(Restitution(restitution))
    state = last(stepper(system, 1e-3), State(0.0, np.array([0.0, 0.0, 0.1005]), np.array([0.0, 0.0, -3.0])), 3)
    assert state.velocity[2] == pytest.approx(after, abs=1e-12)


def test_a_ball_at_rest_stays_and_is_carried_by_its_weight() -> None:
    system = one_ball(Gravity(9.81), Friction(0.5))
    moreau = stepper(system, 1e-3)
    for step in moreau.steps(State(0.0, np.array([0.0, 0.0, 0.1 - 1e-9]), np.zeros(6)), 20):
        assert step.problem is not None
        assert step.impulses[0] == pytest.approx(2.0 * 9.81 * 1e-3, rel=1e-9)
        assert np.abs(step.state.velocity).max() <= 1e-12


@pytest.mark.parametrize(("slope", "friction"), [(0.3, 0.5), (0.3, 0.02), (0.8, 0.1), (0.2, 0.0)])
def test_a_sphere_on_an_incline_rolls_or_slides_as_in_closed_form(slope: float, friction: float) -> None:
    """It rolls with a = 5/7 g sin θ if tan θ ≤ 7μ/2, and slides with a = g (sin θ − μ cos θ) otherwise."""
    normal = (np.sin(slope), 0.0, np.cos(slope))
    surface = Plane((0.0, 0.0, 0.0), normal)
    system = one_ball(Gravity(9.81), Friction(friction), surfaces=(surface,))
    start = State(0.0, (0.1 - 1e-9) * np.array(normal), np.zeros(6))
    state = last(stepper(system, 1e-3), start, 200)
    rolls = np.tan(slope) <= 3.5 * friction
    expected = 5.0 / 7.0 * np.sin(slope) if rolls else np.sin(slope) - friction * np.cos(slope)
    downhill = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    assert state.velocity[:3] @ downhill == pytest.approx(9.81 * expected * 0.2, rel=1e-8)


def test_oblique_impact_without_tangential_restitution() -> None:
    """The contact sticks if |v_T| ≤ 7/2 μ(1+ε)|v_N|, then v_T⁺ = 5/7 v_T; otherwise v_T⁺ = v_T − μ(1+ε)|v_N|."""
    for tangential in (0.5, 3.0):
        system = one_ball(Friction(0.2), Restitution(0.5, 0.0))
        start = State(0.0, np.array([0.0, 0.0, 0.1001]), np.array([tangential, 0.0, -1.0, 0.0, 0.0, 0.0]))
        state = last(stepper(system, 1e-3), start, 2)
        sticks = tangential <= 3.5 * 0.2 * 1.5
        assert state.velocity[0] == pytest.approx(5 / 7 * tangential if sticks else tangential - 0.3, abs=1e-10)
        assert state.velocity[2] == pytest.approx(0.5, abs=1e-10)


def test_newtons_cradle_in_one_coupled_solve() -> None:
    """For n equal touching balls, the first one gets (1+e)/n − e and all others get (1+e)/n."""
    n, e = 5, 0.4
    centres = np.zeros((n, 3))
    centres[:, 0] = np.arange(n) * (0.2 - 1e-9)
    system = ball_system(np.full(n, 0.1), np.ones(n), (), (Restitution(e),))
    velocity = np.zeros((n, 3))
    velocity[0, 0] = 1.0
    state = last(stepper(system, 1e-9), State(0.0, centres.ravel(), velocity.ravel()), 1)
    speeds = state.velocity.reshape(n, 3)[:, 0]
    assert speeds[0] == pytest.approx((1 + e) / n - e, abs=1e-10)
    assert speeds[1:] == pytest.approx(np.full(n - 1, (1 + e) / n), abs=1e-10)


def test_the_captured_problem_is_the_inclusion_of_the_step() -> None:
    """c = (I + ε) Wᵀu_B + Wᵀ M⁻¹ h Δt and u_E = u_B + M⁻¹(hΔt + WΛ): ξ = γ_E + ε γ_B."""
    system = one_ball(Gravity(9.81), Friction(0.2), Restitution(0.5, 0.3))
    before = State(0.0, np.array([0.0, 0.0, 0.0999]), np.array([0.7, 0.1, -1.0, 0.0, 0.2, 0.0]))
    step = stepper(system, 1e-3).step(before)
    assert step.problem is not None
    assert step.contacts is not None
    transposed = step.contacts.directions.to_csc().T
    expected = transposed @ step.state.velocity + np.array([0.5, 0.3, 0.3]) * (transposed @ before.velocity)
    assert step.problem.relative_velocity(step.impulses) == pytest.approx(expected, abs=1e-12)
    assert judge(step.problem, step.impulses).residual <= 1e-12


def test_step_without_active_contacts_has_no_problem() -> None:
    step = stepper(one_ball(Gravity()), 1e-3).step(State(0.0, np.array([0.0, 0.0, 5.0]), np.zeros(3)))
    assert step.problem is None
    assert step.status is None


def test_warm_start_matches_contacts_by_key_and_saves_iterations() -> None:
    n = 12
    centres = np.zeros((n, 3))
    centres[:, 2] = 0.1 - 1e-6 + np.arange(n) * (0.2 - 1e-6)
    system = ball_system(np.full(n, 0.1), np.ones(n), (GROUND,), (Gravity(),))
    iterations = {}
    for warm in (True, False):
        steps = list(stepper(system, 1e-3, warm).steps(State(0.0, centres.ravel(), np.zeros(3 * n)), 5))
        assert all(step.status is Status.SOLVED for step in steps)
        iterations[warm] = [step.iterations for step in steps]
    assert iterations[True][0] == iterations[False][0]
    assert sum(iterations[True][1:]) < 0.1 * sum(iterations[False][1:])


def test_a_general_system_and_a_ball_system_agree_on_the_same_ball() -> None:
    balls = one_ball(Gravity(9.81), Restitution(0.5))
    general = MechanicalSystem(
        mass=lambda q: 2.0 * np.eye(3),
        force=lambda q, u: np.array([0.0, 0.0, -2.0 * 9.81]),
        gap=lambda q: np.array([q[2] - 0.1]),
        directions=lambda q: np.array([[0.0], [0.0], [1.0]]),
        friction=[0.0],
        restitution_normal=[0.5],
        restitution_tangential=[0.0],
        rows_per_contact=1,
    )
    start = State(0.0, np.array([0.0, 0.0, 0.3]), np.zeros(3))
    ends = [last(stepper(system, 1e-3), start, 400) for system in (balls, general)]
    assert ends[0].position == pytest.approx(ends[1].position, abs=1e-12)
    assert ends[0].velocity == pytest.approx(ends[1].velocity, abs=1e-12)


def point(
    mass: Callable[[np.ndarray], np.ndarray],  # type: ignore[type-arg]
    force: Callable[[np.ndarray, np.ndarray], np.ndarray],  # type: ignore[type-arg]
) -> MechanicalSystem:
    """A system of one coordinate whose only contact stays open."""
    return MechanicalSystem(
        mass=mass,
        force=force,
        gap=lambda q: np.ones(1),
        directions=lambda q: np.ones((1, 1)),
        friction=[0.0],
        restitution_normal=[0.0],
        restitution_tangential=[0.0],
        rows_per_contact=1,
    )


def test_mass_matrix_that_is_not_positive_definite_is_refused() -> None:
    system = point(mass=lambda q: np.zeros((1, 1)), force=lambda q, u: np.zeros(1))
    with pytest.raises(ProblemError, match="positive definite"):
        stepper(system, 1e-3).step(State(0.0, np.zeros(1), np.zeros(1)))


@pytest.mark.parametrize(
    ("mass", "force", "what"),
    [
        (0.0, -10.0, r"a step of 0\.01 s from t = 0\.14 s failed: .* positive definite\."),
        (1.0, np.inf, r"no longer finite after t = 0\.14 s"),
    ],
)
def test_a_step_that_fails_is_an_error_with_the_time_and_the_last_good_state(
    mass: float, force: float, what: str
) -> None:
    system = point(
        mass=lambda q: np.eye(1) * (1.0 if q[0] > -0.1 else mass),
        force=lambda q, u: np.full(1, -10.0 if q[0] > -0.1 else force),
    )
    reached: list[State] = []
    with pytest.raises(StepError, match=what) as raised:
        reached.extend(step.state for step in stepper(system, 1e-2).steps(State(0.0, np.zeros(1), np.zeros(1)), 50))
    assert raised.value.state is reached[-1]


@pytest.mark.parametrize("time_step", [0.0, -1.0, float("nan"), float("inf")])
def test_invalid_time_step_is_refused(time_step: float) -> None:
    with pytest.raises(ProblemError, match="time_step"):
        stepper(one_ball(), time_step)
