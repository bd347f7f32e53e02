"""The frame of a contact is a rotation whose first axis is the normal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems.contact.matrices.contact_frame import contact_frames

AXES = np.concatenate([np.eye(3), -np.eye(3)])


@given(st.integers(0, 10_000), st.integers(0, 20))
def test_frames_are_right_handed_and_orthonormal_and_begin_with_the_normal(seed: int, n: int) -> None:
    normals = np.concatenate([np.random.default_rng(seed).normal(size=(n, 3)), AXES])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    frames = contact_frames(normals)
    assert np.array_equal(frames[:, 0], normals)
    assert frames @ frames.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(3), frames.shape), abs=1e-14)
    assert np.linalg.det(frames) == pytest.approx(np.ones(len(frames)), abs=1e-14)


def test_no_contacts_have_no_frames() -> None:
    assert contact_frames(np.zeros((0, 3))).shape == (0, 3, 3)
