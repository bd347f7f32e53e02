"""coal as a reference for boxes; exact gaps and persistent features of cylinders in every pose."""

from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from proxbench.problems.motion.bodies.rigid.orientation import (
    IDENTITY,
    Z_AXIS,
    about,
    exponential,
    product,
    rotation_matrices,
)
from proxbench.problems.motion.bodies.rigid.shapes import Box, Cylinder
from proxbench.problems.motion.detection.narrow_phase import find_contacts
from proxbench.problems.motion.detection.polyhedra import find_polyhedra

coal = pytest.importorskip("coal")

PAIR = np.array([[0, 1]])


@pytest.mark.parametrize("is_general", [False, True], ids=["boxes", "polyhedra"])
def test_depth_and_normal_of_boxes_are_those_of_coal(is_general: bool) -> None:
    """They are compared in 300 random poses; the normal is not unique if two directions are nearly equally short."""
    rng, compared = np.random.default_rng(0), 0
    request = coal.CollisionRequest()
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    while compared < 300:
        shapes = tuple(Box(tuple(rng.uniform(0.3, 1.5, 3).tolist())) for _ in range(2))
        poses = np.column_stack([rng.normal(size=(2, 3)) * 0.4, exponential(rng.normal(size=(2, 3)))])
        rotations = rotation_matrices(poses[:, 3:])
        result = coal.CollisionResult()
        bodies = []
        for shape, pose, rotation in zip(shapes, poses, rotations, strict=True):
            bodies += [coal.Box(*shape.size), coal.Transform3s(rotation, pose[:3])]
        if is_general:
            _, numbers = find_polyhedra(shapes, poses[:, :3].copy(), rotations, PAIR, 0.0)
            gap, normal = numbers[:, 6], numbers[:, 3:6]
        else:
            found = find_contacts(shapes, poses, PAIR, 0.0)
            gap, normal = found.gap, found.normal
        if not coal.collide(*bodies, request, result):
            assert not len(gap)
            continue
        compared += 1
        contact = result.getContact(0)
        assert gap.min() == pytest.approx(contact.penetration_depth, abs=5e-6)
        apart = poses[0, :3] - (gap.min() - 1e-5) * normal[int(np.argmin(gap))]
        bodies[1].setTranslation(apart)
        assert not coal.collide(*bodies, request, coal.CollisionResult())


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), exponent=st.integers(-12, -2), sign=st.sampled_from([-1.0, 0.0, 1.0]))
def test_a_tilted_cylinder_on_a_face_has_its_exact_gap(seed: int, exponent: int, sign: float) -> None:
    rng, gap = np.random.default_rng(seed), sign * 10.0**exponent
    tilt, turn = exponential(rng.normal(size=(1, 3))), exponential(rng.normal(size=(1, 3)))
    cosine = abs(rotation_matrices(tilt)[0][2, 2])
    low = 0.5 * cosine + 0.2 * np.sqrt(1.0 - cosine**2)
    rotation = rotation_matrices(turn)[0]
    centre = rotation @ [0.1, 0.2, 0.3 + low + gap]
    poses = np.array([[0.0, 0.0, 0.0, *turn[0]], [*centre, *product(turn, tilt)[0]]])
    found = find_contacts((Box((3.0, 3.0, 0.6)), Cylinder(0.2, 1.0)), poses, PAIR, 0.05)
    assert found.gap.min() == pytest.approx(gap, abs=1e-9)
    assert found.normal[0] == pytest.approx(-rotation[:, 2], abs=1e-8)


SLAB, ROLLER = Box((6.0, 4.0, 1.0)), Cylinder(0.1, 0.4)
LYING = np.array([sqrt(0.5), -sqrt(0.5), 0.0, 0.0])
"""Orientation that turns the axis of a cylinder to y."""


def on_slab(turn: float, along: float, is_upright: bool, gap: float = -1e-9) -> NDArray[np.float64]:
    """Return the poses of the slab and of a cylinder on its upper face, turned by ``turn`` [rad] about its axis."""
    about_axis = about(Z_AXIS, turn)
    if is_upright:
        cylinder = [along, 0.3, 0.5 + 0.5 * ROLLER.length + gap, *about_axis]
    else:
        cylinder = [along, 0.3, 0.5 + ROLLER.radius + gap, *product(LYING[None], about_axis[None])[0]]
    return np.array([[0.0, 0.0, 0.0, *IDENTITY], cylinder])


@pytest.mark.parametrize("is_first", [True, False], ids=["cylinder-first", "slab-first"])
def test_a_cylinder_that_rolls_far_from_the_centre_of_a_slab_is_in_contact_at_every_pose(is_first: bool) -> None:
    """coal misses contacts 1 nm deep, and finds the far side of the slab, at some of these poses."""
    rng = np.random.default_rng(0)
    for turn, along in zip(rng.uniform(0.0, 6.0, 300), rng.uniform(-2.8, 2.8, 300), strict=True):
        poses, shapes = on_slab(turn, along, False), (SLAB, ROLLER)
        if is_first:
            poses, shapes = poses[::-1].copy(), (ROLLER, SLAB)
        found = find_contacts(shapes, poses, PAIR, 0.0)
        assert found.gap == pytest.approx([-1e-9] * 2, abs=1e-14)
        assert np.abs(found.normal) == pytest.approx(np.array([[0.0, 0.0, 1.0]] * 2), abs=1e-14)


@pytest.mark.parametrize(("is_upright", "count"), [(False, 2), (True, 12)])
def test_features_persist_while_a_cylinder_rotates_about_its_axis(is_upright: bool, count: int) -> None:
    """Features stay at the ends of the contact line of a lying cylinder, and at points fixed to an upright one."""
    labels, rng = [], np.random.default_rng(0)
    for turn in np.linspace(0.0, 2.0, 101):
        poses = on_slab(turn, 0.1 + 0.1 * turn, is_upright)
        poses[1, 3:] = product(exponential(1e-12 * rng.normal(size=(1, 3))), poses[1:, 3:])[0]
        found = find_contacts((SLAB, ROLLER), poses, PAIR, 0.0)
        assert found.feature.tolist() == list(range(count))
        labels.append((found.point - poses[1, :3]) @ rotation_matrices(poses[1:, 3:])[0])
        if not is_upright:
            labels[-1] = labels[-1][:, 2]
    np.testing.assert_allclose(labels, np.broadcast_to(labels[0], np.shape(labels)), atol=1e-8)
