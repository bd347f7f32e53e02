"""Surfaces touch those balls whose centres are closer to them than their radius."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.surfaces import Plane, Rim, Segment


@pytest.mark.parametrize(("dim", "side"), [(2, 1), (2, -1), (3, 0)])
def test_a_rim_touches_exactly_the_balls_that_reach_its_nearest_point(dim: int, side: int) -> None:
    rng = np.random.default_rng(0)
    centres, radii = rng.uniform(-1.0, 1.0, size=(300, dim)), rng.uniform(0.1, 0.9, 300)
    along = np.array([0.6, 0.8])
    balls, gaps, normals = Rim((0.5, 0.1), (0.6, 0.8), side).find_contacts(centres, radii)
    outward = np.zeros_like(centres)
    outward[:, 0] = side
    if side == 0:
        outward[:, :2] = centres[:, :2] / np.linalg.norm(centres[:, :2], axis=1)[:, None]
    nearest = 0.5 * outward
    nearest[:, -1] = 0.1
    apart = centres - nearest
    distance = np.linalg.norm(apart, axis=1)
    is_behind = along[0] * (apart * outward).sum(axis=1) + along[1] * apart[:, -1] < 0.0
    touched = np.flatnonzero(is_behind & (distance < radii))
    assert 10 < len(touched) < 200
    assert balls.tolist() == touched.tolist()
    assert gaps == pytest.approx((distance - radii)[touched], abs=1e-14)
    assert normals == pytest.approx((apart / distance[:, None])[touched], abs=1e-13)


@pytest.mark.parametrize(("dim", "side"), [(2, 1), (2, -1), (3, 0)])
@pytest.mark.parametrize("angle", [-2.0, -0.5 * np.pi, -0.3, 0.0, 0.7, 0.5 * np.pi, 2.5])
def test_a_segment_touches_exactly_the_balls_beside_it_that_reach_it(dim: int, side: int, angle: float) -> None:
    """Centres are on both sides of cones, cylinders and discs that point in all directions."""
    rng, along = np.random.default_rng(1), np.array([np.cos(angle), np.sin(angle)])
    lower, length = np.array([0.8, 0.1]), 0.7
    centres, radii = rng.uniform(-1.5, 1.5, size=(400, dim)), rng.uniform(0.1, 0.4, 400)
    surface = Segment(tuple(lower), tuple(lower + length * along), side)
    balls, gaps, _ = surface.find_contacts(centres, radii)
    rho = side * centres[:, 0] if side else np.linalg.norm(centres[:, :2], axis=1)
    apart = np.column_stack([rho, centres[:, -1]]) - lower
    position, distance = apart @ along, apart @ [-along[1], along[0]]
    touched = np.flatnonzero((position >= 0.0) & (position <= length) & (abs(distance) < radii))
    assert 5 < len(touched) < 200
    assert balls.tolist() == touched.tolist()
    assert gaps == pytest.approx((distance - radii)[touched], abs=1e-14)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 0.0), (np.nan, 0.0, 1.0), (np.inf, 0.0, 1.0)])
def test_a_plane_without_a_direction_is_refused(normal: tuple[float, ...]) -> None:
    """Its gaps would not be numbers, so that no ball touched it."""
    with pytest.raises(ProblemError, match="normal of a plane"):
        Plane((0.0, 0.0, 0.0), normal)


def test_a_segment_without_length_is_refused() -> None:
    with pytest.raises(ProblemError, match="two different, finite ends"):
        Segment((1.0, 0.5), (1.0, 0.5))
