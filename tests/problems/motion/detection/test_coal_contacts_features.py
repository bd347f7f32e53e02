"""Contact points of a cylinder and the body below it keep their numbers while both move together."""

import numpy as np
import pytest
from proxbench.problems.motion.bodies.rigid.orientation import exponential, rotation_matrices
from proxbench.problems.motion.detection.coal_contacts import RANKING_OFFSET, _features


@pytest.mark.parametrize("is_end", [True, False], ids=["end", "side"])
def test_features_number_the_points_of_a_patch_by_their_angle_at_any_pose(is_end: bool) -> None:
    """The angle is about the normal, from the first axis of the cylinder at its end, from its own axis at its side."""
    rng = np.random.default_rng(0)
    for n_points in (1, 2, 5, 6):
        angles = rng.uniform(0.1, 0.9) - RANKING_OFFSET + np.arange(n_points) * 2.0 * np.pi / n_points
        x, y, z = np.eye(3) if is_end else np.eye(3)[[2, 0, 1]]
        order = rng.permutation(n_points)
        pose = rotation_matrices(exponential(rng.normal(size=(1, 3))))[0]
        points = (0.3 * np.outer(np.cos(angles), x) + 0.3 * np.outer(np.sin(angles), y) + rng.normal(size=3)) @ pose.T
        assert _features([(points[k], pose @ z, 0.0) for k in order], pose) == order.tolist()
