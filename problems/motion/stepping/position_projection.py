"""Projection of positions, which removes the penetrations that Moreau's rule leaves.

The rule imposes contact laws on velocities. Bodies that meet within a step penetrate by up to |γ_N| Δt before their
contact becomes active. If they then stay in contact, ξ_N = 0 preserves this penetration. The projection moves the end
of a step to the nearest position, in the metric of M, in which no contact is deeper than d:

    δq = M⁻¹ W_N p,      0 ≤ g + d + W_Nᵀ δq  ⊥  p ≥ 0,      for the contacts with g(q_E) < 0.

Another pass at q_E + δq treats contacts that δq closes, and penetrations that remain because g is curved. Contacts are
detected at q_E instead of the midpoint, where bodies that meet in the second half of the step do not yet touch. The
allowed depth d keeps lasting contacts active.

Joints add equations, r + Wᵀ δq = 0 with p of any sign. Their impulses are eliminated exactly, so that contacts are
moved apart only in directions that the joints permit.

Velocities do not change at contacts, so the projection adds no kinetic energy (Acary, *Projected event-capturing
time-stepping schemes for nonsmooth mechanical systems*, CMAME 256, 2013). At joints, u_E satisfies Wᵀ (u_E + ε u_B) = 0
with W at the midpoint. The part of u_E that opens joints at q_E is of order Δt². It would change its sign from step to
step and grow, and is therefore removed in the metric of M, u ← u − M⁻¹ W A⁺ Wᵀ u with A = Wᵀ M⁻¹ W. The order remains
2, and the energy loss is of order Δt³.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...arrays import FloatArray
from ...contact.matrices.factors import InverseMass
from ...contact.matrices.memory import require_memory
from ...contact.matrices.pieces import Pieces
from ...errors import ProblemError
from ..bodies.system import JointErrors, Overlaps, System

MAX_PASSES = 3
"""Largest number of passes at the end of a step; the next step corrects remaining penetrations."""

MAX_SWEEPS = 50
"""Largest number of sweeps in one pass."""

ACCURACY = 0.1
"""A projection ends when no contact is deeper than (1 + ``ACCURACY``) times the allowed depth."""

MAX_OPENING = 1e-6
"""Largest residual of a joint after the last pass [m or rad]; a larger one shows that passes do not converge, because
the directions at the midpoint differ too much from those at the end of the step."""

REDUNDANCY_TOLERANCE = 1e-12
"""Eigenvalues of the scaled matrix of the joints below this fraction of the largest one belong to redundant rows."""


class Projection(NamedTuple):
    """The end of a step after its projection.

    Attributes:
        position: q, shape (n_coordinates,).
        velocity: u, shape (n_dofs,).
        overlap: the largest penetration at ``position`` [m] if the projection did not reach its tolerance; otherwise 0.
    """

    position: FloatArray
    velocity: FloatArray
    overlap: float = 0.0


def projected(system: System, position: FloatArray, velocity: FloatArray, depth: float) -> Projection:
    """Return the position in which no contact is deeper than ``depth``, and the velocity.

    If no pass reaches this depth, the position is that of the pass with the least penetration.

    Args:
        system: the mechanical system.
        position: q, shape (n_coordinates,).
        velocity: u, shape (n_dofs,).
        depth: d [m], positive.

    Returns:
        The position, the velocity and the remaining overlap. Without joints, the velocity is u, and the position is q
        itself if no contact is too deep there; the largest depth never increases.

    Raises:
        ProblemError: if the residual of a joint exceeds ``MAX_OPENING`` after the last pass.
    """
    tolerated = (1.0 + ACCURACY) * depth
    overlaps = system.overlaps(position, tolerated)
    if overlaps is not None and overlaps.joints is not None:
        return _close_joints(system, position, velocity, overlaps, depth)
    shallowest = Projection(position, velocity, np.inf)
    for n_passes_left in range(MAX_PASSES, -1, -1):
        if overlaps is None:
            return Projection(position, velocity)
        overlap = -float(overlaps.gap.min())
        if overlap < shallowest.overlap:
            shallowest = Projection(position, velocity, overlap)
        if n_passes_left:
            position = system.move(position, _displacement(overlaps, depth), 1.0)
            overlaps = system.overlaps(position, tolerated)
    return shallowest


def _close_joints(
    system: System, position: FloatArray, velocity: FloatArray, overlaps: Overlaps, depth: float
) -> Projection:
    """Return q with closed joints and separated contacts, and u that keeps joints closed; see ``projected``."""
    joints, tolerated = overlaps.joints, (1.0 + ACCURACY) * depth
    for _ in range(MAX_PASSES):
        assert joints is not None
        if joints.are_closed and overlaps.gap.min(initial=0.0) >= -tolerated:
            break
        position = system.move(position, _joint_displacement(overlaps, joints, depth), 1.0)
        remaining = system.overlaps(position, depth)
        assert remaining is not None  # there are joints
        overlaps, joints = remaining, remaining.joints
    assert joints is not None
    opening = np.abs(joints.residual).max(initial=0.0)
    if opening > MAX_OPENING:
        raise ProblemError(
            f"joints stay open by {opening:.3g} m or rad at the end of a step; shorten the step to less than 2/ω of "
            "the fastest oscillation under the forces in the joints."
        )
    responses, inverse = _joint_inverse(overlaps.inverse_mass, joints)
    rates = _transposed_times(*_entries(joints), velocity)
    velocity = velocity - responses @ (inverse @ rates)
    overlap = -float(overlaps.gap.min(initial=0.0))
    return Projection(position, velocity, overlap if overlap > tolerated else 0.0)


def _joint_displacement(overlaps: Overlaps, joints: JointErrors, depth: float) -> FloatArray:
    """Return δq = M⁻¹ (W_N p + W p_J), shape (n_dofs,), which closes joints and moves contacts apart.

    With A = Wᵀ M⁻¹ W of the joints, δq = −M⁻¹ W A⁺ r closes them. Contacts then move by P = M⁻¹ − M⁻¹ W A⁺ Wᵀ M⁻¹,
    which keeps the joints closed.
    """
    responses, inverse = _joint_inverse(overlaps.inverse_mass, joints)
    closing: FloatArray = -responses @ (inverse @ joints.residual)
    if not len(overlaps.gap):
        return closing
    normals = overlaps.normals
    assert not isinstance(normals, Pieces)
    normal_responses = (overlaps.inverse_mass.matrix @ normals).toarray()
    normal_responses -= responses @ (inverse @ (responses.T @ normals))
    pushes = np.zeros(len(overlaps.gap))
    _push_apart(
        np.ascontiguousarray(normals.T @ normal_responses), overlaps.gap + depth + normals.T @ closing, depth, pushes
    )
    displacement: FloatArray = closing + normal_responses @ pushes
    return displacement


def joint_bytes(joints: JointErrors) -> float:
    """Return the memory [bytes] for closing joints: M⁻¹ W, A⁺ and the eigenvectors of A."""
    n_dofs, n_rows = joints.directions.shape
    return 8.0 * n_rows * (n_dofs + 4 * n_rows)


def _joint_inverse(inverse_mass: InverseMass, joints: JointErrors) -> tuple[FloatArray, FloatArray]:
    """Return M⁻¹ W, shape (n_dofs, n_rows), and A⁺, which ignores redundant combinations of rows.

    Raises:
        InsufficientMemoryError: if the available memory does not suffice for these matrices and the eigenvectors of A.
    """
    n_rows = len(joints.residual)
    require_memory(joint_bytes(joints), f"closing joints with {n_rows:,} rows", "simulate fewer joints")
    directions, matrix = joints.directions.toarray(), inverse_mass.matrix
    responses = matrix.data[:, None] * directions if inverse_mass.is_diagonal else matrix @ directions
    gram = _transposed_times(*_entries(joints), responses)
    scale = 1.0 / np.sqrt(gram.diagonal())
    values, vectors = np.linalg.eigh(scale[:, None] * gram * scale)
    is_kept = values > REDUNDANCY_TOLERANCE * values.max(initial=0.0)
    basis = scale[:, None] * vectors[:, is_kept]
    return responses, (basis / values[is_kept]) @ basis.T


def _entries(joints: JointErrors) -> tuple[FloatArray, NDArray[np.int32], NDArray[np.int32]]:
    """Return the entries of W, their dofs, and the start of each column."""
    return joints.directions.data, joints.directions.indices, joints.directions.indptr


@njit(cache=True)
def _transposed_times(data, dofs, starts, vector):  # type: ignore[no-untyped-def]
    """Return Wᵀ x for a vector x, or for each column of a matrix x."""
    product = np.zeros((len(starts) - 1, *vector.shape[1:]))
    for row in range(len(product)):
        for k in range(starts[row], starts[row + 1]):
            product[row] += data[k] * vector[dofs[k]]
    return product


@njit(cache=True)
def _push_apart(matrix, space, depth, pushes):  # type: ignore[no-untyped-def]
    """Solve 0 ≤ space + matrix · pushes ⊥ pushes ≥ 0 by Gauss–Seidel, without contacts that joints hold in place."""
    min_diagonal = REDUNDANCY_TOLERANCE * matrix.max()
    for _ in range(MAX_SWEEPS):
        deepest = 0.0
        for i in range(len(pushes)):
            if matrix[i, i] <= min_diagonal:
                continue
            gap = space[i] + matrix[i] @ pushes
            deepest = max(deepest, -gap)
            pushes[i] = max(pushes[i] - gap / matrix[i, i], 0.0)
        if deepest <= ACCURACY * depth:
            break


def _displacement(overlaps: Overlaps, depth: float) -> FloatArray:
    """Return δq = S δ, shape (n_dofs,), with M⁻¹ = S Sᵀ, so that sweeps need only the columns of SᵀW_N."""
    normals = overlaps.normals
    assert isinstance(normals, Pieces)
    directions = normals.opposite_normals
    if directions is not None and overlaps.inverse_mass.is_diagonal:
        displacement = np.zeros(normals.n_chunks * normals.length)
        inverse = overlaps.inverse_mass.matrix.data
        _move_balls_apart(normals.chunks, directions, inverse, normals.length, overlaps.gap, depth, displacement)
        return displacement
    root = overlaps.inverse_mass.root_blocks(normals.length)
    assert root is not None
    scaled = normals.scaled(root)
    scaled_displacement = np.zeros((scaled.n_chunks + 1) * scaled.length)  # the last chunk is the idle one
    _move_bodies_apart(scaled.starts, scaled.chunks, scaled.values, overlaps.gap, depth, scaled_displacement)
    return overlaps.inverse_mass.root_times(scaled_displacement[: -scaled.length])


@njit(cache=True)
def _move_bodies_apart(starts, chunks, values, gap, depth, displacement):  # type: ignore[no-untyped-def]
    """Find δ by Gauss–Seidel on the normal lanes; contacts without impulse that stay open need one product each."""
    n_contacts, length = len(gap), values.shape[2]
    impulses, diagonal = np.zeros(n_contacts), np.zeros(n_contacts)
    for i in range(n_contacts):
        for p in range(starts[i], starts[i + 1]):
            for k in range(length):
                diagonal[i] += values[p, 0, k] ** 2
    for _ in range(MAX_SWEEPS):
        deepest = 0.0
        for i in range(n_contacts):
            space = gap[i] + depth
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    space += values[p, 0, k] * displacement[length * chunks[p] + k]
            deepest = max(deepest, -space)
            if (space >= 0.0 and impulses[i] == 0.0) or diagonal[i] == 0.0:
                continue
            impulse = max(impulses[i] - space / diagonal[i], 0.0)
            change = impulse - impulses[i]
            impulses[i] = impulse
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    displacement[length * chunks[p] + k] += values[p, 0, k] * change
        if deepest <= ACCURACY * depth:
            break


@njit(cache=True)
def _move_balls_apart(chunks, normals, inverse, length, gap, depth, displacement):  # type: ignore[no-untyped-def]
    """Sweep as ``_move_bodies_apart`` does, to find δq of balls.

    An impulse p moves the first ball by M⁻¹ n p and the second by −M⁻¹ n p.
    """
    n_contacts, dim = normals.shape
    idle = len(inverse) // length
    impulses, diagonal = np.zeros(n_contacts), np.zeros(n_contacts)
    for c in range(n_contacts):
        for side in range(2):
            if chunks[2 * c + side] < idle:
                for axis in range(dim):
                    diagonal[c] += inverse[length * chunks[2 * c + side] + axis] * normals[c, axis] ** 2
    for _ in range(MAX_SWEEPS):
        deepest = 0.0
        for c in range(n_contacts):
            first, second, space = chunks[2 * c] * length, chunks[2 * c + 1] * length, gap[c] + depth
            has_second = chunks[2 * c + 1] < idle
            for axis in range(dim):
                separation = displacement[first + axis]
                if has_second:
                    separation -= displacement[second + axis]
                space += normals[c, axis] * separation
            deepest = max(deepest, -space)
            if space >= 0.0 and impulses[c] == 0.0:
                continue
            impulse = max(impulses[c] - space / diagonal[c], 0.0)
            change = impulse - impulses[c]
            impulses[c] = impulse
            for axis in range(dim):
                displacement[first + axis] += inverse[first + axis] * normals[c, axis] * change
                if has_second:
                    displacement[second + axis] -= inverse[second + axis] * normals[c, axis] * change
        if deepest <= ACCURACY * depth:
            break
