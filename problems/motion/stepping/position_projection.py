"""Projection of positions, which removes the penetrations that Moreau's rule leaves.

The rule imposes contact laws on velocities. Bodies that meet within a step penetrate by up to |γ_N| Δt before their
contact becomes active. If they then stay in contact, ξ_N = 0 preserves this penetration. The projection moves the end
of a step to the nearest position, in the metric of M, in which no contact is deeper than d:

    δq = M⁻¹ W_N p,      0 ≤ g + d + W_Nᵀ δq  ⊥  p ≥ 0,      for the contacts with g(q_E) < 0.

Another pass at q_E + δq treats contacts that δq closes, and penetrations that remain because g is curved. Contacts are
detected at q_E instead of the midpoint, where bodies that meet in the second half of the step do not yet touch. The
allowed depth d keeps lasting contacts active.

Gauss–Seidel sweeps solve a pass. For balls, the pushes p and the displacements, which are linear in p, continue their
last change before sweep k + 1,

    p + β_k (p − p_previous),      β_k = k/(k + 4),

as in ``solvers.iteration.momentum``. A push then passes through a column of contacts in far fewer sweeps. A pass ends
when |min(g + d + W_Nᵀ δq, A_ii p)| is small for all contacts, with A = W_Nᵀ M⁻¹ W_N. Then no contact is too deep, and
no ball is pushed farther than necessary. For other bodies, a pass ends when no contact is too deep.

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

MAX_PASSES, MAX_BODY_SWEEPS = 3, 50
"""Largest number of passes at the end of a step, and of sweeps in each, for bodies other than balls; the next step
corrects remaining penetrations. Problems of the library are generated with these limits and without momentum."""

MAX_SWEEPS = 1000
"""Largest number of sweeps in all passes at the end of a step of balls."""

MAX_FAILED_PASSES = 10
"""Number of successive passes after which a projection ends if none of them has reduced the largest penetration."""

ACCURACY = 0.1
"""A projection ends when no contact is deeper than (1 + ``ACCURACY``) times the allowed depth. A pass ends when the
violation of each contact is at most ``ACCURACY`` times the allowed depth."""

DELAY = 4
"""d of the momentum β_k = k/(k + d); see ``docs/decisions/0055-growing-momentum.md``."""

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
    shallowest, n_passes, n_failed, n_sweeps = Projection(position, velocity, np.inf), 0, 0, 0
    while overlaps is not None:
        overlap = -float(overlaps.gap.min())
        n_failed += 1
        if overlap < shallowest.overlap:
            shallowest, n_failed = Projection(position, velocity, overlap), 0
        if _are_balls(overlaps):
            if n_sweeps >= MAX_SWEEPS or n_failed == MAX_FAILED_PASSES:
                return shallowest
            displacement, sweeps = _displacement_of_balls(overlaps, depth, MAX_SWEEPS - n_sweeps)
            n_sweeps += sweeps
        else:
            if n_passes == MAX_PASSES:
                return shallowest
            displacement, n_passes = _displacement_of_bodies(overlaps, depth), n_passes + 1
        position = system.move(position, displacement, 1.0)
        overlaps = system.overlaps(position, tolerated)
    return Projection(position, velocity)


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
    for _ in range(MAX_BODY_SWEEPS):
        deepest = 0.0
        for i in range(len(pushes)):
            if matrix[i, i] <= min_diagonal:
                continue
            gap = space[i] + matrix[i] @ pushes
            deepest = max(deepest, -gap)
            pushes[i] = max(pushes[i] - gap / matrix[i, i], 0.0)
        if deepest <= ACCURACY * depth:
            break


@njit(cache=True, error_model="numpy")
def _continue_change(values, previous, sweeps):  # type: ignore[no-untyped-def]
    """Move values by β_k times their change in the last of k sweeps; ``previous`` then holds their last values."""
    momentum = sweeps / (sweeps + DELAY)
    for k in range(len(values)):
        value = values[k]
        values[k], previous[k] = value + momentum * (value - previous[k]), value


def _are_balls(overlaps: Overlaps) -> bool:
    """Return whether each contact has two opposite normals, and M⁻¹ is diagonal."""
    normals = overlaps.normals
    return isinstance(normals, Pieces) and normals.opposite_normals is not None and overlaps.inverse_mass.is_diagonal


def _displacement_of_balls(overlaps: Overlaps, depth: float, max_sweeps: int) -> tuple[FloatArray, int]:
    """Return δq of balls, shape (n_dofs,), and the number of sweeps."""
    normals = overlaps.normals
    assert isinstance(normals, Pieces)
    assert normals.opposite_normals is not None
    displacement = np.zeros((normals.n_chunks, normals.length))
    inverse = overlaps.inverse_mass.matrix.data.reshape(displacement.shape)
    contacts = normals.chunks, normals.opposite_normals, inverse, overlaps.gap
    sweeps = _move_balls_apart(*contacts, depth, max_sweeps, displacement)
    return displacement.ravel(), sweeps


def _displacement_of_bodies(overlaps: Overlaps, depth: float) -> FloatArray:
    """Return δq = S δ, shape (n_dofs,), with M⁻¹ = S Sᵀ, so that sweeps need only the columns of SᵀW_N."""
    normals = overlaps.normals
    assert isinstance(normals, Pieces)
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
    for _ in range(MAX_BODY_SWEEPS):
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


@njit(cache=True, error_model="numpy")
def _move_balls_apart(chunks, normals, inverse, gap, depth, max_sweeps, displacement):  # type: ignore[no-untyped-def]
    """Sweep as ``_move_bodies_apart`` does, to find δq of balls.

    A push p moves the first ball of a contact by n p/m and the second by −n p/m. A surface counts as a ball of infinite
    mass.
    """
    n_contacts, dim = normals.shape
    n_balls = len(inverse)
    inverse_masses, moves = np.zeros(n_balls + 1), np.zeros((n_balls + 1, 4))  # no row of four crosses a cache line
    inverse_masses[:n_balls] = inverse[:, 0]
    records, diagonal = np.zeros((n_contacts, 4)), np.empty(n_contacts)
    for c in range(n_contacts):
        for axis in range(dim):
            records[c, axis] = normals[c, axis]
        records[c, 3] = gap[c] + depth
        diagonal[c] = inverse_masses[chunks[2 * c]] + inverse_masses[chunks[2 * c + 1]]
    pushes = np.zeros(n_contacts)
    previous_pushes, previous_moves = pushes.copy(), moves.copy()
    for sweep in range(max_sweeps):
        _continue_change(pushes, previous_pushes, sweep)
        _continue_change(moves.reshape(-1), previous_moves.reshape(-1), sweep)
        violation = 0.0
        for c in range(n_contacts):
            i, j, x, y, z = chunks[2 * c], chunks[2 * c + 1], records[c, 0], records[c, 1], records[c, 2]
            space = records[c, 3] + x * (moves[i, 0] - moves[j, 0])
            space += y * (moves[i, 1] - moves[j, 1]) + z * (moves[i, 2] - moves[j, 2])
            if space >= 0.0 and pushes[c] == 0.0:
                continue
            violation = max(violation, abs(min(space, diagonal[c] * pushes[c])))
            push = max(pushes[c] - space / diagonal[c], 0.0)
            change = push - pushes[c]
            pushes[c] = push
            first, second = change * inverse_masses[i], change * inverse_masses[j]
            for axis in range(3):
                moves[i, axis] += first * records[c, axis]
                moves[j, axis] -= second * records[c, axis]
        if violation <= ACCURACY * depth:
            break
    displacement[:, :dim] = moves[:n_balls, :dim]
    return sweep + 1
