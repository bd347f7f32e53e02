"""The bodies of a problem in a recording: balls as translucent spheres, others as dots joined to their contacts."""

import numpy as np
import rerun as rr

from .contact_points import Bodies

GLASS = (150, 170, 200, 60)
"""Colour of balls, transparent, so that the impulses between them are seen."""

LINES = (150, 170, 200)
"""Colour of other bodies."""


def write_bodies(stream: rr.RecordingStream, root: str, bodies: Bodies, size: float) -> None:
    """Write bodies under the entity ``root``; ``size`` [m] is the length of one."""
    balls = bodies.is_ball
    if balls.any():
        radii = bodies.radii[balls].astype(np.float32)
        shape = rr.Ellipsoids3D(
            centers=bodies.centres[balls].astype(np.float32),
            half_sizes=np.repeat(radii, 3).reshape(-1, 3),
            colors=[GLASS],
            fill_mode=rr.components.FillMode.Solid,
            show_labels=False,
        )
        stream.log(f"{root}/balls", shape, static=True)
    if not balls.all():
        centres = bodies.centres[~balls].astype(np.float32)
        stream.log(f"{root}/centres", rr.Points3D(centres, radii=[0.2 * size], colors=[LINES]), static=True)
        arms = bodies.arms.astype(np.float32)
        stream.log(f"{root}/arms", rr.LineStrips3D(arms, radii=[0.03 * size], colors=[LINES]), static=True)
