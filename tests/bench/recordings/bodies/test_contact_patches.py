"""The loaded contacts of two bodies are joined into one line."""

from itertools import pairwise

import numpy as np
from proxbench.bench.recordings.bodies.contact_patches import patches
from proxbench.bench.recordings.contact_states import ContactState

UP = np.array([0.0, 0.0, 1.0])


def drawn(pairs: list[tuple[int, int]], points: np.ndarray, states: list[ContactState]) -> tuple[list, list]:
    shape = patches(np.array(pairs), points, np.tile(UP, (len(points), 1)), np.array(states, dtype=np.uint16))
    strips = shape.strips.as_arrow_array().to_pylist()
    ids = [] if shape.class_ids is None else shape.class_ids.as_arrow_array().to_pylist()
    return strips, ids


def test_four_corners_in_any_order_become_their_square() -> None:
    corners = np.array([[0.0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]])
    ((*around, last),), ids = drawn([(0, 1)] * 4, corners, [ContactState.SLIP] * 4)
    assert last == around[0]
    assert {tuple(point) for point in around} == {tuple(corner) for corner in corners.tolist()}
    assert all(np.abs(np.subtract(one, other)).sum() == 1.0 for one, other in pairwise([*around, last]))
    assert ids == [ContactState.SLIP]


def test_each_pair_has_its_own_patch_and_a_point_alone_has_none() -> None:
    points = np.array([[0.0, 0, 0], [5, 0, 0], [1, 0, 0], [5, 1, 0], [9, 9, 9]])
    stick = [ContactState.STICK, ContactState.SLIP, ContactState.SLIP, ContactState.SLIP, ContactState.STICK]
    strips, ids = drawn([(0, 1), (0, 2), (0, 1), (0, 2), (1, 2)], points, stick)
    assert sorted(sorted({tuple(point) for point in strip}) for strip in strips) == [
        [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)],
        [(5.0, 0.0, 0.0), (5.0, 1.0, 0.0)],
    ]
    assert ids == [ContactState.STICK, ContactState.SLIP]


def test_no_contacts_have_no_patches() -> None:
    shape = patches(np.zeros((0, 2), dtype=int), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.uint16))
    assert shape.strips.as_arrow_array().to_pylist() == []
