"""Meshes lie on the surfaces that they show, and orientations follow angular velocities exactly."""

import numpy as np
from proxbench.bench.recordings.bodies.meshes import (
    ball_mesh,
    identity_orientations,
    planar_orientation,
    surface_meshes,
    turned,
)
from proxbench.problems.motion.scenes.effects import Planar
from proxbench.problems.motion.scenes.funnel import STANDARD_EFFECTS, Funnel
from scipy.spatial.transform import Rotation


def test_a_ball_has_its_radius_and_two_shades() -> None:
    mesh = ball_mesh(0.02, (0, 114, 178))
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.02, rtol=1e-12)
    assert mesh.triangles.max() == len(mesh.vertices) - 1
    assert mesh.colours is not None
    shades, counts = np.unique(mesh.colours, axis=0, return_counts=True)
    assert len(shades) == 2
    assert counts[0] == counts[1]


def test_the_funnel_is_where_balls_touch_it() -> None:
    system = Funnel(10, outlet_radius=0.0).system()
    meshes = surface_meshes(system.surfaces, top=0.3, width=0.2, dimension=3)
    assert len(meshes) == 3  # cone, wall, plate
    for mesh in meshes:
        middles = mesh.vertices[mesh.triangles].mean(axis=1)  # below the round surface by the sag of a facet
        reach = np.full(len(middles), 1e-3)
        assert len(middles) in [len(surface.find_contacts(middles, reach)[0]) for surface in system.surfaces]
        assert mesh.vertices[:, 2].max() <= 0.3


def test_planar_walls_stand_left_and_right() -> None:
    system = Funnel(10, (*STANDARD_EFFECTS, Planar())).system()
    meshes = surface_meshes(system.surfaces, top=0.3, width=0.02, dimension=2)
    assert len(meshes) == 4
    assert sorted(np.sign(mesh.vertices[:, 0].mean()) for mesh in meshes) == [-1, -1, 1, 1]


def test_many_small_rotations_compose_to_one_large_rotation() -> None:
    spins = np.array([[0.0, 0.0, 2.0 * np.pi], [1.0, -2.0, 0.5], [0.0, 0.0, 0.0]])
    orientations = identity_orientations(3)
    for _ in range(100):
        orientations = turned(orientations, spins, 0.01)
    expected = Rotation.from_rotvec(spins)
    found = Rotation.from_quat(orientations)
    np.testing.assert_allclose((found.inv() * expected).magnitude(), 0.0, atol=1e-12)


def test_rotations_compose_about_axes_fixed_in_space() -> None:
    first, second = np.array([[0.3, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.7]])
    found = Rotation.from_quat(turned(turned(identity_orientations(1), first, 1.0), second, 1.0))
    expected = Rotation.from_rotvec(second) * Rotation.from_rotvec(first)
    np.testing.assert_allclose(found.as_matrix(), expected.as_matrix(), atol=1e-14)


def test_planar_angles_turn_from_right_to_up() -> None:
    found = Rotation.from_quat(planar_orientation(np.pi / 2)).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(found, [0.0, 0.0, 1.0], atol=1e-15)
