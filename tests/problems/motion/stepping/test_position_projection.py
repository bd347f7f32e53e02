"""Projection of positions: up to the allowed depth, by the nearest way, and without a change of velocities."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ProblemError
from proxbench.problems.contact.matrices.factors import InverseMass
from proxbench.problems.errors import InsufficientMemoryError
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane, Rim, Segment
from proxbench.problems.motion.bodies.system import JointErrors, MechanicalSystem, Overlaps
from proxbench.problems.motion.scenes.effects import Gravity, Restitution, ball_system
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.position_projection import (
    ACCURACY,
    _displacement_of_balls,
    _joint_inverse,
    projected,
)
from proxbench.problems.motion.stepping.step import StepError
from proxbench.solvers import Stop, create
from scipy.optimize import nnls

RADIUS, DEPTH = 0.01, 1e-4


def floor(n_balls: int, masses: np.ndarray | None = None, gravity: float = 9.81) -> BallSystem:
    weights = np.full(n_balls, 0.01) if masses is None else masses
    plane = [Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
    return ball_system(np.full(n_balls, RADIUS), weights, plane, (Gravity(gravity), Restitution(0.0)))


def stepper(system: BallSystem | MechanicalSystem, depth: float | None) -> MidpointRule:
    return MidpointRule(system, create("SORprox"), Stop(1e-10, 10_000, np.inf), 5e-4, depth=depth)


def free_balls(dimension: int, masses: np.ndarray, friction: float | None = 0.3) -> BallSystem:
    return BallSystem(np.full(len(masses), RADIUS), masses, [], dimension, friction=friction)


def deepest(system: BallSystem | MechanicalSystem, position: np.ndarray) -> float:
    return max(0.0, -float(system.gaps_below(position, 0.0)[1].min(initial=0.0)))


def moved_apart(system: BallSystem | MechanicalSystem, position: np.ndarray) -> np.ndarray:
    return projected(system, position, np.zeros(0), DEPTH).position


def two_points(mass: np.ndarray) -> MechanicalSystem:
    """Two points in the plane that keep two radii apart, by the functions of their equations of motion."""

    def normal(q: np.ndarray) -> np.ndarray:
        return (q[:2] - q[2:]) / np.linalg.norm(q[:2] - q[2:])

    return MechanicalSystem(
        mass=lambda q: mass,
        force=lambda q, u: np.zeros(4),
        gap=lambda q: np.array([np.linalg.norm(q[:2] - q[2:]) - 2.0 * RADIUS]),
        directions=lambda q: np.concatenate([normal(q), -normal(q)])[:, None],
        friction=[0.0],
        restitution_normal=[0.0],
        restitution_tangential=[0.0],
        rows_per_contact=1,
    )


def test_a_ball_that_stays_deep_without_projection_is_lifted_to_the_allowed_depth_with_it() -> None:
    system = floor(1)
    start = State(0.0, np.array([0.0, 0.0, 0.9 * RADIUS]), system.without_spin(np.zeros((1, 3))))
    deep, lifted = (list(stepper(system, depth).steps(start, 10))[-1].state for depth in (None, DEPTH))
    assert deep.position[2] == pytest.approx(0.9 * RADIUS, abs=1e-5)
    assert lifted.position[2] == pytest.approx(RADIUS - DEPTH, abs=0.11 * DEPTH)
    assert np.array_equal(deep.velocity, lifted.velocity)


def test_bodies_part_in_inverse_proportion_to_their_masses() -> None:
    masses = np.array([0.01, 0.03])
    system = floor(2, masses, gravity=0.0)
    centres = np.array([[0.0, 0.0, 1.0], [1.8 * RADIUS, 0.0, 1.0]])
    end = stepper(system, DEPTH).step(State(0.0, centres.ravel(), system.without_spin(np.zeros((2, 3))))).state
    moved = end.position.reshape(2, 3) - centres
    assert moved[0, 0] < 0.0 < moved[1, 0]
    assert masses @ moved == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.linalg.norm(np.diff(end.position.reshape(2, 3), axis=0)) == pytest.approx(2 * RADIUS - DEPTH, abs=2e-5)


def test_a_stack_that_overlaps_everywhere_comes_apart() -> None:
    system = floor(5)
    heights = 0.9 * RADIUS + 1.8 * RADIUS * np.arange(5)
    centres = np.column_stack([np.zeros((5, 2)), heights])
    start = State(0.0, centres.ravel(), system.without_spin(np.zeros((5, 3))))
    last = list(stepper(system, DEPTH).steps(start, 30))[-1]
    assert last.contacts is not None
    assert len(last.contacts.keys) == 5
    assert -last.contacts.gap.min() <= 1.2 * DEPTH
    # at rest up to the tolerance of the solver
    assert np.abs(last.state.velocity).max() <= 1e-6


@pytest.mark.parametrize("n_balls", [5, 20, 40])
def test_a_column_in_any_order_reaches_its_only_position_without_overlaps_in_one_step(n_balls: int) -> None:
    """The gaps of a column are linear in the heights, so that one pass suffices: ball k is at height (2k − 1)r − kd.

    The last sweep leaves a violation of at most ``ACCURACY`` d at each contact; k contacts carry the error of a ball.
    """
    system = floor(n_balls)
    places = np.random.default_rng(3).permutation(n_balls)
    heights = 0.98 * RADIUS + 1.98 * RADIUS * places
    end = projected(system, np.column_stack([np.zeros((n_balls, 2)), heights]).ravel(), np.zeros(0), DEPTH)
    assert end.overlap == 0.0
    exact = RADIUS * (2.0 * places + 1.0) - DEPTH * (places + 1.0)
    assert (np.abs(system.centres(end.position)[:, 2] - exact) <= 1.01 * ACCURACY * DEPTH * (places + 1.0)).all()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("masses", [(0.01, 0.01, 0.01), (1.0, 0.01, 0.01), (0.01, 0.01, 1.0)])
def test_balls_that_part_push_a_third_one_and_not_into_it(dimension: int, masses: tuple[float, ...]) -> None:
    """The gap of the third ball is a tenth of the overlap of the first two; undoing that overlap closes the gap."""
    weights = np.array(masses)
    system = free_balls(dimension, weights)
    centres = np.zeros((3, dimension))
    centres[:, 0] = [0.0, 1.8 * RADIUS, 3.82 * RADIUS]
    end = stepper(system, DEPTH).step(State(0.0, centres.ravel(), system.without_spin(np.zeros((3, dimension))))).state
    assert deepest(system, end.position) <= (1.0 + ACCURACY) * DEPTH
    assert (np.diff(system.centres(end.position)[:, 0]) > 0.0).all()
    assert weights @ (system.centres(end.position) - centres) == pytest.approx(np.zeros(dimension), abs=1e-15)


def test_balls_that_meet_in_the_second_half_of_a_step_end_at_the_allowed_depth_and_as_fast_as_before() -> None:
    system = free_balls(3, np.array([0.01, 0.03]))
    speed = 2.0 * RADIUS / 5e-4
    centres = np.array([[0.0, 0.0, 0.0], [3.2 * RADIUS, 0.0, 0.0]])
    start = State(0.0, centres.ravel(), system.without_spin(np.array([[speed, 0.0, 0.0], [0.0, 0.0, 0.0]])))
    step = stepper(system, DEPTH).step(start)
    assert step.contacts is None
    assert deepest(system, stepper(system, None).step(start).state.position) == pytest.approx(0.8 * RADIUS)
    assert deepest(system, step.state.position) == pytest.approx(DEPTH, rel=1e-9)
    assert np.array_equal(step.state.velocity, start.velocity)


@given(
    seed=st.integers(0, 2**32 - 1),
    n_balls=st.integers(2, 40),
    crowding=st.floats(0.2, 3.0),
    dimension=st.sampled_from([2, 3]),
)
def test_no_projection_makes_the_deepest_penetration_deeper(
    seed: int, n_balls: int, crowding: float, dimension: int
) -> None:
    rng = np.random.default_rng(seed)
    side = 1.0 if dimension == 2 else 0.0
    surfaces = [
        Plane((0.0,) * dimension, (*(0.1,) * (dimension - 1), 1.0)),
        Segment((0.03, 0.0), (0.13, 0.1), int(side)),
        Rim((0.03, 0.0), (np.sqrt(0.5), np.sqrt(0.5)), int(side)),
    ]
    radii, masses = RADIUS * rng.uniform(0.5, 1.0, n_balls), 10.0 ** rng.uniform(-3, 0, n_balls)
    system = BallSystem(radii, masses, surfaces, dimension, friction=0.3)
    width = RADIUS * (n_balls / crowding) ** (1.0 / dimension)
    position = rng.uniform(-width, width, n_balls * dimension)
    assert deepest(system, moved_apart(system, position)) <= max(deepest(system, position), 1.1 * DEPTH)


@given(
    seed=st.integers(0, 2**32 - 1),
    n_balls=st.integers(2, 40),
    crowding=st.floats(0.2, 30.0),
    dimension=st.sampled_from([2, 3]),
)
def test_the_overlap_of_a_step_is_the_one_that_its_projection_leaves(
    seed: int, n_balls: int, crowding: float, dimension: int
) -> None:
    """Up to 40 balls are in the space of one; not all clusters are separated in one step."""
    system = free_balls(dimension, np.full(n_balls, 0.01))
    width = RADIUS * (n_balls / crowding) ** (1.0 / dimension)
    position = np.random.default_rng(seed).uniform(-width, width, n_balls * dimension)
    step = stepper(system, DEPTH).step(State(0.0, position, np.zeros(n_balls * system.dofs_per_ball)))
    left = deepest(system, step.state.position)
    assert step.overlap == (left if left > (1.0 + ACCURACY) * DEPTH else 0.0)


@pytest.mark.parametrize("pitch", [1.9, 1.5, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_crowd_of_overlapping_balls_with_room_around_it_is_separated_in_one_step(pitch: float, seed: int) -> None:
    """Balls that are pushed far meet others, which only the next passes detect."""
    grid = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    jitter = np.random.default_rng(seed).uniform(-0.1, 0.1, grid.shape)
    system = free_balls(3, np.full(len(grid), 0.01))
    end = projected(system, RADIUS * (pitch * grid + jitter).ravel(), np.zeros(0), DEPTH)
    assert end.overlap == 0.0
    assert deepest(system, end.position) <= (1.0 + ACCURACY) * DEPTH


@pytest.mark.parametrize(("room", "overlap"), [(0.9, 0.1 * RADIUS), (1.1, 0.0)])
def test_a_ball_between_walls_overlaps_as_far_as_they_are_too_close(room: float, overlap: float) -> None:
    walls = [Plane((-room * RADIUS, 0.0), (1.0, 0.0)), Plane((room * RADIUS, 0.0), (-1.0, 0.0))]
    system = BallSystem(np.array([RADIUS]), np.array([0.01]), walls, 2)
    assert projected(system, np.zeros(2), np.zeros(2), DEPTH).overlap == pytest.approx(overlap, rel=1e-9)


@pytest.mark.parametrize("offset", [0.0, 0.03, -0.05])
def test_a_ball_between_walls_that_leave_it_no_room_is_not_pushed_deeper_into_one_of_them(offset: float) -> None:
    walls = [Plane((-0.9 * RADIUS, 0.0), (1.0, 0.0)), Plane((0.9 * RADIUS, 0.0), (-1.0, 0.0))]
    system = BallSystem(np.array([RADIUS]), np.array([0.01]), walls, 2)
    position = np.array([offset * RADIUS, 0.0])
    assert deepest(system, moved_apart(system, position)) <= deepest(system, position)


@given(
    seed=st.integers(0, 2**32 - 1),
    n_balls=st.integers(2, 40),
    crowding=st.floats(0.2, 3.0),
    dimension=st.sampled_from([2, 3]),
)
def test_a_free_cluster_keeps_its_centre_of_mass_and_all_its_velocities(
    seed: int, n_balls: int, crowding: float, dimension: int
) -> None:
    """Its momentum, spins and kinetic energy are therefore bitwise equal to those of the rule without projection."""
    rng = np.random.default_rng(seed)
    masses = 10.0 ** rng.uniform(-3, 0, n_balls)
    system = free_balls(dimension, masses)
    width = RADIUS * (n_balls / crowding) ** (1.0 / dimension)
    position = rng.uniform(-width, width, n_balls * dimension)
    start = State(0.0, position, rng.normal(size=n_balls * system.dofs_per_ball))
    plain, moved = (stepper(system, depth).step(start).state for depth in (None, DEPTH))
    assert plain.velocity.tobytes() == moved.velocity.tobytes()
    shift = masses @ (system.centres(moved.position) - system.centres(plain.position))
    assert shift == pytest.approx(np.zeros(dimension), abs=1e-14 * masses.sum())


def test_a_general_system_is_projected_as_the_same_system_of_balls() -> None:
    masses = np.array([0.01, 0.03])
    general, balls = two_points(np.diag(np.repeat(masses, 2))), free_balls(2, masses, friction=None)
    position = np.array([0.0, 0.0, 1.2 * RADIUS, 0.9 * RADIUS])
    ends = [moved_apart(system, position) for system in (general, balls)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-15)
    assert not np.array_equal(ends[0], position)


def test_the_projected_position_is_nearest_in_the_metric_of_a_full_mass_matrix() -> None:
    """δq = M⁻¹ w (wᵀM⁻¹w)⁻¹ (−g − d) for one contact along w."""
    root = np.random.default_rng(3).normal(size=(4, 4))
    mass = root @ root.T + np.eye(4)
    system = two_points(mass)
    position = np.array([0.0, 0.0, 1.9 * RADIUS, 0.0])
    w = np.array([-1.0, 0.0, 1.0, 0.0])
    along = np.linalg.solve(mass, w)
    expected = along / (w @ along) * (0.1 * RADIUS - DEPTH)
    moved = moved_apart(system, position) - position
    # the gap is curved: the motion across w is of second order
    assert moved == pytest.approx(expected, abs=np.sum(expected**2) / RADIUS)
    assert np.abs(expected[[1, 3]]).max() > 0.1 * np.abs(expected).max()


@pytest.mark.parametrize("n_balls", [2, 5])
def test_a_row_of_balls_is_moved_apart_to_the_allowed_depth_at_once(n_balls: int) -> None:
    """Gaps are linear along a row, so one pass suffices for any number of balls."""
    system = free_balls(3, np.full(n_balls, 0.01))
    centres = np.zeros((n_balls, 3))
    centres[:, 0] = (2.0 * RADIUS - 5.0 * DEPTH) * np.arange(n_balls)
    position = moved_apart(system, centres.ravel())
    gaps = np.diff(position.reshape(-1, 3)[:, 0]) - 2.0 * RADIUS
    assert gaps == pytest.approx(np.full(n_balls - 1, -DEPTH), abs=1.001 * ACCURACY * DEPTH)


@dataclass
class Linear:
    """A unit mass in n directions with one joint r = wᵀ q and one contact g = nᵀ q."""

    joint: np.ndarray
    normal: np.ndarray

    def move(self, position: np.ndarray, velocity: np.ndarray, seconds: float) -> np.ndarray:
        return position + seconds * velocity

    def overlaps(self, position: np.ndarray, tolerated: float) -> Overlaps:
        gap = np.array([self.normal @ position])
        closed = gap < 0.0
        return Overlaps(
            gap[closed],
            sp.csc_array(self.normal[:, None][:, closed]),
            InverseMass.create(np.ones(len(position))),
            JointErrors(np.array([self.joint @ position]), sp.csc_array(self.joint[:, None])),
        )


@pytest.mark.parametrize("opening", [-3.0, -0.2, 0.0, 0.2, 3.0])
@pytest.mark.parametrize("part", [0.0, 0.5])
def test_joints_close_while_contacts_are_moved_apart_the_nearest_way(opening: float, part: float) -> None:
    """The nearest q with wᵀ q = 0 and nᵀ q ≥ -d: first onto the joint, then along the part of n normal to w."""
    joint, normal = np.array([1.0, -1.0, 0.0]), np.array([0.0, 1.0, part])
    start = DEPTH * np.array([opening - 2.0, -2.0, 0.0])
    system = Linear(joint, normal)
    closed = start - joint * (joint @ start) / (joint @ joint)
    along = normal - joint * (joint @ normal) / (joint @ joint)
    expected = closed + along * max(0.0, -DEPTH - normal @ closed) / (along @ along)
    end = projected(system, start, np.array([1.0, 0.0, 2.0]), DEPTH)  # type: ignore[arg-type]
    assert end.position == pytest.approx(expected, abs=(ACCURACY + 1e-9) * DEPTH)
    assert end.velocity == pytest.approx([0.5, 0.5, 2.0], abs=1e-12)  # the part along w is removed


class Jammed(Linear):
    """One coordinate that a joint keeps in a contact five times too deep."""

    def overlaps(self, position: np.ndarray, tolerated: float) -> Overlaps:
        found = super().overlaps(position - 5.0 * DEPTH, tolerated)
        joints = JointErrors(position.copy(), found.joints.directions)
        return replace(found, joints=joints)


def test_a_projection_that_closes_joints_tells_the_overlap_that_it_leaves() -> None:
    system = Jammed(np.ones(1), np.ones(1))
    end = projected(system, np.zeros(1), np.zeros(1), DEPTH)  # type: ignore[arg-type]
    assert end.overlap == 5.0 * DEPTH


def test_joints_that_exceed_the_memory_are_refused() -> None:
    """Closing the joints of 100 000 free bodies, each with 6 coordinates, would take terabytes of memory."""
    n_dofs, n_rows = 600_000, 300_000
    joints = JointErrors(np.zeros(n_rows), sp.csc_array((n_dofs, n_rows)))
    with pytest.raises(InsufficientMemoryError, match=r"for closing joints with 300,000 rows, but .*; simulate fewer"):
        _joint_inverse(InverseMass.create(np.ones(n_dofs)), joints)


def test_the_energy_of_a_resting_pile_does_not_grow() -> None:
    system = floor(5)
    heights = RADIUS - 0.9 * DEPTH + (2.0 * RADIUS - 0.9 * DEPTH) * np.arange(5)
    start = State(0.0, np.column_stack([np.zeros((5, 2)), heights]).ravel(), system.without_spin(np.zeros((5, 3))))
    weight = 0.01 * 9.81

    def energy(state: State) -> float:
        return system.kinetic_energy(state.velocity) + weight * state.position[2::3].sum()

    for step in stepper(system, DEPTH).steps(start, 200):
        assert energy(step.state) <= energy(start) + 1e-12
    assert np.abs(step.state.position - start.position).max() <= 1e-3 * DEPTH


@pytest.mark.parametrize("phase", [0.05, 0.3, 0.6, 0.95])
def test_a_ball_that_falls_on_a_floor_gains_no_more_than_lifting_it_by_half_a_step_of_its_way(phase: float) -> None:
    system, speed, weight = floor(1), 2.0, 0.01 * 9.81
    height = RADIUS + phase * speed * 5e-4
    state = State(0.0, np.array([0.0, 0.0, height]), np.array([0.0, 0.0, -speed]))
    energies = [0.5 * 0.01 * speed**2 + weight * height]
    for step in stepper(system, DEPTH).steps(state, 5):
        state = step.state
        energies.append(system.kinetic_energy(state.velocity) + weight * state.position[2])
        assert deepest(system, state.position) <= (1.0 + ACCURACY) * DEPTH
    half_way = 0.5 * 5e-4 * (speed + 5 * 9.81 * 5e-4)
    assert np.diff(energies).max() <= weight * half_way


def test_shallow_penetrations_are_left_unchanged() -> None:
    system = floor(1)
    start = State(0.0, np.array([0.0, 0.0, RADIUS - 0.5 * DEPTH]), system.without_spin(np.zeros((1, 3))))
    plain, projected = (stepper(system, depth).step(start).state for depth in (None, DEPTH))
    assert plain.position.tobytes() == projected.position.tobytes()


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_motion_that_is_not_finite_is_reported_as_without_projection() -> None:
    system = replace(two_points(np.eye(4)), force=lambda q, u: np.full(4, np.inf))
    start = State(0.0, np.array([0.0, 0.0, 3.0 * RADIUS, 0.0]), np.zeros(4))
    with pytest.raises(StepError, match="no longer finite"):
        list(stepper(system, DEPTH).steps(start, 1))


@pytest.mark.parametrize("depth", [0.0, -1.0, float("nan")])
def test_depth_out_of_range_is_refused(depth: float) -> None:
    with pytest.raises(ProblemError, match="depth"):
        stepper(floor(1), depth)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("friction", [None, 0.3])
def test_balls_move_to_the_nearest_position_without_overlaps(dimension: int, friction: float | None) -> None:
    """Balls of different masses, some on a plane: δq = M⁻¹ W p with p ≥ 0, open gaps, and p = 0 where a gap is open.

    Pushes p follow from δq by nonnegative least squares.
    """
    rng, depth = np.random.default_rng(8), 1e-9
    plane = [Plane((0.0,) * dimension, (*[0.0] * (dimension - 1), 1.0))]
    system = BallSystem(np.full(60, RADIUS), rng.uniform(0.5, 2.0, 60), plane, dimension, friction=friction)
    side = 30.0 * RADIUS if dimension == 2 else 8.0 * RADIUS
    overlaps = system.overlaps(rng.uniform(0.5 * RADIUS, side, 60 * dimension), 0.0)
    assert overlaps is not None
    displacement, sweeps = _displacement_of_balls(overlaps, depth, 100_000)
    assert sweeps < 100_000
    gaps = overlaps.gap + depth + overlaps.normals.transposed_times(displacement)
    assert gaps.min() >= -ACCURACY * depth
    root = np.sqrt(overlaps.inverse_mass.matrix.data)[:, None]
    directions = root * np.column_stack([overlaps.normals.times(unit) for unit in np.eye(len(gaps))])
    pushes, residual = nnls(directions, displacement / root.ravel())
    assert residual <= 1e-9 * np.linalg.norm(displacement / root.ravel())
    assert pushes @ np.maximum(gaps, 0.0) <= 1e-6 * pushes @ np.abs(overlaps.gap)
