"""Balls of a plugin's scene as plain values: what recordings need to draw them without code of the plugin."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ...problems.motion.bodies.balls import BallSystem
from ...problems.motion.bodies.surfaces import Plane, Segment, Surface
from ...problems.motion.scenes.scene import Scene
from ..store.fields import Number, Positive, Record

Arrays = Mapping[str, NDArray[Any]]


class PlaneRecord(Record, frozen=True, kw_only=True, tag="plane"):
    """A ``Plane`` of a scene."""

    point: Annotated[list[Number], Meta(min_length=2, max_length=3)]
    normal: Annotated[list[Number], Meta(min_length=2, max_length=3)]


class SegmentRecord(Record, frozen=True, kw_only=True, tag="segment"):
    """A ``Segment`` of a scene."""

    lower: tuple[Number, Number]
    upper: tuple[Number, Number]
    side: Literal[-1, 0, 1]


class BallsRecord(Record, frozen=True, kw_only=True):
    """The balls of a scene, whose radii and masses are arrays beside.

    Attributes:
        dimension: 2 or 3.
        has_rotation: whether the balls turn.
        inertia_factor: J/(m r²).
        surfaces: those of a kind that can be drawn.
    """

    dimension: Literal[2, 3]
    has_rotation: bool
    inertia_factor: Positive
    surfaces: list[PlaneRecord | SegmentRecord]


def described_balls(balls: BallSystem) -> dict[str, Any]:
    """Return the fields of ``BallsRecord``."""
    return {
        "dimension": balls.dimension,
        "has_rotation": balls.friction is not None,
        "inertia_factor": balls.inertia_factor,
        "surfaces": [_described_surface(one) for one in balls.surfaces if isinstance(one, Plane | Segment)],
    }


def _described_surface(surface: Plane | Segment) -> dict[str, Any]:
    """Return a surface as a record; one of a class of the plugin is drawn as the surface that it extends."""
    kind = Plane if isinstance(surface, Plane) else Segment
    numbers = {field.name: np.asarray(getattr(surface, field.name)).tolist() for field in fields(kind)}
    return {"type": kind.__name__.lower(), **numbers}


def ball_arrays(scene: Scene) -> dict[str, NDArray[Any]]:
    """Return radii [m] and masses [kg] of the balls of ``scene``, shape (n,); nothing if it has none."""
    return {} if scene.balls is None else {"radii": scene.balls.radii, "masses": scene.balls.masses}


def read_balls(record: BallsRecord, arrays: Arrays, n_coordinates: int, n_dofs: int) -> BallSystem:
    """Return the balls, without the forces that act on them.

    Raises:
        KeyError, ValueError, ProblemError: if these are no balls of a scene with ``n_coordinates`` and ``n_dofs``.
    """
    balls = BallSystem(
        arrays["radii"],
        arrays["masses"],
        [_surface(one, record.dimension) for one in record.surfaces],
        record.dimension,
        friction=0.0 if record.has_rotation else None,
        inertia_factor=record.inertia_factor,
    )
    sizes = (balls.n_balls * balls.dimension, balls.n_balls * balls.dofs_per_ball)
    is_finite = np.isfinite(balls.radii).all() and np.isfinite(balls.masses).all()
    if sizes != (n_coordinates, n_dofs) or len(balls.masses) != balls.n_balls or not is_finite:
        raise ValueError("these are no balls of the scene")
    return balls


def _surface(record: PlaneRecord | SegmentRecord, dimension: int) -> Surface:
    if isinstance(record, SegmentRecord):
        if record.lower == record.upper:
            raise ValueError("this wall has no extent")
        return Segment(record.lower, record.upper, record.side)
    if {len(record.point), len(record.normal)} != {dimension} or not any(record.normal):
        raise ValueError("this is no plane of the scene")
    return Plane(tuple(record.point), tuple(record.normal))
