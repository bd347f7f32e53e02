"""Contacts of polyhedra agree with those of equal boxes, do not depend on the order of bodies, and persist."""

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems.motion.bodies.rigid.orientation import rotation_matrices
from proxbench.problems.motion.bodies.rigid.polyhedron import convex_polyhedron
from proxbench.problems.motion.bodies.rigid.shapes import Box, HalfSpace, Shape
from proxbench.problems.motion.detection.clipping import clip
from proxbench.problems.motion.detection.narrow_phase import ContactSet, find_contacts
from proxbench.problems.motion.detection.polyhedra import find_polyhedra
from proxbench.problems.motion.scenes.rigid.prisms import prism

Vector = NDArray[np.float64]
UPRIGHT = [1.0, 0.0, 0.0, 0.0]
PAIR = np.array([[0, 1]])
WEDGE = prism(np.array([[-0.2, 0.0], [0.2, 0.0], [0.1, 0.3], [-0.1, 0.3]]), 0.4)


def sorted_rows(numbers: Vector) -> Vector:
    """Return contacts in an order that does not depend on features."""
    rounded = np.round(numbers, 9) + 0.0
    return numbers[np.lexsort(rounded.T)]


def together(found: ContactSet) -> Vector:
    return np.column_stack([found.point, found.normal, found.gap])


def random_poses(seed: int) -> Vector:
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(2, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    return np.column_stack([[np.zeros(3), rng.uniform(-0.35, 0.35, 3)], quaternions])


@pytest.mark.parametrize("seed", range(60))
def test_boxes_have_the_same_contacts_as_by_the_code_for_boxes(seed: int) -> None:
    shapes, poses = (Box((0.3, 0.5, 0.2)), Box((0.25, 0.25, 0.4))), random_poses(seed)
    expected = together(find_contacts(shapes, poses, PAIR, 0.01))
    _, numbers = find_polyhedra(shapes, poses[:, :3], rotation_matrices(poses[:, 3:]), PAIR, 0.01)
    assert sorted_rows(numbers) == pytest.approx(sorted_rows(expected), abs=1e-9)


def test_a_box_of_given_corners_is_a_box() -> None:
    box, lower = Box((0.3, 0.5, 0.2)), Box((1.0, 1.0, 0.2))
    shape, pose = convex_polyhedron(box.vertices + np.array([0.1, 0.0, 0.199]))
    poses = np.array([pose, [0.0, 0.0, 0.0, *UPRIGHT]])
    as_box = np.array([[0.1, 0.0, 0.199, *UPRIGHT], poses[1]])
    expected = together(find_contacts((box, lower), as_box, PAIR, 0.01))
    found = together(find_contacts((shape, lower), poses, PAIR, 0.01))
    assert len(found) == 4
    assert sorted_rows(found) == pytest.approx(sorted_rows(expected), abs=1e-12)


def test_a_prism_on_a_plane_touches_with_the_corners_of_its_face() -> None:
    shape, pose = convex_polyhedron(WEDGE - [0.0, 0.0, 0.001])
    poses = np.array([pose, [0.0, 0.0, 0.0, *UPRIGHT]])
    found = find_contacts((shape, HalfSpace()), poses, PAIR, 0.0)
    assert found.gap == pytest.approx(np.full(4, -0.001))
    assert found.normal == pytest.approx(np.tile([0.0, 0.0, 1.0], (4, 1)))
    corners = [[x, y, -0.0005] for x in (-0.2, 0.2) for y in (-0.2, 0.2)]
    assert sorted_rows(found.point) == pytest.approx(sorted_rows(np.array(corners)), abs=1e-12)


def stacked(shift: Vector, turn: float = 0.0) -> tuple[tuple[Shape, ...], Vector]:
    """Return a wedge on the equal face of another one, turned about the vertical and shifted."""
    lower, below = convex_polyhedron(WEDGE * [1.0, 1.0, -1.0])
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    upper, above = convex_polyhedron(WEDGE @ rotation.T + shift)
    return (lower, upper), np.array([below, above])


def test_equal_faces_touch_with_all_their_corners() -> None:
    shapes, poses = stacked(np.array([0.0, 0.0, -1e-5]))
    found = find_contacts(shapes, poses, PAIR, 0.0)
    assert len(found.gap) == 4
    assert found.gap == pytest.approx(np.full(4, -1e-5), rel=1e-6)
    assert np.abs(found.point[:, :2]) == pytest.approx(np.full((4, 2), 0.2), abs=1e-9)


def test_faces_that_are_turned_touch_with_the_corners_of_their_common_part() -> None:
    shapes, poses = stacked(np.array([0.0, 0.0, -1e-5]), 0.25 * np.pi)
    found = find_contacts(shapes, poses, PAIR, 0.0)
    assert len(found.gap) == 8
    assert np.linalg.norm(found.point[:, :2], axis=1) == pytest.approx(np.full(8, 0.2 * np.hypot(1.0, np.sqrt(2) - 1)))


def test_the_order_of_bodies_turns_the_normal_round_and_changes_nothing_else() -> None:
    shapes, poses = stacked(np.array([0.03, 0.02, -1e-4]), 0.3)
    found = find_contacts(shapes, poses, PAIR, 0.0)
    swapped = find_contacts(shapes[::-1], poses[::-1].copy(), PAIR, 0.0)
    assert sorted_rows(swapped.normal) == pytest.approx(sorted_rows(-found.normal), abs=1e-12)
    assert sorted_rows(swapped.point) == pytest.approx(sorted_rows(found.point), abs=1e-9)
    assert np.sort(swapped.gap) == pytest.approx(np.sort(found.gap), abs=1e-12)


def test_features_persist_while_a_body_slides_slightly() -> None:
    features = []
    for shift in np.linspace(0.01, 0.05, 9):
        shapes, poses = stacked(np.array([shift, 0.02, -1e-4]), 0.05)
        features.append(find_contacts(shapes, poses, PAIR, 0.0).feature.tolist())
    assert len(set(features[0])) == len(features[0])
    assert all(found == features[0] for found in features)


def test_crossed_edges_touch_in_one_point() -> None:
    """Two prisms with roofs of 90 degrees touch ridge on ridge at right angles."""
    roof = prism(np.array([[-0.2, 0.0], [0.2, 0.0], [0.0, 0.2]]), 1.0)
    lower, below = convex_polyhedron(roof)
    upper, above = convex_polyhedron((roof * [1.0, 1.0, -1.0])[:, [1, 0, 2]] + [0.1, 0.2, 0.399])
    found = find_contacts((lower, upper), np.array([below, above]), PAIR, 0.0)
    assert found.gap == pytest.approx([-0.001])
    assert found.point == pytest.approx(np.array([[0.0, 0.2, 0.1995]]), abs=1e-12)
    assert found.normal == pytest.approx(np.array([[0.0, 0.0, -1.0]]), abs=1e-12)


@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_only_what_is_closer_than_the_margin_is_reported(margin: float) -> None:
    shapes, poses = stacked(np.array([0.0, 0.0, 0.005]))
    found = find_contacts(shapes, poses, PAIR, margin)
    assert len(found.gap) == (4 if margin else 0)
    assert (found.gap > 0.0).all()


@pytest.mark.parametrize(("near", "far"), [(0.5e-6, 1.5e-6), (0.99e-6, 1.01e-6), (1.5e-6, 0.5e-6), (-0.2, 0.3)])
def test_clipped_corners_lie_on_the_edges_of_the_polygon(near: float, far: float) -> None:
    """If both ends are beyond the plane, it meets the line of the edge outside the edge."""
    polygon = np.zeros((8, 3))
    polygon[:4, :2] = [[near, 0.0], [far, 1.0], [-1.0, 1.0], [-1.0, 0.0]]
    corners, edges = np.empty((8, 3)), np.empty(8, dtype=np.int64)
    n = clip(polygon, np.arange(8), 4, np.array([1.0, 0.0, 0.0]), 0.0, 1e-6, 4, corners, edges)
    assert n == len(set(zip(np.roll(edges[:n], 1).tolist(), edges[:n].tolist(), strict=True))) > 3
    assert corners[:n, 0].max() <= max(1e-6, min(near, far))
    assert corners[:n, 1].min() >= 0.0
    assert corners[:n, 1].max() <= 1.0
