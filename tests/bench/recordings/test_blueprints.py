"""Cameras show all moving bodies, from as close as possible."""

import numpy as np
import pytest
from proxbench.bench.recordings.blueprints import FIELD_OF_VIEW, FILLED_SHARE, CameraFit


@pytest.mark.parametrize("aspect", [0.5, 1.0, 2.5])
@pytest.mark.parametrize("direction", [(0.35, -0.86, 0.37), (-1.0, 0.2, 0.1)])
def test_a_camera_shows_all_points_and_fills_the_view_with_them(aspect: float, direction: tuple[float, ...]) -> None:
    points = np.random.default_rng(1).normal(size=(60, 3)) * [3.0, 1.0, 0.5] + [5.0, 6.0, 7.0]
    fit = CameraFit(direction, aspect)
    fit.include(points[:20])
    fit.include(points[20:])
    fit.include(points[:0])
    camera = fit.camera()
    forward = camera.target - camera.position
    forward /= np.linalg.norm(forward)
    np.testing.assert_allclose(forward, -np.array(direction) / np.linalg.norm(direction), atol=1e-12)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    seen = points - camera.position
    slope = np.tan(0.5 * FIELD_OF_VIEW) * (seen @ forward)
    across, along = seen @ right / (aspect * slope), seen @ np.cross(right, forward) / slope
    assert max(np.abs(across).max(), np.abs(along).max()) == pytest.approx(FILLED_SHARE)
    tight = across if np.abs(across).max() > np.abs(along).max() else along
    assert tight.min() == pytest.approx(-tight.max())
