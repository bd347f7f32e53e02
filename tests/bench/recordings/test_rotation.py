"""Orientations follow angular velocities exactly."""

import numpy as np
from proxbench.bench.recordings.rotation import about_depth, turned, upright
from scipy.spatial.transform import Rotation


def test_many_small_turns_are_one_large_one() -> None:
    spins = np.array([[0.0, 0.0, 2.0 * np.pi], [1.0, -2.0, 0.5], [0.0, 0.0, 0.0]])
    orientations = upright(3)
    for _ in range(100):
        orientations = turned(orientations, spins, 0.01)
    expected = Rotation.from_rotvec(spins)
    found = Rotation.from_quat(orientations)
    np.testing.assert_allclose((found.inv() * expected).magnitude(), 0.0, atol=1e-12)


def test_turns_about_different_axes_follow_in_space_not_in_the_body() -> None:
    first, second = np.array([[0.3, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.7]])
    found = Rotation.from_quat(turned(turned(upright(1), first, 1.0), second, 1.0))
    expected = Rotation.from_rotvec(second) * Rotation.from_rotvec(first)
    np.testing.assert_allclose(found.as_matrix(), expected.as_matrix(), atol=1e-14)


def test_planar_angles_turn_from_right_to_up() -> None:
    found = Rotation.from_quat(about_depth(np.pi / 2)).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(found, [0.0, 0.0, 1.0], atol=1e-15)
