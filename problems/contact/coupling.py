"""The coupling of contacts: two contacts are coupled if they touch a common body, directly or through other contacts.

If the factors of G = Wᵀ M⁻¹ W are known, a body is a row of W̃ = Sᵀ W with M⁻¹ = S Sᵀ. Two contacts share a body if
both have an entry in its row. If only G is known, every entry above rounding level couples its two contacts; contacts
of one body in directions that happen to be orthogonal are then not coupled. A friction law is coupled with the law that
bounds it. The connected components of this graph are independent contact problems.
"""

from typing import Any

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from ..compilation.interpretation import interpretable
from .blocks import block_of
from .laws import HALF_LINE, LINE
from .matrices.pieces import Pieces
from .problem import ContactProblem

ROUNDING = 1e-13
"""Entries |g_ij| of G below this fraction of √(g_ii g_jj) count as zero."""

NEGLIGIBLE = 2.0**-40
"""Free velocities below this fraction of the largest one count as zero."""

MIN_SQUARE, MAX_SQUARE = 1e-280, 1e280
"""Between these numbers, a sum of two squares has neither overflowed nor lost small terms."""


def components(problem: ContactProblem) -> IntArray:
    """Return the component of each contact, numbered from 0 in the order of first contacts, shape (n_contacts,)."""
    layout = problem.layout
    if layout.n_blocks <= 1:
        return np.zeros(layout.n_blocks, dtype=np.int64)
    component: IntArray
    directions = None if problem.factors is None else problem.factors.directions
    if problem.factors is None:
        matrix = problem.delassus()
        pattern = (matrix.indptr, matrix.indices, matrix.data, problem.delassus_diagonal)
        component = components_over_matrix(*pattern, layout.contact_of_row, layout.partner)
    elif isinstance(directions, Pieces) and directions.fills_chunks and layout.n_blocks == directions.n_blocks:
        component = _components_over_balls(directions.chunks, directions.n_chunks, layout.partner)
    else:
        pieces = problem.factor_pieces()
        component = components_over_pieces(pieces.starts, pieces.chunks, pieces.values, pieces.n_chunks, layout.partner)
    return component


def largest_around(problem: ContactProblem, values: FloatArray) -> FloatArray:
    """Return, for each contact, the largest value of this contact and of those that share a body or law with it.

    Args:
        problem: the problem.
        values: one number ≥ 0 per contact, shape (n_contacts,).

    Returns:
        The largest values, shape (n_contacts,).
    """
    n_bodies, starts, bodies, contacts = _touched_bodies(problem)
    largest = values.copy()
    if problem.factors is None:
        _write_largest_of_neighbours(starts, bodies, contacts, values, largest)
    else:
        _write_largest_over_bodies(n_bodies, starts, bodies, contacts, values, largest)
    if not problem.layout.bounds_are_own:
        partner = problem.layout.partner
        np.maximum.at(largest, partner, values)
        largest = np.maximum(largest, values[partner])
    return largest


def _touched_bodies(problem: ContactProblem) -> tuple[int, NDArray[Any], NDArray[Any], IntArray]:
    """Return the bodies that contacts touch, in compressed rows.

    With factors, a row is a contact, and a body is a row of W̃. Without factors, a row is a row of G, and each contact
    serves as a body.

    Returns:
        Number of bodies, first entry of each row, body of each entry, contact of each row.
    """
    layout = problem.layout
    if problem.factors is None:
        matrix, diagonal = problem.delassus(), np.sqrt(problem.delassus_diagonal)
        starts, bodies = _coupled_contacts(matrix.indptr, matrix.indices, matrix.data, diagonal, layout.contact_of_row)
        return layout.n_blocks, starts, bodies, layout.contact_of_row
    pieces = problem.factor_pieces()
    starts, bodies = _touched_rows(pieces.starts, pieces.chunks, pieces.values, pieces.n_chunks)
    return pieces.n_chunks * pieces.length, starts, bodies, np.arange(layout.n_blocks)


@interpretable
@njit(cache=True, error_model="numpy")
def _coupled_contacts(indptr, indices, data, root, contact_of_row):  # type: ignore[no-untyped-def]
    """Return, in compressed rows, the contacts of entries of G above rounding level: |g_ij| > ROUNDING √(g_ii g_jj)."""
    starts, bodies = np.zeros(len(indptr), dtype=np.int64), np.empty(len(data), dtype=np.int64)
    count = 0
    for row in range(len(contact_of_row)):
        for p in range(indptr[row], indptr[row + 1]):
            if abs(data[p]) > ROUNDING * root[row] * root[indices[p]]:
                bodies[count] = contact_of_row[indices[p]]
                count += 1
        starts[row + 1] = count
    return starts, bodies[:count]


@interpretable
@njit(cache=True, error_model="numpy")
def _touched_rows(piece_starts, chunks, values, idle):  # type: ignore[no-untyped-def]
    """Return, in compressed rows, the rows of W̃ in which each contact has an entry."""
    width, length = values.shape[1], values.shape[2]
    starts, bodies = np.zeros(len(piece_starts), dtype=np.int64), np.empty(len(chunks) * length, dtype=np.int64)
    count = 0
    for contact in range(len(piece_starts) - 1):
        for p in range(piece_starts[contact], piece_starts[contact + 1]):
            if chunks[p] == idle:
                continue
            for k in range(length):
                for lane in range(width):
                    if values[p, lane, k] != 0.0:
                        bodies[count] = chunks[p] * length + k
                        count += 1
                        break
        starts[contact + 1] = count
    return starts, bodies[:count]


@interpretable
@njit(cache=True, error_model="numpy")
def components_over_matrix(indptr, indices, data, diagonal, contact_of_row, partner):  # type: ignore[no-untyped-def]
    """Return the component of each contact if only G is known."""
    starts, bodies = _coupled_contacts(indptr, indices, data, np.sqrt(diagonal), contact_of_row)
    return _components(partner, len(partner), starts, bodies, contact_of_row)


@interpretable
@njit(cache=True, error_model="numpy")
def components_over_pieces(piece_starts, chunks, values, n_chunks, partner):  # type: ignore[no-untyped-def]
    """Return the component of each contact if the factors are known."""
    starts, bodies = _touched_rows(piece_starts, chunks, values, n_chunks)
    return _components(partner, n_chunks * values.shape[2], starts, bodies, np.arange(len(partner)))


@njit(cache=True, error_model="numpy")
def _root_of(root, contact):  # type: ignore[no-untyped-def]
    """Return the root of the set of a contact, and halve the path to it."""
    parent = root[uint64(contact)]  # unsigned indices need no test for negative ones
    while parent != contact:
        root[uint64(contact)] = contact = root[uint64(parent)]
        parent = root[uint64(contact)]
    return contact


@njit(cache=True)
def _components_over_balls(chunks, n_balls, partner):  # type: ignore[no-untyped-def]
    """Return the component of each contact, if its rows have entries for all velocities of its balls."""
    root, number = np.arange(n_balls), np.full(n_balls, -1)
    for contact in range(len(partner)):
        first = _root_of(root, chunks[2 * contact])
        for ball in (chunks[2 * contact + 1], chunks[2 * partner[contact]]):
            if ball < n_balls and root[uint64(ball)] != first:
                other = _root_of(root, ball)
                root[max(first, other)] = first = min(first, other)
    component, count = np.empty(len(partner), dtype=np.int64), 0
    for contact in range(len(partner)):
        own = uint64(_root_of(root, chunks[2 * contact]))
        if number[own] < 0:
            number[own] = count
            count += 1
        component[contact] = number[own]
    return component


@njit(cache=True, error_model="numpy")
def _unite_partners(root, partner):  # type: ignore[no-untyped-def]
    for contact in range(len(partner)):
        a, b = _root_of(root, contact), _root_of(root, partner[contact])
        root[max(a, b)] = min(a, b)


@njit(cache=True, error_model="numpy")
def _components(partner, n_bodies, starts, bodies, contacts):  # type: ignore[no-untyped-def]
    """Unite each contact with its partner and the previous contact of each body, and number the sets (union–find).

    If contacts serve as bodies, a coupled contact touches its own body through its diagonal entry of G.
    """
    root = np.arange(len(partner))
    _unite_partners(root, partner)
    last = np.full(n_bodies, -1, dtype=np.int64)
    for row in range(len(contacts)):
        contact = contacts[row]
        for p in range(starts[row], starts[row + 1]):
            body = bodies[p]
            before = last[body]
            if before == contact:
                continue
            last[body] = contact
            if before >= 0 and root[before] != root[contact]:
                a, b = _root_of(root, before), _root_of(root, contact)
                root[max(a, b)] = min(a, b)
    component = np.empty(len(root), dtype=np.int64)
    count = 0
    for contact in range(len(root)):
        first = _root_of(root, contact)
        component[contact] = count if first == contact else component[first]
        count += first == contact
    return component


@interpretable
@njit(cache=True)
def _write_largest_of_neighbours(starts, bodies, contacts, values, largest):  # type: ignore[no-untyped-def]
    """Write the largest value among each contact and those coupled with it, if only G is known."""
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            a, b = contacts[row], bodies[p]
            largest[a], largest[b] = max(largest[a], values[b]), max(largest[b], values[a])


@interpretable
@njit(cache=True)
def _write_largest_over_bodies(n_bodies, starts, bodies, contacts, values, largest):  # type: ignore[no-untyped-def]
    """Write the largest value among the contacts of the bodies of each contact, if the factors are known."""
    of_body = np.zeros(n_bodies)
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            of_body[bodies[p]] = max(of_body[bodies[p]], values[contacts[row]])
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            largest[contacts[row]] = max(largest[contacts[row]], of_body[bodies[p]])


def row_lengths(problem: ContactProblem) -> FloatArray:
    """Return ℓ_i of the law of each row, shape (n_rows,): a length [m] for rolling friction, 1 for other laws.

    See ``Residual``.
    """
    laws = problem.laws
    alpha, lengths, speeds = np.empty((3, laws.n_laws))
    numbers = problem.delassus_diagonal, problem.free_velocity
    _write_scales(
        laws.sets, laws.row_count, laws.is_rolling, laws.first_row, laws.partner, *numbers, alpha, lengths, speeds
    )
    return np.repeat(lengths, laws.row_count)


@njit(cache=True, error_model="numpy", inline="always")
def _norm(x, y):  # type: ignore[no-untyped-def]
    """Return √(x² + y²) without overflow or underflow."""
    squared = x * x + y * y
    return np.sqrt(squared) if MIN_SQUARE < squared < MAX_SQUARE else np.hypot(x, y)


@interpretable
@njit(cache=True, error_model="numpy")
def _write_scales(  # type: ignore[no-untyped-def]
    sets, row_count, is_rolling, first_row, partner, diagonal, free_velocity, alpha, lengths, speeds
):
    """Write α_i, ℓ_i and ℓ_i ‖c_i‖ of every law; see ``Residual``.

    Return the index of a law that no impulse can satisfy (−1 if there is none), and max ℓ_i ‖c_i‖ [m/s].
    """
    stuck, largest = -1, 0.0
    has_zero, rolls = False, False
    for law in range(len(sets)):
        row, last = uint64(first_row[law]), uint64(first_row[law] + row_count[law])
        alpha_of_law, speed = diagonal[row], abs(free_velocity[row])
        for k in range(row + uint64(1), last):
            alpha_of_law = max(alpha_of_law, diagonal[k])
            speed = _norm(speed, free_velocity[k])
        if alpha_of_law == 0.0:
            has_zero = True
            if sets[law] == HALF_LINE and free_velocity[row] < 0.0:
                stuck = law
            if sets[law] == LINE and free_velocity[row] != 0.0:
                stuck = law
        alpha[law], speeds[law], lengths[law] = alpha_of_law, speed, 1.0
        largest, rolls = max(largest, speed), rolls or is_rolling[law]
    for law in range(len(sets) if has_zero else 0):
        normal = partner[law]
        if normal >= 0 and diagonal[uint64(first_row[uint64(normal)])] == 0.0:
            alpha[normal] = max(alpha[normal], alpha[law])
    if rolls:
        largest = 0.0
        for law in range(len(sets)):
            if is_rolling[law] and alpha[law] > 0.0 and alpha[partner[law]] > 0.0:
                lengths[law] = np.sqrt(alpha[partner[law]] / alpha[law])
                speeds[law] *= lengths[law]
            largest = max(largest, speeds[law])
    return stuck, largest


@njit(cache=True, error_model="numpy")
def _write_scales_of_contacts(diagonal, free_velocity, component, law_values):  # type: ignore[no-untyped-def]
    """Do the work of ``write_scales_and_ratios`` for spatial contacts if all α > 0; return whether so, and max ‖c‖.

    Each contact then has a unilateral law of one row and a friction law of two rows.
    """
    alpha, lengths, speeds, ratios = law_values[0], law_values[1], law_values[2], law_values[3]
    one, two, three, n_contacts, n_components = uint64(1), uint64(2), uint64(3), uint64(len(component)), uint64(0)
    largest, smallest_alpha, scale = np.zeros(n_contacts), np.inf, 0.0
    for contact in range(n_contacts):
        row, normal = three * contact, two * contact
        friction, own = normal + one, uint64(component[contact])
        alpha[normal], alpha[friction] = diagonal[row], max(diagonal[row + one], diagonal[row + two])
        smallest_alpha = min(smallest_alpha, alpha[normal], alpha[friction])
        speeds[normal] = abs(free_velocity[row])
        speeds[friction] = _norm(free_velocity[row + one], free_velocity[row + two])
        lengths[normal], lengths[friction] = 1.0, 1.0
        speed = max(speeds[normal], speeds[friction])
        if speed > largest[own]:
            largest[own] = speed
        scale, n_components = max(scale, speed), max(n_components, own + one)
    for k in range(n_components):
        largest[k] = scale / largest[k] if largest[k] > NEGLIGIBLE * scale else 1.0
    for contact in range(n_contacts):
        ratio = largest[uint64(component[contact])]
        ratios[two * contact], ratios[two * contact + one] = ratio, ratio
    return smallest_alpha > 0.0, scale


@interpretable
@njit(cache=True, error_model="numpy")
def write_scales_and_ratios(  # type: ignore[no-untyped-def]
    sets, row_count, is_rolling, first_row, partner, diagonal, free_velocity, component, slot, width, law_values
):
    """Write α, ℓ, ℓ ‖c‖ and a ratio for each law into the rows of ``law_values``, shape (at least 4, n_laws).

    The ratio is the largest ℓ ‖c‖ of the problem divided by that of the law's component, or 1 if that of the component
    is negligible. ``component`` holds the component of each contact. The return value is that of ``_write_scales``.
    """
    alpha, lengths, speeds, ratios = law_values[0], law_values[1], law_values[2], law_values[3]
    n_contacts = len(component)
    if 0 < 3 * n_contacts == len(slot) and width == 3 and len(sets) == 2 * n_contacts and not is_rolling[1]:
        is_positive, scale = _write_scales_of_contacts(diagonal, free_velocity, component, law_values)
        if is_positive:
            return -1, scale
    arguments = (sets, row_count, is_rolling, first_row, partner, diagonal, free_velocity)
    stuck, scale = _write_scales(*arguments, alpha, lengths, speeds)
    largest, owns, n_components = np.zeros(len(component)), np.empty(len(sets), dtype=np.int64), uint64(0)
    for law in range(len(sets)):
        own = uint64(component[block_of(slot[uint64(first_row[law])], width)])
        if speeds[law] > largest[own]:
            largest[own] = speeds[law]
        owns[law], n_components = own, max(n_components, own + uint64(1))
    for k in range(n_components):
        largest[k] = scale / largest[k] if largest[k] > NEGLIGIBLE * scale else 1.0
    for law in range(len(sets)):
        ratios[law] = largest[uint64(owns[law])]
    return stuck, scale
