"""Rigid bodies at rest with given contact points, as exact references for scenes that detect contacts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from proxbench.problems.contact.laws import Laws
from proxbench.problems.contact.matrices.factors import Factors, InverseMass
from proxbench.problems.contact.matrices.pieces import Pieces
from proxbench.problems.contact.problem import ContactProblem

Vector = NDArray[np.float64]
GRAVITY = np.array([0.0, 0.0, -9.81])
FIXED = -1


@dataclass(frozen=True, eq=False)
class Point:
    """A contact point with the normal from the second body to the first; a body ``FIXED`` cannot move."""

    first: int
    second: int
    point: Vector
    normal: Vector


def bodies_at_rest(
    centres: ArrayLike, masses: ArrayLike, inertias: ArrayLike, points: Sequence[Point], friction: float
) -> ContactProblem:
    """Return the problem of one second from rest under gravity, for moments of inertia in world axes, shape (n, 3)."""
    centre, mass, inertia = (np.asarray(given, dtype=np.float64) for given in (centres, masses, inertias))
    n_bodies = len(mass)
    chunks = np.full(2 * len(points), n_bodies, dtype=np.int64)
    values = np.zeros((2 * len(points), 3, 6))
    for k, one in enumerate(points):
        for side, (body, sign) in enumerate([(one.first, 1.0), (one.second, -1.0)]):
            if body == FIXED:
                continue
            chunks[2 * k + side] = body
            for lane, axis in enumerate(frame(one.normal)):
                values[2 * k + side, lane] = sign * np.append(axis, np.cross(one.point - centre[body], axis))
    directions = Pieces(2 * np.arange(len(points) + 1), chunks, values, n_bodies)
    inverse = InverseMass.create(1.0 / np.column_stack([np.tile(mass[:, None], 3), inertia]).ravel())
    motion = np.tile(np.append(GRAVITY, np.zeros(3)), n_bodies)
    laws = Laws.contacts(friction, 3, len(points))
    factors = Factors(directions, inverse, motion)
    return ContactProblem(directions.transposed_times(motion), laws, factors=factors)


def frame(normal: Vector) -> Vector:
    """Return the rows N, T1, T2 of a normal in the plane y = 0; T2 is the y axis."""
    across = np.array([0.0, 1.0, 0.0])
    return np.array([normal, np.cross(across, normal), across])
