"""The lengths of arrows suit most forces of a recording."""

import numpy as np
from proxbench.bench.recordings.bodies.force_arrows import MAX_RATIO, NO_FORCES, REFERENCE_LENGTH, ForceArrows


def test_arrows_grow_with_the_root_of_a_force_and_an_impact_does_not_cover_everything() -> None:
    arrows = ForceArrows()
    sizes = np.array([1.0] * 8 + [4.0] * 10 + [1e6])
    arrows.add(1, *NO_FORCES)
    arrows.add(2, sizes[:, None] * [0.0, 0.6, 0.8], np.zeros((19, 3)), np.full(19, 0.1), np.zeros(19, np.uint16))
    (first, nothing, *_), (second, vectors, *_) = arrows.arrows()
    assert (first, second) == (1, 2)
    assert len(nothing) == 0
    lengths = np.linalg.norm(vectors, axis=1)
    np.testing.assert_allclose(lengths[8:18], REFERENCE_LENGTH * 0.1)
    np.testing.assert_allclose(lengths[:8], 0.5 * REFERENCE_LENGTH * 0.1)
    assert np.isclose(lengths[-1], REFERENCE_LENGTH * 0.1 * np.sqrt(MAX_RATIO))
    assert "4 N" in arrows.explanation


def test_a_motion_without_forces_needs_no_explanation_of_arrows() -> None:
    arrows = ForceArrows()
    arrows.add(1, *NO_FORCES)
    assert arrows.explanation == ""
    assert [number for number, *_ in arrows.arrows()] == [1]
