"""Orientations: quaternions agree with scipy's rotations, and free rotation keeps Euler's invariants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from proxbench.problems.motion.bodies.rigid.orientation import (
    about,
    exponential,
    free_spins,
    moved,
    product,
    rotation_matrices,
)
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def scipy_matrices(quaternions: Array) -> Array:
    matrices: Array = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).as_matrix()
    return matrices


@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.0, 1e-9, 1e-5, 1e-4, 2e-4, 1.0, 10.0]))
def test_quaternions_are_the_rotations_of_scipy(seed: int, size: float) -> None:
    vectors = size * np.random.default_rng(seed).normal(size=(5, 3))
    rotations = exponential(vectors)
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=1), 1.0, atol=1e-15)
    expected = Rotation.from_rotvec(vectors).as_matrix()
    np.testing.assert_allclose(rotation_matrices(rotations), expected, atol=1e-14)
    # the length of a quaternion has no meaning
    np.testing.assert_allclose(rotation_matrices(3.0 * rotations), expected, atol=1e-14)


@given(seed=st.integers(0, 2**32 - 1))
def test_a_product_is_the_second_rotation_and_then_the_first(seed: int) -> None:
    first, second = exponential(np.random.default_rng(seed).normal(size=(2, 4, 3)).reshape(8, 3)).reshape(2, 4, 4)
    both = rotation_matrices(product(first, second))
    np.testing.assert_allclose(both, rotation_matrices(first) @ rotation_matrices(second), atol=1e-14)


def test_a_body_turns_about_its_own_axes_and_moves_along_those_of_the_world() -> None:
    quarter = about((0.0, 0.0, 2.0), 0.5 * np.pi)  # its x axis points along y
    pose = np.concatenate([[1.0, 2.0, 3.0], quarter])
    after = moved(pose, np.array([0.1, 0.0, 0.0, 0.5 * np.pi, 0.0, 0.0]), 1.0)
    assert after[:3] == pytest.approx([1.1, 2.0, 3.0])
    turned = rotation_matrices(after[None, 3:])[0]
    assert turned[:, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert turned[:, 1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-15)


@given(seed=st.integers(0, 2**32 - 1), seconds=st.floats(-2.0, 2.0))
def test_moving_forth_and_back_restores_pose_and_unit_quaternions(seed: int, seconds: float) -> None:
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.normal(size=(3, 3)), exponential(rng.normal(size=(3, 3)))]).ravel()
    velocity = rng.normal(size=18)
    there = moved(poses, velocity, seconds)
    np.testing.assert_allclose(np.linalg.norm(there.reshape(3, 7)[:, 3:], axis=1), 1.0, rtol=1e-15)
    np.testing.assert_allclose(moved(there, velocity, -seconds), poses, atol=1e-14)


def test_a_free_rotation_keeps_energy_and_angular_momentum_over_a_hundred_thousand_steps() -> None:
    """The body tumbles, because it starts close to the unstable rotation about its middle axis."""
    inertias, spins = np.array([[1.0, 2.0, 3.0]]), np.array([[0.01, 10.0, 0.01]])
    energy, momentum = (inertias * spins**2).sum(), np.linalg.norm(inertias * spins)
    lowest = highest = spins[0, 1]
    for _ in range(100_000):
        spins = free_spins(spins, inertias, 1e-3)
        lowest, highest = min(lowest, spins[0, 1]), max(highest, spins[0, 1])
    assert lowest < -9.0 < 9.0 < highest
    assert (inertias * spins**2).sum() == pytest.approx(energy, rel=1e-11)
    assert np.linalg.norm(inertias * spins) == pytest.approx(momentum, rel=1e-11)


@given(seed=st.integers(0, 2**32 - 1), seconds=st.floats(1e-4, 0.3))
def test_one_free_step_keeps_energy_and_momentum_and_is_undone_by_a_step_back(seed: int, seconds: float) -> None:
    rng = np.random.default_rng(seed)
    sides = rng.uniform(0.1, 1.0, (4, 3)) ** 2
    inertias = sides.sum(axis=1)[:, None] - sides
    spins = rng.normal(size=(4, 3))
    after = free_spins(spins, inertias, seconds)
    np.testing.assert_allclose((inertias * after**2).sum(axis=1), (inertias * spins**2).sum(axis=1), rtol=1e-13)
    lengths = [np.linalg.norm(inertias * one, axis=1) for one in (after, spins)]
    np.testing.assert_allclose(lengths[0], lengths[1], rtol=1e-13)
    np.testing.assert_allclose(free_spins(after, inertias, -seconds), spins, atol=1e-13)


@given(seed=st.integers(0, 2**32 - 1), seconds=st.floats(1e-4, 0.1))
def test_the_gyroscopic_moment_does_no_work_beside_an_impulse(seed: int, seconds: float) -> None:
    """The energy changes by the work p·ω_m of the impulse alone, and a step back with −p undoes the step."""
    rng = np.random.default_rng(seed)
    sides = rng.uniform(0.1, 1.0, (4, 3)) ** 2
    inertias = sides.sum(axis=1)[:, None] - sides
    spins, impulses = rng.normal(size=(4, 3)), 0.3 * rng.normal(size=(4, 3)) * inertias
    after = free_spins(spins, inertias, seconds, impulses) + impulses / inertias
    gained = 0.5 * (inertias * (after**2 - spins**2)).sum(axis=1)
    np.testing.assert_allclose(gained, (impulses * 0.5 * (spins + after)).sum(axis=1), atol=1e-13)
    before = free_spins(after, inertias, -seconds, -impulses) - impulses / inertias
    np.testing.assert_allclose(before, spins, atol=1e-12)


@pytest.mark.parametrize("length", [5e-324, 1e-200, 1e-8, 1.0, 1e200, 1e308])
def test_the_length_of_an_axis_does_not_change_the_rotation(length: float) -> None:
    expected = [np.cos(0.5), *(np.sin(0.5) * np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0))]
    np.testing.assert_allclose(about((length, 0.0, -length), 1.0), expected, rtol=1e-15)
