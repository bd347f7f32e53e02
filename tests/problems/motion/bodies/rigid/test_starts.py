"""A motion of rigid bodies with an invalid start is refused with one sentence and its remedy."""

import sys
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.joints import Joint, RigidJoints
from proxbench.problems.motion.bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from proxbench.problems.motion.bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from proxbench.problems.motion.bodies.rigid.shapes import Box, HalfSpace, Shape
from proxbench.problems.motion.bodies.rigid.starts import check_start
from proxbench.problems.motion.state import State

BOX = Box((1.0, 1.0, 1.0))


def bodies() -> RigidBodies:
    return RigidBodies([BOX, BOX], np.ones(2), [FixedBody(HalfSpace())])


def start(**changes: tuple[int, float]) -> State:
    """Return one box above the other; ``position`` and ``velocity`` take an index and a value."""
    numbers: dict[str, NDArray[np.float64]] = {
        "position": np.array([0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.6, 1.0, 0.0, 0.0, 0.0]),
        "velocity": np.zeros(12),
    }
    for name, (index, value) in changes.items():
        numbers[name][index] = value
    return State(0.0, **numbers)


def test_boxes_that_touch_may_start() -> None:
    check_start(bodies(), start())


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (start(position=(8, np.nan)), "position of body 1 is not finite at the start"),
        (start(velocity=(5, np.inf)), "velocity of body 0 is not finite at the start"),
        (start(position=(10, 0.0)), "orientation of body 1 at the start must be a unit quaternion"),
        (start(position=(10, 1.1)), "divide it by its length"),
        (State(0.0, np.zeros(13), np.zeros(12)), r"position at the start must have shape \(14,\), 7 numbers per body"),
        (State(0.0, start().position, np.zeros(13)), r"velocity at the start must have shape \(12,\)"),
        (start(position=(9, 1.4)), "body 0 and body 1 penetrate by 0.1 m at the start; move them apart"),
        (start(position=(2, 0.4)), "body 0 and fixed body 0 penetrate by 0.1 m at the start; move them apart"),
    ],
)
def test_invalid_initial_state_is_rejected(state: State, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        check_start(bodies(), state)


@pytest.mark.parametrize(("depth", "is_refused"), [(0.9e-5, False), (1.1e-5, True), (0.9e-3, True)])
def test_a_thin_body_may_penetrate_by_a_part_of_its_thickness(depth: float, is_refused: bool) -> None:
    """A card 0.2 mm thick is as wide as a hand: a part of its bounding radius would let it pass through the ground."""
    cards = RigidBodies([Box((0.1, 0.1, 2e-4))], np.ones(1), [FixedBody(HalfSpace())])
    lying = State(0.0, np.array([0.0, 0.0, 1e-4 - depth, 1.0, 0.0, 0.0, 0.0]), np.zeros(6))
    with pytest.raises(ProblemError, match=r"less than 0\.05 of the thickness") if is_refused else nullcontext():
        check_start(cards, lying)


def test_a_joint_that_is_open_at_the_start_is_refused() -> None:
    joined = replace(bodies(), joints=RigidJoints([Joint("ball", 0, 1, (0.0, 0.0, 0.5), (0.0, 0.0, -0.5))], 2))
    with pytest.raises(ProblemError, match=r"joint 0 does not close at the start: its error is 0.1 m or rad; correct"):
        check_start(joined, start())


def test_a_fixed_body_with_an_invalid_pose_is_refused() -> None:
    with pytest.raises(ProblemError, match="orientation of a fixed body must be a unit quaternion"):
        FixedBody(HalfSpace(), orientation=(0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ProblemError, match="centre of a fixed body must be finite"):
        FixedBody(HalfSpace(), (0.0, np.nan, 0.0))


@pytest.mark.parametrize(("partner", "is_needed"), [(Sphere(0.5), False), (BOX, True), (Capsule(0.2, 1.0), True)])
@pytest.mark.parametrize("is_fixed", [False, True])
def test_missing_coal_is_reported_before_bodies_meet(
    partner: Shape, is_needed: bool, is_fixed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bodies are far apart, and contacts with the plane do not need coal."""
    monkeypatch.setitem(sys.modules, "coal", None)
    plane, cylinder = FixedBody(HalfSpace()), Cylinder(0.5, 1.0)
    if is_fixed:
        apart = RigidBodies([cylinder], np.ones(1), [plane, FixedBody(partner, (9.0, 0.0, 0.5))])
    else:
        apart = RigidBodies([cylinder, partner], np.ones(2), [plane])
    poses = np.array([[5.0 * body, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0] for body in range(apart.n_bodies)])
    with pytest.raises(ProblemError, match="need coal") if is_needed else nullcontext():
        check_start(apart, State(0.0, poses.ravel(), np.zeros(6 * apart.n_bodies)))
