"""Which contacts act on each other: those that touch a common body, directly or over others.

Where the factors are known, a body is a row of W̃ = Sᵀ W with M⁻¹ = S Sᵀ, which two contacts share if both have an entry
there. Where G alone is known, every entry beyond rounding couples its two contacts; contacts of one body in directions
that are orthogonal by accident count as apart there. A friction law and the law that
bounds it are coupled like contacts of one body. The connected components of this graph are contact problems of their
own, which only stand in one vector.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from .problem import ContactProblem

ROUNDING = 1e-13
"""Entries of G below this part of the root of both diagonal entries are rounding."""


def components(problem: ContactProblem) -> IntArray:
    """Return the connected component of each contact, numbered from 0 by their first contacts, shape (n_contacts,)."""
    layout = problem.layout
    if layout.n_blocks <= 1:
        return np.zeros(layout.n_blocks, dtype=np.int64)
    found: IntArray
    if problem.factors is None:
        matrix = problem.delassus()
        pattern = (matrix.indptr, matrix.indices, matrix.data, problem.delassus_diagonal)
        found = _components_over_matrix(*pattern, layout.contact_of_row, layout.partner)
    else:
        pieces = problem.factor_pieces()
        found = _components_over_pieces(pieces.starts, pieces.chunks, pieces.values, pieces.n_chunks, layout.partner)
    return found


def largest_around(problem: ContactProblem, values: FloatArray) -> FloatArray:
    """Return for each contact the largest of the values of all that share a body with it, and its own.

    Args:
        problem: the problem.
        values: one number ≥ 0 a contact, shape (n_contacts,).
    """
    n_bodies, starts, bodies, contacts = _touching(problem)
    largest = values.copy()
    if problem.factors is None:
        _largest_of_neighbours(starts, bodies, contacts, values, largest)
    else:
        _largest_over_bodies(n_bodies, starts, bodies, contacts, values, largest)
    if not problem.layout.bounds_are_own:
        partner = problem.layout.partner
        np.maximum.at(largest, partner, values)
        largest = np.maximum(largest, values[partner])
    return largest


def _touching(problem: ContactProblem) -> tuple[int, NDArray[Any], NDArray[Any], IntArray]:
    """Return which bodies each contact touches.

    Returns:
        Number of bodies, first entry of each row, body of each entry, contact of each row.
    """
    layout = problem.layout
    if problem.factors is None:
        matrix, diagonal = problem.delassus(), np.sqrt(problem.delassus_diagonal)
        starts, bodies = _coupled(matrix.indptr, matrix.indices, matrix.data, diagonal, layout.contact_of_row)
        return layout.n_blocks, starts, bodies, layout.contact_of_row
    pieces = problem.factor_pieces()
    starts, bodies = _moved(pieces.starts, pieces.chunks, pieces.values, pieces.n_chunks)
    return pieces.n_chunks * pieces.length, starts, bodies, np.arange(layout.n_blocks)


@njit(cache=True)
def _coupled(indptr, indices, data, root, contact_of_row):  # type: ignore[no-untyped-def]
    """Return, row by row of G, the contacts of entries beyond rounding: |g_ij| > ROUNDING √(g_ii g_jj)."""
    starts, bodies = np.zeros(len(indptr), dtype=np.int64), np.empty(len(data), dtype=np.int64)
    count = 0
    for row in range(len(contact_of_row)):
        for p in range(indptr[row], indptr[row + 1]):
            if abs(data[p]) > ROUNDING * root[row] * root[indices[p]]:
                bodies[count] = contact_of_row[indices[p]]
                count += 1
        starts[row + 1] = count
    return starts, bodies[:count]


@njit(cache=True)
def _moved(first, chunks, values, idle):  # type: ignore[no-untyped-def]
    """Return, contact by contact, the rows of W̃ in which it has an entry."""
    width, length = values.shape[1], values.shape[2]
    starts, bodies = np.zeros(len(first), dtype=np.int64), np.empty(len(chunks) * length, dtype=np.int64)
    count = 0
    for contact in range(len(first) - 1):
        for p in range(first[contact], first[contact + 1]):
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


@njit(cache=True)
def _components_over_matrix(indptr, indices, data, diagonal, contact_of_row, partner):  # type: ignore[no-untyped-def]
    """Return the component of each contact where G alone is known."""
    starts, bodies = _coupled(indptr, indices, data, np.sqrt(diagonal), contact_of_row)
    return _components(partner, len(partner), starts, bodies, contact_of_row)


@njit(cache=True)
def _components_over_pieces(first, chunks, values, n_chunks, partner):  # type: ignore[no-untyped-def]
    """Return the component of each contact where the factors are known."""
    starts, bodies = _moved(first, chunks, values, n_chunks)
    return _components(partner, n_chunks * values.shape[2], starts, bodies, np.arange(len(partner)))


@njit(cache=True)
def _root_of(root, contact):  # type: ignore[no-untyped-def]
    while root[contact] != contact:
        root[contact] = root[root[contact]]
        contact = root[contact]
    return contact


@njit(cache=True)
def _unite_partners(root, partner):  # type: ignore[no-untyped-def]
    for contact in range(len(partner)):
        a, b = _root_of(root, contact), _root_of(root, partner[contact])
        root[max(a, b)] = min(a, b)


@njit(cache=True)
def _components(partner, n_bodies, starts, bodies, contacts):  # type: ignore[no-untyped-def]
    """Unite each contact with its partner and the one that touched the body before it; number the sets (union–find).

    Where bodies are contacts themselves each has touched its own before, because its diagonal block is not zero or it
    is alone.
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


@njit(cache=True)
def _largest_of_neighbours(starts, bodies, contacts, values, largest):  # type: ignore[no-untyped-def]
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            a, b = contacts[row], bodies[p]
            largest[a], largest[b] = max(largest[a], values[b]), max(largest[b], values[a])


@njit(cache=True)
def _largest_over_bodies(n_bodies, starts, bodies, contacts, values, largest):  # type: ignore[no-untyped-def]
    of_body = np.zeros(n_bodies)
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            of_body[bodies[p]] = max(of_body[bodies[p]], values[contacts[row]])
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            largest[contacts[row]] = max(largest[contacts[row]], of_body[bodies[p]])
