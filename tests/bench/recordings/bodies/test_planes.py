"""Half-spaces are drawn as rectangles of their planes, with a grid of round distances on the ground."""

import numpy as np
import pytest
from proxbench.bench.recordings.bodies.planes import Rectangle, faces, grid_spacing, is_ground
from proxbench.problems.motion.bodies.rigid.orientation import about
from proxbench.problems.motion.bodies.rigid.rigid_bodies import FixedBody
from proxbench.problems.motion.bodies.rigid.shapes import HalfSpace

LOW, HIGH = np.array([0.0, -1.0, 0.0]), np.array([4.0, 1.0, 2.0])
GROUND = FixedBody(HalfSpace(), (7.0, 0.0, -0.5))
WALL = FixedBody(HalfSpace(), (0.0, 1.5, 0.0), tuple(about((1.0, 0.0, 0.0), 0.5 * np.pi)))


def test_the_ground_is_a_square_under_the_middle() -> None:
    corners = Rectangle.of(GROUND, LOW, HIGH, 3.0).mesh().vertices
    assert is_ground(GROUND)
    np.testing.assert_allclose(corners.mean(axis=0), [2.0, 0.0, -0.5])
    np.testing.assert_allclose(np.ptp(corners, axis=0), [6.0, 6.0, 0.0])


def test_a_wall_covers_what_is_before_it_and_is_drawn_only_if_seen_from_outside() -> None:
    corners = Rectangle.of(WALL, LOW, HIGH, None).mesh().vertices
    assert not is_ground(WALL)
    np.testing.assert_allclose(corners.min(axis=0), [0.0, 1.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(corners.max(axis=0), [4.0, 1.5, 2.0], atol=1e-12)
    assert faces(WALL, (0.0, -1.0, 0.0))
    assert not faces(WALL, (0.0, 1.0, 0.0))


def test_lines_of_the_grid_are_at_multiples_of_their_distance_from_the_origin() -> None:
    lines = np.array(Rectangle.of(GROUND, LOW, HIGH, 3.0).grid(2.0))
    assert sorted({float(x) for (x, _, _), (end, _, _) in lines if x == end}) == [-1.0, 1.0, 3.0, 5.0]
    np.testing.assert_allclose(lines[..., 2], -0.5)


@pytest.mark.parametrize(("width", "spacing"), [(5.0, 1.0), (9.9, 1.0), (10.0, 2.0), (26.0, 5.0), (0.04, 0.005)])
def test_grid_spacing_is_a_round_number(width: float, spacing: float) -> None:
    assert grid_spacing(width) == pytest.approx(spacing)
