"""Euclidean projections onto the sets of contact laws, vectorised over contacts."""

import numpy as np

from ..arrays import FloatArray
from .blocks import BlockLayout
from .laws import Laws


def project(laws: Laws, impulses: FloatArray) -> FloatArray:
    """Return prox_C(Λ) of every law, a fresh array: the step that makes impulses admissible.

    Normal impulses are cut at zero; friction impulses, sliding and rolling, are each shortened to their own bound
    a + μ Λ_N, with Λ_N already cut. Impulses of joints stay.

    Args:
        laws: the force laws.
        impulses: Λ [N s], shape (n_rows,).
    """
    projected = np.array(impulses, dtype=np.float64)
    normal_rows = laws.first_row[laws.is_unilateral]
    projected[normal_rows] = np.maximum(projected[normal_rows], 0.0)
    friction = np.flatnonzero(laws.is_friction)
    first = laws.first_row[friction]
    bound = laws.fixed_bound[friction].copy()
    bounded = laws.partner[friction] >= 0
    partner_row = laws.first_row[laws.partner[friction][bounded]]
    bound[bounded] += laws.friction_coefficient[friction][bounded] * projected[partner_row]
    count = laws.row_count[friction]
    length = np.abs(projected[first])
    for row in (1, 2):
        length[row < count] = np.hypot(length[row < count], projected[first[row < count] + row])
    scale = bound / np.maximum(length, np.maximum(bound, np.finfo(np.float64).tiny))
    for row in (0, 1, 2):
        projected[first[row < count] + row] *= scale[row < count]
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
    length = np.sqrt(np.einsum("ij,ij->i", tangent, tangent))
    outside = length > fixed + friction * normal
    cone_normal = np.where(outside, (normal + friction * (length - fixed)) / (1.0 + friction**2), normal)
    bound = fixed + friction * np.maximum(cone_normal, 0.0)
    safe = np.where(length > 0.0, length, 1.0)
    shrink = np.where(length > bound, bound / safe, 1.0)
    return np.maximum(cone_normal, 0.0), tangent * shrink[:, None]


def onto_rolling_cone(
    normal: FloatArray,
    parts: tuple[FloatArray, FloatArray],
    friction: tuple[FloatArray, FloatArray],
    fixed: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Project (N, T, R) onto {N ≥ 0, ‖T‖ ≤ a + μ N, ‖R‖ ≤ a_r + μ_r N}, the cones of sliding and rolling friction.

    The nearest T and R for a given N are those on its discs, so that N is the zero, or 0 if that is negative, of

        N − N₀ − μ (‖T₀‖ − a − μ N)₊ − μ_r (‖R₀‖ − a_r − μ_r N)₊,

    which grows with N and has a kink where a disc becomes large enough (Acary & Bourrier 2021, with a = a_r = 0).

    Args:
        normal: N₀, shape (n,).
        parts: T₀ and R₀, shape (n, any) each.
        friction: μ and μ_r, shape (n,) each.
        fixed: a and a_r, shape (n,) each.

    Returns:
        The projected N, T and R.
    """
    lengths = [np.sqrt(np.einsum("ij,ij->i", part, part)) for part in parts]
    excess = [length - bound for length, bound in zip(lengths, fixed, strict=True)]
    found = np.full(len(normal), -np.inf)
    for active in ((False, False), (True, False), (False, True), (True, True)):
        numerator, denominator = normal.copy(), np.ones(len(normal))
        for is_active, mu, over in zip(active, friction, excess, strict=True):
            numerator += is_active * mu * over
            denominator += is_active * mu**2
        # the function is the least of its linear pieces, and all of them grow: its zero is the largest of theirs
        found = np.maximum(found, numerator / denominator)
    found = np.maximum(found, 0.0)
    shortened = []
    for part, length, mu, bound in zip(parts, lengths, friction, fixed, strict=True):
        radius = bound + mu * found
        shrink = np.where(length > radius, radius / np.where(length > 0.0, length, 1.0), 1.0)
        shortened.append(part * shrink[:, None])
    return found, shortened[0], shortened[1]


def onto_contact_cones(
    layout: BlockLayout, lanes: FloatArray, friction: FloatArray, fixed: FloatArray, length: FloatArray
) -> FloatArray:
    """Project the impulses of every block onto its cone; those of bilateral blocks stay.

    Args:
        layout: the blocks.
        lanes: impulses, rolling ones over ``length``, padded to shape (n_blocks, width).
        friction: μ of the block's own Λ_N, shape (n_blocks,).
        fixed: the rest of the bound on Λ_T [N s], shape (n_blocks,).
        length: what rolling impulses are divided by [m], shape (n_blocks,).
    """
    normal, tangent, last = lanes[:, 0], lanes[:, 1 : 1 + layout.sliding], lanes[:, 1 + layout.sliding :]
    if layout.rolling:
        coefficients = friction, layout.rolling_coefficient / length
        bounds = fixed, layout.rolling_bound / length
        found = onto_rolling_cone(normal, (tangent, last), coefficients, bounds)
    else:
        found = (*onto_friction_cone(normal, tangent, friction, fixed), last)
    projected = np.column_stack(found)
    if not layout.has_contacts_only:
        projected[layout.is_bilateral] = lanes[layout.is_bilateral]
    return projected


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
