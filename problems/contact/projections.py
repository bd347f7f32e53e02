"""Euclidean projections onto the sets of contact laws, vectorised over contacts."""

import numpy as np

from ..arrays import FloatArray
from .laws import LawKind, Laws


def project(laws: Laws, impulses: FloatArray) -> FloatArray:
    """Return prox_C(Λ) of every law, a fresh array: the step that makes impulses admissible.

    Normal impulses are cut at zero; friction impulses are shortened to their bound a + μ Λ_N, with Λ_N already cut.

    Args:
        laws: the force laws.
        impulses: Λ [N s], shape (n_rows,).
    """
    projected = np.array(impulses, dtype=np.float64)
    normal_rows = laws.first_row[~laws.is_friction]
    projected[normal_rows] = np.maximum(projected[normal_rows], 0.0)
    friction = np.flatnonzero(laws.is_friction)
    first = laws.first_row[friction]
    bound = laws.fixed_bound[friction].copy()
    bounded = laws.partner[friction] >= 0
    partner_row = laws.first_row[laws.partner[friction][bounded]]
    bound[bounded] += laws.friction_coefficient[friction][bounded] * projected[partner_row]
    spatial = laws.kind[friction] == LawKind.SPATIAL_FRICTION
    length = np.abs(projected[first])
    length[spatial] = np.hypot(length[spatial], projected[first[spatial] + 1])
    scale = bound / np.maximum(length, np.maximum(bound, np.finfo(np.float64).tiny))
    projected[first] *= scale
    projected[first[spatial] + 1] *= scale[spatial]
    return projected


def onto_friction_cone(
    normal: FloatArray, tangent: FloatArray, friction: FloatArray, fixed: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Project (N, T) onto {N ≥ 0, ‖T‖ ≤ a + μ N}, the second-order cone with its apex cut off where a > 0.

    Args:
        normal: N, shape (n,).
        tangent: T, shape (n, 1) or (n, 2).
        friction: μ, shape (n,).
        fixed: a, shape (n,).

    Returns:
        The projected N and T. Where the projection onto the whole shifted cone would have N < 0, the half-space
        N ≥ 0 is active and the nearest point is the one with N = 0 and T in the disc of radius a.
    """
    length = np.sqrt(np.sum(tangent**2, axis=1))
    outside = length > fixed + friction * normal
    cone_normal = np.where(outside, (normal + friction * (length - fixed)) / (1.0 + friction**2), normal)
    bound = fixed + friction * np.maximum(cone_normal, 0.0)
    safe = np.where(length > 0.0, length, 1.0)
    shrink = np.where(length > bound, bound / safe, 1.0)
    return np.maximum(cone_normal, 0.0), tangent * shrink[:, None]


def onto_polygon(point: FloatArray, radius: FloatArray, sides: int) -> FloatArray:
    """Project points onto regular polygons of ``sides`` sides, inscribed in circles, with a corner on the T1 axis.

    Args:
        point: shape (n, 2).
        radius: circumradius, shape (n,).
        sides: number of sides, at least 3.

    Returns:
        The projected points, shape (n, 2). Each point is turned so that its nearest edge faces the first axis; symmetry
        keeps the nearest point of the polygon in that sector.
    """
    sector = 2.0 * np.pi / sides
    angle = np.arctan2(point[:, 1], point[:, 0])
    facing = (np.floor(angle / sector) + 0.5) * sector
    cos, sin = np.cos(facing), np.sin(facing)
    across = cos * point[:, 0] + sin * point[:, 1]
    along = -sin * point[:, 0] + cos * point[:, 1]
    apothem, half_edge = radius * np.cos(sector / 2), radius * np.sin(sector / 2)
    inside = across <= apothem
    across_new = np.where(inside, across, apothem)
    along_new = np.where(inside, along, np.clip(along, -half_edge, half_edge))
    return np.column_stack([cos * across_new - sin * along_new, sin * across_new + cos * along_new])
