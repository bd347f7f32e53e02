"""Names of contacts persist from step to step."""

import numpy as np
from proxbench.problems.capture.contact_keys import distinct_keys, pair_of

CORNERS = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0]])


def anchors(order: list[int], slide: float = 0.0) -> np.ndarray:
    """Return the corners of a box on a floor: fixed on the box, moved on the floor."""
    corners = CORNERS[order]
    return np.stack([corners + np.array([slide, 0.0, 0.0]), corners], axis=1)


def test_contacts_of_a_pair_are_numbered() -> None:
    assert distinct_keys(["a | b", "a | b", "limit"], np.zeros((3, 2, 3))) == ("a | b", "a | b #1", "limit")


def test_corner_keys_persist_when_contacts_are_reordered_and_the_box_slides() -> None:
    pair = ["floor | box"]
    first = distinct_keys(4 * pair, anchors([0, 1, 2, 3]))
    again = distinct_keys(4 * pair, anchors([3, 0, 2, 1], 2.0), first, anchors([0, 1, 2, 3]))
    assert again == tuple(first[corner] for corner in [3, 0, 2, 1])


def test_the_key_of_a_vanished_contact_is_reused_only_for_a_new_contact() -> None:
    pair = ["floor | box"]
    first = distinct_keys(4 * pair, anchors([0, 1, 2, 3]))
    two = distinct_keys(2 * pair, anchors([2, 3]), first, anchors([0, 1, 2, 3]))
    assert two == ("floor | box #2", "floor | box #3")
    three = distinct_keys(3 * pair, anchors([0, 2, 3]), two, anchors([2, 3]))
    assert three == ("floor | box", "floor | box #2", "floor | box #3")


def test_a_key_without_its_number_is_its_pair() -> None:
    assert [pair_of(key) for key in ("a | b", "a | b #12")] == ["a | b", "a | b"]
