"""Bodies can stand if and only if forces within the laws balance the loads; a mechanism proves that they cannot."""

from dataclasses import replace
from math import atan, cos, inf, radians, sin, tan

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.contact.laws import LawKind, Laws
from proxbench.problems.contact.transformations import duplicated, in_units
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.equilibrium import (
    find_equilibrium,
    largest_push,
    least_friction,
    problem_at_rest,
    with_friction,
)
from proxbench.problems.motion.scenes.inclines import BlockOnIncline, SphereOnIncline
from proxbench.problems.motion.scenes.resting import Stack, VGroove
from proxbench.problems.motion.scenes.scene import ClosedFormScene
from proxbench.problems.motion.state import State
from proxbench.solvers import Stop, create

from .exact_contacts import FIXED, Point, bodies_at_rest

Vector = NDArray[np.float64]


def at_rest(scene: ClosedFormScene) -> ContactProblem:
    return problem_at_rest(scene.system(), scene.start())


def box_on_incline(slope: float, width: float, height: float, friction: float) -> ContactProblem:
    """A box of unit depth and mass on its four lower corners, on an incline that descends along x."""
    down, up = np.array([cos(slope), 0.0, -sin(slope)]), np.array([sin(slope), 0.0, cos(slope)])
    corners = [0.5 * width * x * down + np.array([0.0, 0.5 * y, 0.0]) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    inertia = [(1.0 + height**2) / 12.0, (width**2 + height**2) / 12.0, (1.0 + width**2) / 12.0]
    return bodies_at_rest([0.5 * height * up], [1.0], [inertia], [Point(0, FIXED, x, up) for x in corners], friction)


def leaning_ladder(angle: float) -> ContactProblem:
    """A rod of unit length and mass, at ``angle`` to the ground, between the ground and a wall."""
    inertia = 1.0 / 12.0
    along = np.array([cos(angle), sin(angle)])
    turned = np.array([-along[1], along[0]])
    # columns N, T at the foot (−along/2) and at the top (+along/2); the wall pushes towards −x
    directions = np.zeros((3, 4))
    for contact, (arm, normal) in enumerate([(-0.5, np.array([0.0, 1.0])), (0.5, np.array([-1.0, 0.0]))]):
        for lane, axis in enumerate([normal, np.array([-normal[1], normal[0]])]):
            directions[:, 2 * contact + lane] = np.append(axis, arm * float(turned @ axis))
    motion = np.array([0.0, -9.81, 0.0])
    return ContactProblem.from_factors(
        directions, 1.0 / np.array([1.0, 1.0, inertia]), directions.T @ motion, 0.5, 2, free_motion=motion
    )


@pytest.mark.parametrize("degrees", [1.0, 20.0, 45.0, 80.0])
def test_a_block_stands_on_an_incline_iff_friction_is_the_tangent_of_the_slope(degrees: float) -> None:
    slope = radians(degrees)
    problem = at_rest(BlockOnIncline(slope, 0.1, 0.0))
    assert least_friction(problem) == pytest.approx(tan(slope), abs=5e-7 * (1.0 + tan(slope)))
    assert find_equilibrium(with_friction(problem, tan(slope) * 1.0001)).can_stand
    assert not find_equilibrium(with_friction(problem, tan(slope) * 0.9999)).can_stand


@pytest.mark.parametrize("degrees", [30.0, 50.0, 70.0])
def test_a_ladder_leans_by_friction_at_both_ends(degrees: float) -> None:
    """At the limit, both ends slip: 2 μ tan θ = 1 − μ²."""
    angle = radians(degrees)
    assert least_friction(leaning_ladder(angle)) == pytest.approx((1.0 - sin(angle)) / cos(angle), rel=1e-6)


@pytest.mark.parametrize(("width", "friction", "limit"), [(0.4, 0.7, 0.4), (2.0, 0.7, 0.7)])
def test_a_box_tips_or_slides(width: float, friction: float, limit: float) -> None:
    for slope, stands in ((atan(limit) - 1e-4, True), (atan(limit) + 1e-4, False)):
        assert find_equilibrium(box_on_incline(slope, width, 1.0, friction)).can_stand is stands


@pytest.mark.parametrize(("width", "friction", "limit"), [(0.4, 0.7, 0.4), (2.0, 0.7, 0.7)])
def test_a_push_tips_or_slides_a_box_on_level_ground(width: float, friction: float, limit: float) -> None:
    problem = box_on_incline(0.0, width, 1.0, friction)
    for direction in ([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [-2.0, 0.0, 0.0, 0.0, 0.0, 0.0]):
        collapse = largest_push(problem, np.array(direction))
        assert collapse.factor == pytest.approx(limit, rel=1e-6)
        assert collapse.mechanism @ direction > 0.0
    upwards = largest_push(problem, np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    assert upwards.factor == pytest.approx(1.0, rel=1e-6)
    assert largest_push(problem, np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])).factor == inf


@pytest.mark.parametrize("friction", [0.01, 0.3, 5.0])
def test_a_ball_in_a_level_groove_stands_with_any_friction_and_in_an_inclined_one_with_none(friction: float) -> None:
    assert find_equilibrium(at_rest(VGroove(0.4, friction, 0.0))).can_stand
    assert least_friction(at_rest(VGroove(0.4, friction, 0.0))) == 0.0
    assert least_friction(at_rest(VGroove(0.4, friction, 0.2))) == inf


def test_walls_without_friction_carry_the_ball_by_their_known_forces() -> None:
    scene = VGroove(0.4, None, 0.0)
    assert find_equilibrium(at_rest(scene)).forces == pytest.approx([scene.wall_force] * 2, rel=1e-6)


def test_a_ball_begins_to_roll_down_an_incline_as_it_does_in_motion() -> None:
    """In rolling, no contact opens or slides, so the associated model agrees with Coulomb's law."""
    scene = SphereOnIncline(0.3, 0.5)
    found = find_equilibrium(at_rest(scene))
    assert not found.can_stand
    velocity = np.concatenate([scene.acceleration * scene.downhill, [0.0, scene.spin_acceleration, 0.0]])
    assert found.mechanism == pytest.approx(velocity, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("masses", [(1.0,) * 5, (1.0, 3.0, 10.0), (1e6, 1.0), (1.0, 1e6), (1e-9, 1e-3)])
@pytest.mark.parametrize("friction", [None, 0.3])
def test_a_tower_of_balls_stands_on_the_weights_above(masses: tuple[float, ...], friction: float | None) -> None:
    scene = Stack(masses, friction)
    found = find_equilibrium(at_rest(scene))
    assert found.can_stand
    normals = found.forces[:: 1 if friction is None else 3]
    assert np.sort(normals) == pytest.approx(np.sort(scene.supports()), rel=1e-5)


def test_a_tower_that_leans_cannot_stand() -> None:
    scene = Stack((1.0, 1.0, 1.0), 0.5)
    start = scene.start()
    position = start.position.copy()
    position[6] += 1e-6  # the topmost ball, in the plane
    assert not find_equilibrium(problem_at_rest(scene.system(), replace(start, position=position))).can_stand


def test_without_contacts_bodies_fall_freely_unless_a_margin_closes_them() -> None:
    scene = Stack((1.0, 2.0), 0.5)
    lifted = State(0.0, np.array([0.0, 0.0, 0.1001, 0.0, 0.0, 0.3003]), np.zeros(12))
    falling = find_equilibrium(problem_at_rest(scene.system(), lifted))
    assert falling.imbalance == 1.0
    assert falling.mechanism == pytest.approx(np.tile([0.0, 0.0, -9.81, 0.0, 0.0, 0.0], 2))
    closed = problem_at_rest(scene.system(), lifted, margin=1e-3)
    assert closed.n_contacts == 2
    assert find_equilibrium(closed).can_stand


def test_margin_applies_to_general_systems() -> None:
    scene = BlockOnIncline(0.1, 0.5, 0.0)
    lifted = State(0.0, np.array([0.0, 1e-4]), np.zeros(2))
    assert find_equilibrium(problem_at_rest(scene.system(), lifted)).imbalance == 1.0
    assert find_equilibrium(problem_at_rest(scene.system(), lifted, margin=1e-3)).can_stand


def random_pile(seed: int, friction: float) -> ContactProblem:
    """Return a few randomly placed balls in a groove, which cannot stay at rest."""
    rng = np.random.default_rng(seed)
    planes = [Plane((0.0, 0.0, 0.0), (side, 0.0, 1.0)) for side in (-1.0, 1.0)]
    system = BallSystem(
        rng.uniform(0.1, 0.2, 6),
        rng.uniform(0.5, 2.0, 6),
        planes,
        3,
        accelerations=(lambda centres, velocities, masses: np.tile([0.0, 0.0, -9.81], (6, 1)),),
        friction=friction,
    )
    centres = np.column_stack([rng.uniform(-0.2, 0.2, 6), rng.uniform(-0.1, 0.1, 6), rng.uniform(0.1, 0.5, 6)])
    return problem_at_rest(system, State(0.0, centres.ravel(), np.zeros(36)))


@pytest.mark.parametrize("seed", range(6))
def test_the_mechanism_is_the_velocity_after_one_second_of_the_associated_model(seed: int) -> None:
    problem = random_pile(seed, 0.4)
    found = find_equilibrium(problem)
    solution = create("ClarabelSOCP").prepare(problem).solve(Stop(1e-10, 1000, 60.0))
    factors = problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    velocity = factors.free_motion + factors.inverse_mass.times(factors.force_directions @ solution.impulses)
    masses = 1.0 / factors.inverse_mass.matrix.data
    energy, free_energy = (float(masses @ one**2) for one in (velocity, factors.free_motion))
    assert found.imbalance**2 == pytest.approx(energy / free_energy, rel=1e-7)
    assert np.abs(velocity - found.mechanism).max() <= 1e-4 * np.abs(factors.free_motion).max()


@pytest.mark.parametrize("seed", range(6))
def test_a_mechanism_proves_that_nothing_balances_the_loads(seed: int) -> None:
    problem = random_pile(seed, 0.4)
    found = find_equilibrium(problem)
    assert not found.can_stand
    factors = problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    opening = (factors.force_directions.T @ found.mechanism).reshape(-1, 3)
    rounding = 1e-6 * np.abs(opening).max()
    assert (opening[:, 0] - 0.4 * np.linalg.norm(opening[:, 1:], axis=1) >= -rounding).all()
    loads = np.linalg.solve(factors.inverse_mass.matrix.toarray(), factors.free_motion)
    assert found.mechanism @ loads > 0.0


@pytest.mark.parametrize("units", [(1e6, 1.0, 1.0), (1.0, 1e-3, 1.0), (1e-9, 1e3, 1e3)])
def test_the_answer_does_not_depend_on_units(units: tuple[float, float, float]) -> None:
    for problem in (box_on_incline(0.3, 1.0, 1.0, 0.2), random_pile(0, 0.4), at_rest(Stack((1.0, 5.0), 0.2))):
        # in_units changes only velocities, so the inertia of a rotation keeps its unit of length
        other = in_units(problem, *units).problem
        found, changed = find_equilibrium(problem), find_equilibrium(other)
        assert changed.imbalance == pytest.approx(found.imbalance, rel=1e-6, abs=1e-8)


def test_redundant_contacts_change_no_answer() -> None:
    problem = box_on_incline(atan(0.4), 2.0, 1.0, 0.1)
    doubled = duplicated(duplicated(problem, 0).problem, 2).problem
    assert least_friction(doubled) == pytest.approx(least_friction(problem), rel=1e-6)


def test_friction_of_fixed_bound_holds_up_to_its_bound() -> None:
    laws = Laws.in_order([LawKind.PLANAR_FRICTION], np.zeros(1), np.array([5.0]), np.array([-1]))
    problem = ContactProblem.from_factors(
        np.ones((1, 1)), np.array([0.5]), np.array([2.0]), laws=laws, free_motion=np.array([2.0])
    )  # a load of 4 N on 2 kg
    found = find_equilibrium(problem)
    assert found.can_stand
    assert found.forces == pytest.approx([-4.0], rel=1e-6)
    assert largest_push(problem, np.ones(1)).factor == pytest.approx(0.25, rel=1e-6)
    assert largest_push(problem, -np.ones(1)).factor == pytest.approx(2.25, rel=1e-6)
    heavier = replace(problem, factors=replace(problem.factors, free_motion=np.array([5.0])), free_velocity=[5.0])
    assert find_equilibrium(heavier).imbalance == pytest.approx(0.5, rel=1e-6)


def test_a_joint_pulls_as_well_as_it_pushes() -> None:
    """A pendulum hangs below its pivot; with a contact in place of the joint, it falls."""
    motion = np.array([0.0, -9.81])
    held = ContactProblem.from_factors(np.eye(2), np.ones(2), motion, laws=Laws.joints(2), free_motion=motion)
    assert find_equilibrium(held).can_stand
    assert least_friction_is_refused(held)
    touching = ContactProblem.from_factors(-np.eye(2)[:, 1:], np.ones(2), -motion[1:], dim=1, free_motion=motion)
    assert not find_equilibrium(touching).can_stand


def least_friction_is_refused(problem: ContactProblem) -> bool:
    with pytest.raises(ProblemError, match="no contact has friction"):
        least_friction(problem)
    return True


def test_invalid_arguments_are_refused_in_one_sentence() -> None:
    given = ContactProblem.from_delassus(np.eye(3), [-1.0, 0.0, 0.0], 0.3)
    with pytest.raises(ProblemError, match="lacks the factors"):
        find_equilibrium(given)
    scene = Stack()
    with pytest.raises(ProblemError, match="`margin` must be"):
        problem_at_rest(scene.system(), scene.start(), -1.0)
    with pytest.raises(ProblemError, match="not all zero"):
        largest_push(at_rest(scene), np.zeros(15))
