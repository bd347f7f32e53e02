"""Contacts of spheres, capsules and cylinders: known distances, and independence of the choice of axes and order."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.orientation import about, exponential, product, rotation_matrices
from proxbench.problems.motion.bodies.rigid.polyhedron import convex_polyhedron
from proxbench.problems.motion.bodies.rigid.shapes import Box, Capsule, Cylinder, HalfSpace, Shape, Sphere
from proxbench.problems.motion.detection.narrow_phase import ContactSet, find_contacts
from scipy.optimize import nnls

Array = NDArray[np.float64]
PAIR = np.array([[0, 1]])
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
LYING = tuple(about((1.0, 0.0, 0.0), np.pi / 2))
FAR = 20.0
BALL, CAPSULE, CYLINDER, BOX = Sphere(0.4), Capsule(0.2, 0.9), Cylinder(0.3, 0.8), Box((0.5, 0.8, 0.6))
ROOF = convex_polyhedron([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, -1, 1], [0, 1, 1]])[0]
ROUND_PAIRS = [
    (BALL, Sphere(0.3)),
    (BALL, CAPSULE),
    (CAPSULE, Capsule(0.1, 0.5)),
    (BALL, BOX),
    (CAPSULE, BOX),
    (BALL, ROOF),
    (CAPSULE, ROOF),
]
PAIRS = [*ROUND_PAIRS, (BALL, CYLINDER), (BALL, HalfSpace()), (CAPSULE, HalfSpace()), (CYLINDER, HalfSpace())]
SYMMETRIC = [*ROUND_PAIRS, (BALL, CYLINDER)]
COAL_PAIRS = [(CYLINDER, BOX), (CYLINDER, CAPSULE), (CYLINDER, CYLINDER), (CYLINDER, ROOF)]


def contacts(first: Shape, second: Shape, poses: Array, margin: float = FAR) -> ContactSet:
    return find_contacts((first, second), poses, PAIR, margin)


def at(centre: tuple[float, ...], turned: tuple[float, ...] = UPRIGHT) -> Array:
    """Return the poses of a body and of a second one at the origin."""
    return np.array([[*centre, *turned], [0.0, 0.0, 0.0, *UPRIGHT]])


def poses_with_gap(first: Shape, second: Shape, gap: float, seed: int) -> Array:
    """Return random poses with a given smallest gap, found by moves along the normal between nearest points."""
    rng = np.random.default_rng(seed)
    way = rng.normal(size=3)
    way *= 3.0 / np.linalg.norm(way)
    if isinstance(second, HalfSpace):
        way[2] = 3.0
    poses = np.column_stack([[way, np.zeros(3)], exponential(2.0 * rng.normal(size=(2, 3)))])
    if isinstance(second, HalfSpace):
        poses[1, 3:] = UPRIGHT
    found = contacts(first, second, poses)
    nearest = int(np.argmin(found.gap))
    poses[0, :3] += (gap - found.gap[nearest]) * found.normal[nearest]
    return moved_together(poses, rng)


def moved_together(poses: Array, rng: np.random.Generator) -> Array:
    return motion(poses, exponential(rng.normal(size=(1, 3))), rng.normal(size=3))


def motion(poses: Array, turn: Array, shift: Array) -> Array:
    rotation = rotation_matrices(turn)[0]
    turned = product(np.repeat(turn, len(poses), axis=0), poses[:, 3:])
    return np.column_stack([poses[:, :3] @ rotation.T + shift, turned])


def test_known_distances() -> None:
    crossed, tilted = tuple(about((0.0, 1.0, 0.0), np.pi / 2)), tuple(about((1.0, 0.0, 0.0), np.pi / 4))
    cases = [
        (Sphere(0.5), Sphere(0.25), at((0.0, 0.6, 0.8)), 0.25),
        (Sphere(0.5), HalfSpace(), at((3.0, 1.0, 0.4)), -0.1),
        (Sphere(0.5), Box((2.0, 2.0, 2.0)), at((1.3, 1.4, 0.0)), 0.0),
        (Sphere(0.5), Box((2.0, 2.0, 2.0)), at((0.9, 0.0, 0.0)), -0.6),
        (Sphere(0.5), Cylinder(1.0, 2.0), at((1.3, 0.0, 1.4)), 0.0),
        (Sphere(0.5), Cylinder(1.0, 2.0), at((0.7, 0.0, 0.0)), -0.8),
        (Capsule(0.2, 2.0), Capsule(0.3, 2.0), at((0.1, 0.2, 0.7), crossed), -0.3),
        (Capsule(0.2, 2.0), HalfSpace(), at((0.0, 0.0, 1.3)), 0.1),
        (Cylinder(0.3, 2.0), HalfSpace(), at((0.0, 0.0, 0.7), tilted), 0.7 - 1.3 * 0.5**0.5),
    ]
    for first, second, poses, gap in cases:
        assert contacts(first, second, poses).gap.min() == pytest.approx(gap, abs=1e-12)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), pair=st.sampled_from(ROUND_PAIRS))
def test_the_smallest_gap_is_the_distance_of_the_bodies(seed: int, pair: tuple[Shape, Shape]) -> None:
    """The distance of the hulls of the cores minus the radii, by a least-squares problem for convex weights."""
    poses = poses_with_gap(*pair, 0.05, seed)
    hulls = []
    for shape, pose in zip(pair, poses, strict=True):
        half = 0.5 * shape.length if isinstance(shape, Capsule) else 0.0
        corners = shape.vertices if isinstance(shape, Box | type(ROOF)) else np.array([[0, 0, -half], [0, 0, half]])
        hulls.append(corners @ rotation_matrices(pose[None, 3:])[0].T + pose[:3])
    first, second = hulls
    heavy, middle = 1e4, poses[0, :3]
    columns = np.vstack(
        [np.column_stack([(first - middle).T, -(second - middle).T]), np.zeros((2, len(first) + len(second)))]
    )
    columns[3, : len(first)] = columns[4, len(first) :] = heavy
    weights, _ = nnls(columns, np.array([0.0, 0.0, 0.0, heavy, heavy]))
    distance = np.linalg.norm(columns[:3] @ weights)
    radii = sum(getattr(shape, "radius", 0.0) for shape in pair)
    assert contacts(*pair, poses).gap.min() == pytest.approx(distance - radii, abs=1e-6)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), pair=st.sampled_from(PAIRS), gap=st.floats(-0.01, 0.02))
def test_a_rigid_motion_of_both_bodies_moves_contacts_and_keeps_features(
    seed: int, pair: tuple[Shape, Shape], gap: float
) -> None:
    poses, rng = poses_with_gap(*pair, gap, seed), np.random.default_rng(seed)
    turn, shift = exponential(rng.normal(size=(1, 3))), rng.normal(size=3)
    rotation = rotation_matrices(turn)[0]
    before, after = contacts(*pair, poses, 0.1), contacts(*pair, motion(poses, turn, shift), 0.1)
    assert after.feature.tolist() == before.feature.tolist()
    np.testing.assert_allclose(after.gap, before.gap, atol=1e-10)
    np.testing.assert_allclose(after.normal, before.normal @ rotation.T, atol=1e-7)
    np.testing.assert_allclose(after.point, before.point @ rotation.T + shift, atol=1e-7)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), pair=st.sampled_from(SYMMETRIC), gap=st.floats(-0.01, 0.02))
def test_exchanging_two_bodies_reverses_their_normals(seed: int, pair: tuple[Shape, Shape], gap: float) -> None:
    poses = poses_with_gap(*pair, gap, seed)
    found, other = contacts(*pair, poses, 0.1), contacts(pair[1], pair[0], poses[::-1].copy(), 0.1)
    one, two = (np.column_stack([c.gap, c.point, s * c.normal]) for c, s in ((found, 1.0), (other, -1.0)))
    for rows in (one, two):
        rows[:] = rows[np.lexsort(np.round(rows, 7).T)]
    np.testing.assert_allclose(one, two, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), pair=st.sampled_from(PAIRS), gap=st.floats(-0.01, 0.02))
def test_gaps_grow_as_the_first_body_moves_along_the_normal(seed: int, pair: tuple[Shape, Shape], gap: float) -> None:
    poses = poses_with_gap(*pair, gap, seed)
    found = contacts(*pair, poses, 0.1)
    nearest = int(np.argmin(found.gap))
    for body, sign in ((0, 1.0), (1, -1.0)):
        for step in (1e-6, -1e-6):
            shifted = poses.copy()
            shifted[body, :3] += step * found.normal[nearest]
            after = contacts(*pair, shifted, 0.1)
            gaps = after.gap[after.feature == found.feature[nearest]]
            assert gaps == pytest.approx([found.gap[nearest] + sign * step], abs=1e-10)
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(np.ones(len(found.gap)))


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), pair=st.sampled_from(PAIRS))
def test_small_motions_keep_features_and_change_gaps_continuously(seed: int, pair: tuple[Shape, Shape]) -> None:
    poses = poses_with_gap(*pair, -1e-3, seed)
    shaken, rng = poses.copy(), np.random.default_rng(seed)
    shaken[0, :3] += 1e-9 * rng.normal(size=3)
    shaken[:1, 3:] = product(shaken[:1, 3:], exponential(1e-9 * rng.normal(size=(1, 3))))
    before, after = contacts(*pair, poses, 0.02), contacts(*pair, shaken, 0.02)
    assert after.feature.tolist() == before.feature.tolist()
    np.testing.assert_allclose(after.gap, before.gap, atol=1e-7)


def test_a_capsule_on_a_face_touches_with_both_ends_and_across_a_beam_with_both_edges() -> None:
    wide = contacts(CAPSULE, Box((3.0, 3.0, 1.0)), at((0.0, 0.0, 0.69), LYING), 0.0)
    assert wide.gap == pytest.approx([-0.01, -0.01])
    assert sorted(wide.point[:, 1]) == pytest.approx([-0.45, 0.45])
    beam = contacts(CAPSULE, Box((3.0, 0.4, 1.0)), at((0.0, 0.0, 0.69), LYING), 0.0)
    assert beam.gap == pytest.approx([-0.01, -0.01])
    assert sorted(beam.point[:, 1]) == pytest.approx([-0.2, 0.2])


def test_parallel_capsules_touch_where_their_common_part_ends() -> None:
    found = contacts(CAPSULE, CAPSULE, at((0.0, 0.39, 0.5)), 0.0)
    assert found.gap == pytest.approx([-0.01, -0.01])
    assert sorted(found.point[:, 2]) == pytest.approx([0.05, 0.45])


def test_capsule_through_a_box_is_pushed_out_along_the_shortest_way() -> None:
    box = Box((3.0, 0.4, 1.0))
    found = contacts(CAPSULE, box, at((0.0, 0.0, 0.4), LYING), 0.0)
    assert found.gap == pytest.approx([-0.3, -0.3])
    assert found.normal == pytest.approx(np.tile([0.0, 0.0, 1.0], (2, 1)))


def test_an_upright_cylinder_stands_on_points_all_round_and_a_lying_one_on_its_ends() -> None:
    standing = contacts(CYLINDER, HalfSpace(), at((0.0, 0.0, 0.399)), 0.0)
    assert len(standing.gap) == 8
    assert standing.gap == pytest.approx(np.full(8, -0.001))
    assert standing.point.mean(axis=0) == pytest.approx([0.0, 0.0, -0.0005], abs=1e-15)
    lying = contacts(CYLINDER, HalfSpace(), at((0.0, 0.0, 0.299), tuple(about((1.0, 0.0, 0.0), 1.5))), 0.1)
    lowest = lying.gap[np.argsort(lying.feature)]
    assert lowest.min() == pytest.approx(0.299 - 0.3 * np.sin(1.5) - 0.4 * np.cos(1.5))


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), pair=st.sampled_from(COAL_PAIRS), gap=st.floats(-0.01, 0.02))
def test_gaps_of_patches_of_coal_are_invariant_under_rigid_motion_and_exchange(
    seed: int, pair: tuple[Shape, Shape], gap: float
) -> None:
    pytest.importorskip("coal")
    poses = poses_with_gap(*pair, gap, seed)
    moved = moved_together(poses, np.random.default_rng(seed))
    expected, bound = contacts(*pair, poses, 0.1).gap.min(), 2e-6 if pair[1] == CYLINDER else 1e-8
    if gap >= 0.0:  # penetrating bodies may separate by a shorter way than back
        assert expected == pytest.approx(gap, abs=bound)
    assert contacts(*pair, moved, 0.1).gap.min() == pytest.approx(expected, abs=bound)
    assert contacts(pair[1], pair[0], poses[::-1].copy(), 0.1).gap.min() == pytest.approx(expected, abs=bound)


@pytest.mark.parametrize("turned", [0.0, np.pi], ids=["one end", "other end"])
@pytest.mark.parametrize("exchanged", [False, True])
def test_a_tilted_cylinder_on_a_box_has_the_height_of_each_point_of_its_rim(turned: float, exchanged: bool) -> None:
    pytest.importorskip("coal")
    box, tilt = Box((3.0, 3.0, 1.0)), 2e-4
    poses = at((0.1, 0.2, 0.9 - 1e-4), tuple(about((1.0, 0.0, 0.0), turned + tilt)))
    found = contacts(box, CYLINDER, poses[::-1].copy(), 0.1) if exchanged else contacts(CYLINDER, box, poses, 0.1)
    assert len(found.gap) == 12
    assert found.gap == pytest.approx(-1e-4 + tilt * (found.point[:, 1] - 0.2), abs=1e-7)
    assert found.normal[:, 2] == pytest.approx(np.full(12, -1.0 if exchanged else 1.0))


def test_without_coal_one_sentence_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "coal", None)
    with pytest.raises(ProblemError, match=r'need coal; run pip install "\.\[bodies\]"'):
        contacts(CYLINDER, BOX, at((0.0, 0.0, 0.8)))
    assert len(contacts(CYLINDER, HalfSpace(), at((0.0, 0.0, 0.4)), 0.1).gap)


def test_each_of_many_capsules_on_one_box_has_its_contacts() -> None:
    shapes = (*[CAPSULE] * 50, BOX)
    poses = np.tile([[0.0, 0.0, 0.6, *LYING]], (51, 1))
    pairs = np.column_stack([np.arange(50), np.full(50, 50)])
    found = find_contacts(shapes, poses, pairs, FAR)
    assert np.bincount(found.first).min() == np.bincount(found.first).max() > 0
