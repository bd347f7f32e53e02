"""Balls of a plugin's scene as plain data, so that recordings can draw them without code of the plugin."""

from typing import Literal

import numpy as np

from ...problems.motion.bodies.balls import BallSystem
from ...problems.motion.bodies.surfaces import Plane, Segment
from ...problems.motion.scenes.scene import Scene
from ..store.fields import Positive, Record
from .scene_arrays import Arrays, plain_copy


class BallsRecord(Record, frozen=True, kw_only=True):
    """The balls of a scene, without the arrays of radii and masses.

    Attributes:
        dimension: 2 or 3.
        has_rotation: whether the balls rotate.
        inertia_factor: moment of inertia of a ball over m r².
        planes: the planes among the surfaces.
        segments: the segments among them; other surfaces are not drawn.
    """

    dimension: Literal[2, 3]
    has_rotation: bool
    inertia_factor: Positive
    planes: list[Plane]
    segments: list[Segment]


def describe_balls(balls: BallSystem) -> BallsRecord:
    """Return the record of ``balls``."""
    return BallsRecord(
        dimension=balls.dimension,  # type: ignore[arg-type]
        has_rotation=balls.friction is not None,
        inertia_factor=balls.inertia_factor,
        planes=[plain_copy(surface, Plane) for surface in balls.surfaces if isinstance(surface, Plane)],
        segments=[plain_copy(surface, Segment) for surface in balls.surfaces if isinstance(surface, Segment)],
    )


def ball_arrays(scene: Scene) -> Arrays:
    """Return radii [m] and masses [kg] of the balls of ``scene``, shape (n,); empty if it has no balls."""
    return {} if scene.balls is None else {"radii": scene.balls.radii, "masses": scene.balls.masses}


def read_balls(record: BallsRecord, arrays: Arrays, n_coordinates: int, n_dofs: int) -> BallSystem:
    """Return the balls of a record, without the forces that act on them.

    Raises:
        KeyError, ValueError, ProblemError: if the balls do not fit a scene with ``n_coordinates`` and ``n_dofs``.
    """
    _check_surfaces(record)
    balls = BallSystem(
        arrays["radii"],
        arrays["masses"],
        [*record.planes, *record.segments],
        record.dimension,
        friction=0.0 if record.has_rotation else None,
        inertia_factor=record.inertia_factor,
    )
    counts = (balls.n_balls * balls.dimension, balls.n_balls * balls.dofs_per_ball)
    is_finite = np.isfinite(balls.radii).all() and np.isfinite(balls.masses).all()
    if counts != (n_coordinates, n_dofs) or len(balls.masses) != balls.n_balls or not is_finite:
        raise ValueError("the balls do not fit the scene")
    return balls


def _check_surfaces(record: BallsRecord) -> None:
    """Raise ``ValueError`` if a surface has no extent, a wrong dimension, or numbers that are not finite."""
    for plane in record.planes:
        has_dimension = len(plane.point) == len(plane.normal) == record.dimension
        if not has_dimension or not any(plane.normal) or not np.isfinite([plane.point, plane.normal]).all():
            raise ValueError("a plane does not fit the scene")
    for wall in record.segments:
        ends = (wall.lower, wall.upper)
        if wall.lower == wall.upper or wall.side not in (-1, 0, 1) or not np.isfinite(ends).all():
            raise ValueError("a wall does not fit the scene")
