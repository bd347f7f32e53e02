"""Convex polyhedra have correct mass properties and faces, and refuse degenerate points."""

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.orientation import rotation_matrices
from proxbench.problems.motion.bodies.rigid.polyhedron import Polyhedron, convex_polyhedron
from proxbench.problems.motion.bodies.rigid.shapes import Box

TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def turned(seed: int) -> NDArray[np.float64]:
    quaternion = np.random.default_rng(seed).normal(size=(1, 4))
    return rotation_matrices(quaternion / np.linalg.norm(quaternion))[0]


@pytest.mark.parametrize("seed", range(5))
def test_a_box_given_by_its_corners_has_the_mass_properties_of_a_box(seed: int) -> None:
    box, rotation, centre = Box((0.3, 0.5, 0.2)), turned(seed), np.array([1.0, 2.0, 3.0])
    shape, pose = convex_polyhedron(centre + box.vertices @ rotation.T)
    assert shape.volume == pytest.approx(box.volume, rel=1e-12)
    assert np.sort(shape.inertia) == pytest.approx(np.sort(box.inertia), rel=1e-12)
    assert pose[:3] == pytest.approx(centre, rel=1e-12)
    assert shape.bounding_radius == pytest.approx(box.bounding_radius, rel=1e-12)
    assert shape.thickness == pytest.approx(box.thickness, rel=1e-12)
    assert sorted(map(len, shape.faces)) == [4] * 6


@pytest.mark.parametrize("seed", range(5))
def test_the_pose_returns_the_given_corners_and_the_inertia_of_its_axes_is_diagonal(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(8, 3))
    points = points / np.linalg.norm(points, axis=1)[:, None] + [5.0, 0.0, 1.0]
    shape, pose = convex_polyhedron(points)
    placed = pose[:3] + shape.vertices @ rotation_matrices(pose[None, 3:])[0].T
    assert placed == pytest.approx(points, abs=1e-12)
    again, moved = convex_polyhedron(shape.vertices)
    assert moved[:3] == pytest.approx(np.zeros(3), abs=1e-12)
    assert again.inertia == pytest.approx(shape.inertia, rel=1e-9)


def test_a_tetrahedron_has_its_known_volume_centre_and_inertia() -> None:
    shape, pose = convex_polyhedron(TETRAHEDRON)
    assert shape.volume == pytest.approx(1.0 / 6.0, rel=1e-14)
    assert pose[:3] == pytest.approx([0.25, 0.25, 0.25], rel=1e-14)
    # ∫x² = 1/60 and ∫xy = 1/120 about the corner; minus V/16 about the centre of mass
    square, mixed = 1.0 / 60.0 - 1.0 / 96.0, 1.0 / 120.0 - 1.0 / 96.0
    tensor = np.full((3, 3), -mixed) + np.diag(np.full(3, 2.0 * square + mixed))
    assert shape.inertia == pytest.approx(np.linalg.eigvalsh(tensor), rel=1e-12)


def normals_point_outwards(shape: Polyhedron) -> bool:
    corners = shape.vertices
    for face in shape.faces:
        a, b, c = corners[list(face[:3])]
        if not (np.cross(b - a, c - b) @ a > 0.0 and (np.cross(b - a, c - b) @ (corners - a).T <= 1e-12).all()):
            return False
    return True


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_faces_go_round_counter_clockwise_at_any_size(scale: float) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    drum = np.concatenate([np.column_stack([ring, np.full(8, z)]) for z in (-0.5, 0.5)])
    shape, _ = convex_polyhedron(scale * drum @ turned(0).T)
    assert sorted(map(len, shape.faces)) == [4] * 8 + [8] * 2
    assert normals_point_outwards(Polyhedron(shape.vertices / scale, shape.faces, 1.0, np.ones(3)))


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (TETRAHEDRON[:3], "at least 4 points"),
        ([[0.0, 0.0, 0.0], [1.0, 0.0]], "rows of unequal lengths"),
        ([*TETRAHEDRON[:3].tolist(), [0.0, np.nan, 1.0]], r"point 3 of a polyhedron is not finite: \(0.0, nan, 1.0\)"),
        (TETRAHEDRON * [1.0, 1.0, 1e-4], "a polyhedron is too thin: a face is .* from its centre of mass"),
        ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]], "lie in one plane"),
        ([*TETRAHEDRON.tolist(), [0.1, 0.1, 0.1]], "point 4 of a polyhedron is not a corner"),
    ],
)
def test_points_without_a_valid_convex_hull_are_refused(points: object, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        convex_polyhedron(points)


def cube_with(**changes: object) -> dict[str, object]:
    shape, _ = convex_polyhedron(Box((1.0, 1.0, 1.0)).vertices)
    return {name: getattr(shape, name) for name in ("vertices", "faces", "volume", "inertia")} | changes


def dented() -> NDArray[np.float64]:
    vertices = np.array(cube_with()["vertices"])
    vertices[0] *= 0.1
    return vertices


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"faces": tuple(face[::-1] for face in cube_with()["faces"])}, "face 0 of a polyhedron is flat or inside out"),
        (
            {"vertices": np.multiply(cube_with()["vertices"], [1.0, 1.0, 0.0])},
            "flat or inside out: its corners",
        ),
        ({"vertices": np.add(cube_with()["vertices"], [3.0, 0.0, 0.0])}, "around the centre of mass"),
        ({"vertices": dented()}, "not convex at its face .; divide the body"),
        ({"faces": cube_with()["faces"][1:]}, "the edge from vertex . to vertex . of a polyhedron must belong to two"),
        ({"faces": (*cube_with()["faces"], cube_with()["faces"][0])}, "must belong to two faces; build the polyhedron"),
        ({"inertia": np.array([1.0, 0.0, 1.0])}, "volume and inertia of a polyhedron must be positive"),
        ({"volume": -1.0}, "build the polyhedron from its corners with convex_polyhedron"),
    ],
)
def test_a_polyhedron_of_other_faces_is_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        Polyhedron(**cube_with(**changes))  # type: ignore[arg-type]


def test_too_many_faces_are_refused() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 41)[:-1]
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    drum = np.concatenate([np.column_stack([ring, np.full(40, z)]) for z in (-0.5, 0.5)])
    with pytest.raises(ProblemError, match="at most 64 faces of at most 32 corners"):
        convex_polyhedron(drum)
