"""Contacts of boxes: corners of touching faces, one point of crossed edges, and persistent keys."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.orientation import about, exponential, product
from proxbench.problems.motion.bodies.rigid.shapes import Box, HalfSpace
from proxbench.problems.motion.detection.narrow_phase import ContactSet, find_contacts

Array = NDArray[np.float64]

PAIR = np.array([[0, 1]])


def contacts(first: Array, second: Array, margin: float = 0.0, sizes: tuple[float, float] = (1.0, 1.0)) -> ContactSet:
    shapes = [Box((one, one, one)) for one in sizes]
    return find_contacts(shapes, np.array([first, second]), PAIR, margin)


def pose(*centre: float, turned: Array | None = None) -> Array:
    return np.concatenate([centre, [1.0, 0.0, 0.0, 0.0] if turned is None else turned])


def test_equal_boxes_one_upon_the_other_touch_at_four_corners() -> None:
    found = contacts(pose(0.0, 0.0, 0.0), pose(0.0, 0.0, 0.99))
    assert len(found.gap) == 4
    np.testing.assert_allclose(found.gap, -0.01)
    np.testing.assert_allclose(found.normal, [[0.0, 0.0, -1.0]] * 4, atol=1e-15)
    np.testing.assert_allclose(found.point[:, 2], 0.495)
    assert sorted(map(tuple, np.sign(found.point[:, :2]).tolist())) == [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    assert len(set(found.feature.tolist())) == 4


def test_a_turned_box_is_clipped_by_the_face_below_it() -> None:
    found = contacts(pose(0.0, 0.0, 0.0), pose(0.0, 0.0, 0.99, turned=about((0.0, 0.0, 1.0), np.pi / 4)))
    assert len(found.gap) == 8
    assert np.abs(found.point[:, :2]).max() == pytest.approx(0.5)


def test_crossed_edges_touch_at_one_point() -> None:
    upper = product(about((0.0, 0.0, 1.0), np.pi / 2)[None], about((1.0, 0.0, 0.0), np.pi / 4)[None])[0]
    height = np.sqrt(2.0) - 0.01
    found = contacts(
        pose(0.0, 0.0, 0.0, turned=about((1.0, 0.0, 0.0), np.pi / 4)), pose(0.1, 0.2, height, turned=upper)
    )
    assert found.gap == pytest.approx([-0.01])
    np.testing.assert_allclose(found.normal, [[0.0, 0.0, -1.0]], atol=1e-12)
    np.testing.assert_allclose(found.point, [[0.1, 0.0, 0.5 * height]], atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1))
def test_boxes_moved_apart_by_their_depth_no_longer_overlap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = (pose(*rng.normal(size=3) * 0.3, turned=exponential(rng.normal(size=(1, 3)))[0]) for _ in range(2))
    sizes = tuple(rng.uniform(0.5, 1.5, 2))
    found = contacts(first, second, 0.0, sizes)
    if not len(found.gap):
        return
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-12)
    assert (found.normal @ (first[:3] - second[:3]) >= 0.0).all()
    apart = first + np.concatenate([(1e-9 - found.gap.min()) * found.normal[0], np.zeros(4)])
    assert not len(contacts(apart, second, 0.0, sizes).gap)


def test_contacts_of_other_pairs_of_faces_have_other_features() -> None:
    """Each face of the lower box touches each of the upper box, turned by 45° so that every edge is clipped."""
    x, y, half_turn = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), np.pi / 2
    faces = [about(x, k * half_turn) for k in range(4)] + [about(y, half_turn), about(y, -half_turn)]
    seen = set[int]()
    for lower in faces:
        for upper in faces:
            turned = product(about((0.0, 0.0, 1.0), np.pi / 4)[None], upper[None])[0]
            found = contacts(pose(0.0, 0.0, 0.0, turned=lower), pose(0.0, 0.0, 0.99, turned=turned))
            features = set(found.feature.tolist())
            assert len(features) == 8
            assert not features & seen
            seen |= features


def test_features_persist_under_tiny_motions_of_a_box() -> None:
    features = set()
    rng = np.random.default_rng(0)
    for _ in range(100):
        shaken = pose(*(1e-8 * rng.normal(size=2)), 0.999, turned=exponential(1e-8 * rng.normal(size=(1, 3)))[0])
        features.add(tuple(contacts(pose(0.0, 0.0, 0.0), shaken).feature.tolist()))
    assert len(features) == 1


def test_a_half_space_that_moves_is_refused() -> None:
    with pytest.raises(ProblemError, match="fixed bodies"):
        find_contacts([HalfSpace(), Box((1.0, 1.0, 1.0))], np.array([pose(0.0, 0.0, 0.0)] * 2), PAIR, 0.0)
