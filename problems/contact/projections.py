"""Euclidean projections onto the sets of force laws.

``project_rows`` projects onto the set of one law with a fixed radius. ``onto_cone`` projects onto the whole cone of a
contact, which also changes the normal impulse.
"""

from collections.abc import Sequence
from itertools import chain, combinations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from ..arrays import FloatArray, real_vector
from ..errors import ProblemError
from .blocks import BlockLayout
from .laws import BALL, HALF_LINE, Laws


def project(laws: Laws, impulses: ArrayLike) -> FloatArray:
    """Project impulses onto the sets of their laws, normal impulses first.

    A negative normal impulse is set to zero. A friction impulse, sliding or rolling, is shortened to its bound
    a + μ Λ_N, with the projected Λ_N. Impulses of joints do not change.

    Args:
        laws: the force laws.
        impulses: Λ [N s], shape (n_rows,).

    Returns:
        The projected Λ [N s], a new array of shape (n_rows,).

    Raises:
        ProblemError: if ``laws`` is not a ``Laws``, or ``impulses`` has the wrong shape or is not made of real numbers.
    """
    first: object = laws
    if not isinstance(first, Laws):
        raise ProblemError(f"project takes Laws, such as problem.laws, not {type(laws).__name__}.")
    projected = real_vector(impulses, "impulses", laws.n_rows).copy()
    bounds = laws.friction_coefficient, laws.fixed_bound, laws.partner
    _project(laws.sets, laws.first_row, laws.row_count, *bounds, projected)
    return projected


@njit(cache=True)
def _project(sets, first_row, row_count, mu, fixed_bound, partner, impulses):  # type: ignore[no-untyped-def]
    for is_friction in (False, True):  # a friction law may precede the law that bounds it
        for law in range(len(sets)):
            if (sets[law] == BALL) == is_friction:
                bound = fixed_bound[law]
                if partner[law] >= 0:
                    bound += mu[law] * impulses[first_row[partner[law]]]
                project_rows(sets[law], first_row[law], row_count[law], bound, impulses)


@njit(cache=True)
def project_rows(form, first, count, bound, vector):  # type: ignore[no-untyped-def]
    """Project ``count`` entries of a vector, from ``first`` on, onto a convex set in place.

    Args:
        form: ``ConvexSet`` of the entries: half-line, line, or ball.
        first: index of the first entry.
        count: number of entries.
        bound: radius of the ball; other sets have none.
        vector: the vector, shape (any,).
    """
    if form == HALF_LINE:
        if vector[first] <= 0.0:  # turns −0 into 0, and keeps NaN
            vector[first] = 0.0
    elif form == BALL:
        length = abs(vector[first])
        for k in range(first + 1, first + count):
            length = np.hypot(length, vector[k])
        if length > bound:
            for k in range(first, first + count):
                vector[k] *= bound / length


def onto_cone(
    normal: FloatArray, parts: Sequence[FloatArray], friction: Sequence[FloatArray], fixed_bound: Sequence[FloatArray]
) -> tuple[FloatArray, list[FloatArray]]:
    """Project (N, T, …) onto {N ≥ 0, ‖T‖ ≤ a + μ N, …}, the intersection of one friction cone per part.

    The parts are sliding friction and, if a contact has it, rolling friction. For a given N, the nearest T is the
    projection onto its disc. So N is the zero of the following function, or 0 if the zero is negative:

        N − N₀ − Σ_parts μ (‖T₀‖ − a − μ N)₊

    The function grows with N and has a kink where a disc just contains its T₀. A cone with a > 0 is truncated.
    Source: Acary & Bourrier 2021, for a = 0.

    Args:
        normal: N₀, shape (n,).
        parts: T₀ of each part, shape (n, any) each.
        friction: μ of each part, shape (n,) each.
        fixed_bound: a of each part, shape (n,) each.

    Returns:
        The projected N and parts.
    """
    lengths = [np.sqrt(np.einsum("ij,ij->i", part, part)) for part in parts]
    cones = list(zip(friction, lengths, fixed_bound, strict=True))
    # the function is the minimum of increasing linear pieces, so its zero is the largest of their zeros
    projected_normal = np.full(len(normal), -np.inf)
    for active in chain.from_iterable(combinations(cones, count) for count in range(1, len(cones) + 1)):
        numerator, denominator = normal, np.ones(1)
        for mu, length, a in active:
            numerator, denominator = numerator + mu * (length - a), denominator + mu**2
        projected_normal = np.maximum(projected_normal, numerator / denominator)
    is_inside = np.all([length <= a + mu * normal for mu, length, a in cones], axis=0)
    projected_normal = np.maximum(np.where(is_inside, normal, projected_normal), 0.0)  # a point inside keeps N₀ exactly
    shortened = []
    for part, length, mu, a in zip(parts, lengths, friction, fixed_bound, strict=True):
        radius = a + mu * projected_normal
        shrink = np.where(length > radius, radius / np.where(length > 0.0, length, 1.0), 1.0)
        shortened.append(part * shrink[:, None])
    return projected_normal, shortened


def onto_contact_cones(
    layout: BlockLayout,
    lanes: FloatArray,
    friction: FloatArray,
    fixed_bounds: tuple[FloatArray, FloatArray],
    length: FloatArray,
) -> FloatArray:
    """Project the impulses of each block onto its cone; impulses of bilateral blocks do not change.

    Args:
        layout: the blocks.
        lanes: impulses, the rolling ones divided by ``length``, padded to shape (n_blocks, width).
        friction: μ of the block's own Λ_N, shape (n_blocks,).
        fixed_bounds: the constant parts of the bounds on Λ_T [N s] and on Λ_R [N m s], each of shape (n_blocks,).
        length: divisor of the rolling impulses [m], shape (n_blocks,).

    Returns:
        The projected impulses, shape (n_blocks, width).
    """
    sliding_bound, rolling_bound = fixed_bounds
    parts, coefficients, bounds = [lanes[:, 1 : 1 + layout.sliding]], [friction], [sliding_bound]
    if layout.rolling:
        parts.append(lanes[:, 1 + layout.sliding :])
        coefficients.append(layout.rolling_coefficient / length)
        bounds.append(rolling_bound / length)
    normal, projected_parts = onto_cone(lanes[:, 0], parts, coefficients, bounds)
    projected = np.column_stack([normal, *projected_parts])
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
        The projected points, shape (n, 2).
    """
    # rotate each point so that the edge of its sector faces the first axis; by symmetry the nearest point lies on it
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
