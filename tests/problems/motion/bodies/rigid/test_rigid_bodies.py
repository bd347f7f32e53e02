"""The system of rigid bodies: W is the rate of the gaps, effects add rows and terms, free motion is of second order."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.contact.laws import LawKind
from proxbench.problems.contact.matrices.pieces import Pieces
from proxbench.problems.motion.bodies.rigid.joints import WORLD, Joint, RigidJoints
from proxbench.problems.motion.bodies.rigid.materials import MaterialPairs
from proxbench.problems.motion.bodies.rigid.orientation import about, exponential, product, rotation_matrices
from proxbench.problems.motion.bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from proxbench.problems.motion.bodies.rigid.shapes import Box, HalfSpace
from proxbench.problems.motion.scenes.effects import Drag, Friction, Gravity, Restitution
from proxbench.problems.motion.scenes.rigid.effects import (
    BodyEffect,
    GyroscopicMoment,
    RollingResistance,
    rigid_bodies,
)
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.position_projection import projected
from proxbench.solvers import Stop, create

Array = NDArray[np.float64]

BOX = Box((0.3, 0.2, 0.1))


def on_ground(effects: list[BodyEffect], n_boxes: int = 1) -> RigidBodies:
    masses = np.linspace(1.0, 2.0, n_boxes)
    return rigid_bodies([BOX] * n_boxes, masses, [FixedBody(HalfSpace())], effects)


def random_pose(rng: np.random.Generator, height: float = 0.04) -> Array:
    return np.concatenate([rng.normal(size=2), [height], exponential(rng.normal(size=(1, 3)))[0]])


def stepper(system: RigidBodies, time_step: float = 1e-3, depth: float | None = None) -> MidpointRule:
    return MidpointRule(system, create("Robust"), Stop(1e-12, 100_000), time_step, depth=depth)


@given(seed=st.integers(0, 2**32 - 1))
def test_normal_rows_are_the_rates_of_the_gaps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    system, position, velocity = on_ground([Friction(0.3)]), random_pose(rng), rng.normal(size=6)
    contacts = system.assemble(position, velocity, 1e-3).contacts
    assert contacts is not None
    rates = contacts.normals(contacts.transposed_times(velocity))
    step = 1e-6
    ends = [system.gaps_below(system.move(position, velocity, side * step), 1.0) for side in (1.0, -1.0)]
    gaps = [dict(zip(*(part.tolist() for part in end), strict=True)) for end in ends]
    for key, rate in zip(contacts.keys.tolist(), rates, strict=True):
        assert (gaps[0][key] - gaps[1][key]) / (2.0 * step) == pytest.approx(rate, abs=1e-8)


@given(seed=st.integers(0, 2**32 - 1))
def test_tangential_and_rolling_rows_are_velocities_of_points_and_of_rotation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    system = on_ground([Friction(0.3), RollingResistance(0.1, "both")])
    position, velocity = random_pose(rng), rng.normal(size=6)
    contacts = system.assemble(position, velocity, 1e-3).contacts
    assert contacts is not None
    found = system.contacts_within(system.poses(position), 0.0)
    rows = contacts.transposed_times(velocity).reshape(-1, 6)
    turning = rotation_matrices(position[None, 3:])[0] @ velocity[3:]
    points = velocity[:3] + np.cross(turning, found.point - position[:3])
    # the ground is level: N is z
    np.testing.assert_allclose(rows[:, 0], points[:, 2], atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(rows[:, 1:3], axis=1), np.linalg.norm(points[:, :2], axis=1), atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(rows[:, 3:5], axis=1), np.linalg.norm(turning[:2]), atol=1e-14)
    np.testing.assert_allclose(rows[:, 5], turning[2], atol=1e-14)


@pytest.mark.parametrize(
    ("effects", "rows"),
    [
        ([], 1),
        ([Friction(0.3)], 3),
        ([RollingResistance(0.01, "spinning")], 2),
        ([Friction(0.3), RollingResistance(0.01)], 5),
        ([Friction(0.3), RollingResistance(0.01, "both")], 6),
    ],
)
def test_an_effect_that_is_left_out_has_no_rows(effects: list[BodyEffect], rows: int) -> None:
    system = on_ground(effects)
    position = np.array([0.0, 0.0, 0.0499, 1.0, 0.0, 0.0, 0.0])
    contacts = system.assemble(position, np.zeros(6), 1e-3).contacts
    assert contacts is not None
    assert contacts.width == system.rows_per_contact == rows
    assert contacts.laws.n_rows == 4 * rows
    assert isinstance(contacts.directions, Pieces)


@pytest.mark.parametrize("none", [Friction(0.0), RollingResistance(0.0), Restitution(0.0), Drag(0.0)])
def test_an_effect_of_no_strength_moves_bodies_as_without_it(none: BodyEffect) -> None:
    """The box falls on one corner, turns, and falls on others."""
    start = State(0.0, np.concatenate([[0.0, 0.0, 0.25], about((1.0, 2.0, 0.5), 0.7)]), np.zeros(6))
    ends = [
        list(stepper(on_ground(effects)).steps(start, 300))[-1].state for effects in ([Gravity()], [Gravity(), none])
    ]
    assert np.abs(ends[0].velocity).max() > 0.1
    np.testing.assert_allclose(ends[1].position, ends[0].position, atol=1e-8)


def test_the_gyroscopic_moment_of_a_body_with_equal_moments_of_inertia_is_zero() -> None:
    start = State(0.0, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]))
    ends = []
    for is_gyroscopic in (False, True):
        system = RigidBodies([BOX], np.ones(1), inertias=np.array([[0.2, 0.2, 0.2]]), is_gyroscopic=is_gyroscopic)
        ends.append(list(stepper(system).steps(start, 100))[-1].state)
    np.testing.assert_allclose(ends[1].velocity, ends[0].velocity, rtol=1e-14)
    np.testing.assert_allclose(ends[1].position, ends[0].position, atol=1e-13)


def test_without_the_gyroscopic_moment_a_free_body_keeps_its_axis() -> None:
    system = on_ground([])
    start = State(0.0, np.array([0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]))
    *_, last = stepper(system).steps(start, 100)
    np.testing.assert_array_equal(last.state.velocity, start.velocity)


def test_a_symmetric_top_precesses_as_in_closed_form_with_the_second_order() -> None:
    """R(t) = exp(t L/J₁) R₀ exp(−t Ω e₃), Ω = (J₃ − J₁) ω₃/J₁; in body axes ω turns about e₃ at the rate Ω."""
    inertias = np.array([[0.02, 0.02, 0.03]])
    system = RigidBodies([BOX], np.ones(1), inertias=inertias, is_gyroscopic=True)
    spin, axis = np.array([1.0, 0.0, 5.0]), about((1.0, 1.0, 0.0), 0.4)
    start = State(0.0, np.concatenate([np.zeros(3), axis]), np.concatenate([np.zeros(3), spin]))
    rate = (0.03 - 0.02) / 0.02 * spin[2]
    momentum = rotation_matrices(axis[None])[0] @ (inertias[0] * spin)
    size, time = float(np.linalg.norm(momentum)), 2.0
    around = product(about(tuple(momentum), size / 0.02 * time)[None], axis[None])
    expected = rotation_matrices(product(around, about((0.0, 0.0, 1.0), -rate * time)[None]))[0]
    errors = []
    for count in (100, 200, 400, 800):
        *_, last = stepper(system, time / count).steps(start, count)
        turned = rotation_matrices(last.state.position[None, 3:])[0]
        errors.append(max(np.abs(turned - expected).max(), abs(last.state.velocity[3] - np.cos(rate * time))))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.05)


def test_an_asymmetric_top_converges_with_the_second_order_and_keeps_its_angular_momentum_in_space() -> None:
    system = on_ground([GyroscopicMoment()])
    start = State(
        0.0, np.concatenate([[0.0, 0.0, 9.0], about((1.0, 0.0, 0.0), 0.3)]), np.array([0, 0, 0, 3.0, 5.0, 1.0])
    )
    ends = {}
    for count in (50, 100, 200, 3200):
        *_, last = stepper(system, 1.0 / count).steps(start, count)
        ends[count] = np.concatenate([rotation_matrices(last.state.position[None, 3:]).ravel(), last.state.velocity])
    errors = [np.abs(ends[count] - ends[3200]).max() for count in (50, 100, 200)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.1)
    momenta = [
        rotation_matrices(state.position[None, 3:])[0] @ (system.moments[0] * state.velocity[3:])
        for state in (start, last.state)
    ]
    np.testing.assert_allclose(momenta[1], momenta[0], atol=1e-5)


@pytest.mark.slow
def test_the_angular_momentum_in_space_stays_within_a_bound_of_second_order_over_many_steps() -> None:
    """The body tumbles over forty times; a drift would grow with the time, not fall with Δt²."""
    system = RigidBodies([BOX], np.ones(1), inertias=np.array([[1.0, 2.0, 3.0]]), is_gyroscopic=True)
    start = State(0.0, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 0.01, 10.0, 0.01]))

    def momentum(state: State) -> Array:
        turned = rotation_matrices(state.position[None, 3:])[0]
        spatial: Array = turned @ (system.moments[0] * state.velocity[3:])
        return spatial

    errors = []
    for count in (5_000, 10_000):
        steps = stepper(system, 40.0 / count).steps(start, count)
        errors.append(max(float(np.abs(momentum(step.state) - momentum(start)).max()) for step in steps))
    assert errors[0] < 1e-3 * np.linalg.norm(momentum(start))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


def test_a_box_that_spins_on_its_base_is_slowed_by_spinning_resistance_as_in_closed_form() -> None:
    """For any distribution of the weight over the corners, the moment is μ_r m g until the box stops."""
    system = on_ground([Gravity(), RollingResistance(0.002, "spinning")])
    start = State(0.0, np.array([0.0, 0.0, 0.05 - 1e-9, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5]))
    slowing = 0.002 * 9.81 / system.moments[0, 2]
    for step in stepper(system).steps(start, 400):
        expected = max(0.5 - slowing * step.state.time, 0.0)
        assert step.state.velocity[5] == pytest.approx(expected, abs=1e-9 if expected != 0.0 else 1e-8)
        assert np.abs(step.state.velocity[:5]).max() <= 1e-9
    assert 0.0 < 0.5 / slowing < 0.4


def test_a_box_that_penetrates_is_lifted_and_levelled_by_the_projection() -> None:
    system = on_ground([])
    position = np.concatenate([[0.0, 0.0, 0.04], about((1.0, 0.0, 0.0), 0.05)])
    end = projected(system, position, np.zeros(6 * system.n_bodies), 1e-4).position
    assert -system.gaps_below(end, 0.0)[1].min(initial=0.0) <= 1.2e-4
    assert end[2] > 0.045
    assert np.linalg.norm(end[3:]) == pytest.approx(1.0, abs=1e-14)
    # the smallest correction in the metric of M neither moves it along the ground nor turns it about the vertical
    assert end[:2] == pytest.approx(np.zeros(2), abs=1e-14)


def test_friction_and_restitution_depend_on_the_pair_of_materials() -> None:
    materials = ("ice", "rubber", "road")
    friction = MaterialPairs(materials, {("ice", "road"): 0.1, ("rubber", "road"): 0.9, ("ice", "rubber"): 0.2}, 1)
    restitution = MaterialPairs(materials, {("ice", "road"): 0.0, ("rubber", "road"): 0.7, ("ice", "rubber"): 0.5}, 1)
    system = on_ground([Friction(friction), Restitution(restitution)], 2)
    position = np.array([[0.0, 0.0, 0.0499, 1, 0, 0, 0], [1.0, 0.0, 0.0499, 1, 0, 0, 0]]).ravel()
    contacts = system.assemble(position, np.zeros(12), 1e-3).contacts
    assert contacts is not None
    assert contacts.laws.friction_coefficient[1::2].tolist() == [0.1] * 4 + [0.9] * 4
    assert contacts.restitution[::3].tolist() == [0.0] * 4 + [0.7] * 4
    with pytest.raises(ProblemError, match="between 0 and 1"):
        on_ground([Restitution(replace(friction, coefficients={**friction.coefficients, ("ice", "road"): 1.1}))], 2)


@pytest.mark.parametrize("height", [0.0499, 1.0])
def test_rows_of_joints_follow_those_of_contacts(height: float) -> None:
    system = replace(
        on_ground([Gravity(), Friction(0.3)], 2),
        joints=RigidJoints([Joint("ball", 0, WORLD, second_point=(0.0, 0.0, 5.0))], 2),
    )
    start = np.array([[0.0, 0.0, 5.0, 1, 0, 0, 0], [1.0, 0.0, height, 1, 0, 0, 0]]).ravel()
    contacts = system.assemble(start, np.zeros(12), 1e-3).contacts
    assert contacts is not None
    n_contacts = 4 if height < 0.05 else 0
    assert contacts.n_contacts == n_contacts
    assert contacts.laws.kind[-3:].tolist() == [LawKind.BILATERAL] * 3
    assert (np.diff(contacts.keys) > 0).all()
    *_, last = stepper(system).steps(State(0.0, start, np.zeros(12)), 100)
    poses = system.poses(last.state.position)
    assert poses[0, :3] == pytest.approx([0.0, 0.0, 5.0], abs=1e-12)
    fallen = 0.0 if n_contacts else 0.5 * 9.81 * 0.1**2
    assert poses[1, 2] == pytest.approx(height - fallen, abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"masses": np.array([0.0])}, r"masses\[0\] must be positive and finite, got 0.0"),
        ({"masses": np.array([np.nan])}, r"masses\[0\] must be positive and finite, got nan"),
        ({"masses": np.array([1.0, 1.0])}, r"masses must be 1 positive numbers, one per shape, got shape \(2,\)"),
        ({"inertias": np.array([[1.0, 1.0, 0.0]])}, r"inertias\[0\] must be positive"),
        ({"inertias": np.array([[1.0, np.nan, 1.0]])}, r"inertias\[0\] must be positive"),
        ({"inertias": np.array([[1.0, 1.0, np.nan]])}, r"inertias\[0\] must be positive"),
        ({"shapes": [(BOX, np.zeros(7))]}, "shape of body 0 must be a shape, .* returns a shape and its pose"),
        ({"fixed": [HalfSpace()]}, r"fixed\[0\] must be a FixedBody, got HalfSpace; write FixedBody"),
        ({"inertias": np.array([[1.0, 1.0, 2.1]])}, "no body has the moments"),
        ({"inertias": np.ones((2, 3))}, r"must have shape \(1, 3\)"),
        ({"shapes": [HalfSpace()]}, "body 0 is unbounded and cannot move"),
        ({"friction": -0.1}, "friction must be finite"),
        ({"rolling_friction": float("nan")}, "rolling_friction must be finite"),
        ({"restitution_normal": 1.5}, "restitution_normal must be between"),
        ({"rolling_axes": 4}, "rolling_axes must be"),
    ],
)
def test_error_names_the_invalid_parameter(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        RigidBodies(**{"shapes": [BOX], "masses": np.ones(1), **changes})  # type: ignore[arg-type]


def test_duplicate_effect_is_refused() -> None:
    with pytest.raises(ProblemError, match="Friction is listed 2 times"):
        on_ground([Friction(0.1), Friction(0.2)])
