"""Capsules, cylinders and polyhedra roll, slide, fall and rest according to closed forms."""

from collections.abc import Sequence
from math import cos, sin, sqrt, tan

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems.motion.bodies.rigid.orientation import IDENTITY, Y_AXIS, Z_AXIS, about, product
from proxbench.problems.motion.bodies.rigid.polyhedron import convex_polyhedron
from proxbench.problems.motion.bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from proxbench.problems.motion.bodies.rigid.shapes import Box, Capsule, Cylinder, HalfSpace, Shape
from proxbench.problems.motion.detection import narrow_phase
from proxbench.problems.motion.detection.coal_contacts import find_with_coal, needs_coal
from proxbench.problems.motion.scenes.effects import Friction, Gravity
from proxbench.problems.motion.scenes.rigid.boxes import downhill_direction, incline_normal
from proxbench.problems.motion.scenes.rigid.effects import rigid_bodies
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Status, Stop, create

Array = NDArray[np.float64]

GRAVITY, MASS, STEP, OVERLAP = 9.81, 2.0, 5e-3, 1e-9
LYING = (sqrt(0.5), -sqrt(0.5), 0.0, 0.0)
"""Orientation that turns the axis of a round body to y."""

FLOOR, SLAB = HalfSpace(), Box((6.0, 4.0, 1.0))
CAPSULE, CYLINDER = Capsule(0.1, 0.4), Cylinder(0.1, 0.4)


def ground(shape: Shape, slope: float = 0.0) -> FixedBody:
    """Return a half-space or a slab whose upper face contains the origin and descends along x."""
    below = 0.5 * SLAB.size[2] if shape is SLAB else 0.0
    return FixedBody(shape, tuple(-below * incline_normal(slope)), tuple(about(Y_AXIS, slope)))


def bodies(shapes: Sequence[Shape], fixed: FixedBody, friction: float) -> RigidBodies:
    return rigid_bodies(list(shapes), np.full(len(shapes), MASS), [fixed], (Gravity(GRAVITY), Friction(friction)))


def take_steps(system: RigidBodies, position: object, count: int) -> list[Step]:
    start = State(0.0, np.array(position, dtype=np.float64).ravel(), np.zeros(6 * system.n_bodies))
    rule = MidpointRule(system, create("Robust"), Stop(1e-12, 100_000), STEP)
    steps = list(rule.steps(start, count))
    assert {step.status for step in steps} <= {Status.SOLVED, None}
    return steps


def normal_impulses(step: Step) -> Array:
    assert step.contacts is not None
    impulses: Array = step.contacts.normals(step.impulses)
    return impulses


@pytest.mark.parametrize("friction", [0.5, 0.05], ids=["rolls", "slides"])
@pytest.mark.parametrize("below", [FLOOR, SLAB], ids=["half-space", "slab"])
@pytest.mark.parametrize("shape", [CAPSULE, CYLINDER], ids=["capsule", "cylinder"])
def test_a_round_body_rolls_or_slides_down_an_incline_as_in_closed_form(
    shape: Capsule | Cylinder, below: Shape, friction: float
) -> None:
    """Steps are exact for constant accelerations; half of the overlap shortens the arm of friction by 5e-9."""
    if needs_coal(shape, below):
        pytest.importorskip("coal")
    slope, inertia = 0.3, shape.inertia[2] / shape.volume
    factor = inertia / shape.radius**2
    rolls = friction > tan(slope) * factor / (1.0 + factor)
    assert rolls == (friction == 0.5)
    acceleration = GRAVITY * (sin(slope) / (1.0 + factor) if rolls else sin(slope) - friction * cos(slope))
    turning = acceleration / shape.radius if rolls else friction * GRAVITY * cos(slope) * shape.radius / inertia
    normal, downhill = incline_normal(slope), downhill_direction(slope)
    begin = (shape.radius - OVERLAP) * normal
    system = bodies([shape], ground(below, slope), friction)
    for step in take_steps(system, [*begin, *LYING], 200):
        time, pose = step.state.time, step.state.position
        expected = np.concatenate([acceleration * time * downhill, [0.0, 0.0, turning * time]])
        assert step.state.velocity == pytest.approx(expected, abs=1e-6)
        assert pose[:3] == pytest.approx(begin + 0.5 * acceleration * time**2 * downhill, abs=1e-6)
        turned = product(about(Y_AXIS, 0.5 * turning * time**2)[None], np.array([LYING]))[0]
        assert abs(pose[3:] @ turned) == pytest.approx(1.0, abs=1e-9)
        impulses = normal_impulses(step)
        assert impulses == pytest.approx(np.full(2, 0.5 * MASS * GRAVITY * cos(slope) * STEP), rel=1e-6)


@pytest.mark.parametrize("below", [FLOOR, SLAB], ids=["half-space", "slab"])
def test_a_capsule_rests_on_two_contacts(below: Shape) -> None:
    start = np.array([0.3, 0.2, CAPSULE.radius - OVERLAP, *product(about(Z_AXIS, 0.4)[None], np.array([LYING]))[0]])
    for step in take_steps(bodies([CAPSULE], ground(below), 0.5), start, 400):
        assert step.state.position == pytest.approx(start, abs=1e-12)
        assert normal_impulses(step) == pytest.approx(np.full(2, 0.5 * MASS * GRAVITY * STEP), rel=1e-9)


def test_a_capsule_that_overhangs_a_slab_rests_on_its_edge_by_the_law_of_the_lever() -> None:
    """Forces at the edge of the slab and at the end of the capsule are inverse to their distances from the centre."""
    edge, half = 0.05, 0.5 * CAPSULE.length
    start = np.array([0.3, 0.5 * SLAB.size[1] - edge, CAPSULE.radius - OVERLAP, *LYING])
    for step in take_steps(bodies([CAPSULE], ground(SLAB), 0.5), start, 400):
        assert step.contacts is not None
        assert step.state.position == pytest.approx(start, abs=1e-12)
        weight, impulses = MASS * GRAVITY * STEP, np.sort(normal_impulses(step))
        assert impulses == pytest.approx(weight * np.array([edge, half]) / (edge + half), rel=1e-9)


CORNERS = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.1, 0.4, 0.0], [0.2, 0.15, 0.3], [0.3, 0.1, 0.25]])
"""A polyhedron on a triangle, whose corner forces are unique."""


@pytest.mark.parametrize("height", [-OVERLAP, 0.05], ids=["laid", "dropped"])
@pytest.mark.parametrize("below", [FLOOR, SLAB], ids=["half-space", "slab"])
def test_a_polyhedron_rests_on_a_triangle_with_the_forces_that_balance_its_weight(below: Shape, height: float) -> None:
    """Forces at the corners of a triangle are the weight times the barycentric coordinates of the centre of mass.

    The impact of a face on a plane without restitution has the same shares, as it stops every point.
    """
    shape, pose = convex_polyhedron(CORNERS + np.array([0.0, 0.0, height]))
    shares = np.linalg.solve(np.vstack([CORNERS[:3, :2].T, np.ones(3)]), np.array([*pose[:2], 1.0]))
    assert (shares > 0.1).all()
    system = bodies([shape], ground(below), 0.5)
    steps = take_steps(system, pose, 200)
    speed, has_landed = 0.0, False
    for step in steps:
        if step.contacts is None:
            assert not has_landed
            speed = -step.state.velocity[2]
            continue
        momentum = MASS * (GRAVITY * STEP + (0.0 if has_landed else speed))
        has_landed = True
        points = system.contacts_within(system.poses(step.state.position), 0.0).point
        corners = np.argmin(np.linalg.norm(points[:, None, :2] - CORNERS[:3, :2], axis=2), axis=1)
        expected = momentum * shares[corners]
        assert normal_impulses(step) == pytest.approx(expected, rel=1e-7)
        assert np.abs(step.state.velocity).max() <= 1e-10
    assert has_landed
    assert (speed > 0.9) == (height > 0.0)
    assert steps[-1].state.position[:2] == pytest.approx(pose[:2], abs=1e-9)
    assert abs(steps[-1].state.position[3:] @ pose[3:]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("below", [FLOOR, SLAB], ids=["half-space", "slab"])
def test_a_cylinder_that_is_dropped_on_its_end_rests_upright(below: Shape) -> None:
    if needs_coal(CYLINDER, below):
        pytest.importorskip("coal")
    start = np.array([0.0, 0.0, 0.5 * CYLINDER.length + 0.01, *IDENTITY])
    *_, last = take_steps(bodies([CYLINDER], ground(below), 0.5), start, 200)
    assert normal_impulses(last).sum() == pytest.approx(MASS * GRAVITY * STEP, rel=1e-9)
    assert np.abs(last.state.velocity).max() <= 1e-9
    assert last.state.position[:2] == pytest.approx(np.zeros(2), abs=1e-8)
    assert abs(last.state.position[3:] @ IDENTITY) == pytest.approx(1.0, abs=1e-12)
    speed = sqrt(2.0 * GRAVITY * 0.01)
    assert -STEP * speed <= last.state.position[2] - 0.5 * CYLINDER.length <= 0.0


def test_a_box_dropped_on_a_box_moves_by_coal_as_by_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """It lands on a face, turned about the vertical, and slides and tips over the edge of the box below."""
    pytest.importorskip("coal")
    shapes = (Box((0.3, 0.2, 0.1)), Box((0.4, 0.4, 0.2)))
    system = bodies(shapes, ground(FLOOR), 0.3)
    start = np.array([[0.1, 0.05, 0.27, *about(Z_AXIS, 0.3)], [0.0, 0.0, 0.1 - OVERLAP, *IDENTITY]])
    own = take_steps(system, start, 100)

    def find_boxes(_: object, centres: Array, rotations: Array, pairs: Array, margin: float) -> object:
        parts = [
            find_on_plane(_, centres, rotations, pairs[pairs[:, 1] == 2], margin),
            find_with_coal((*shapes, FLOOR), centres, rotations, pairs[pairs[:, 1] != 2], margin),
        ]
        return tuple(np.concatenate(column) for column in zip(*parts, strict=True))

    find_on_plane = narrow_phase._find_boxes
    monkeypatch.setattr(narrow_phase, "_find_boxes", find_boxes)
    found = take_steps(system, start, 100)
    assert max(len(normal_impulses(step)) for step in found) == 8
    for one, other in zip(own, found, strict=True):
        assert other.state.position == pytest.approx(one.state.position, abs=1e-9)
        assert other.state.velocity == pytest.approx(one.state.velocity, abs=1e-7)
