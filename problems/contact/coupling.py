"""Which contacts act on each other: those that touch a common body, directly or over others.

Where the factors are known, a body is a chunk of coordinates, or a row of W̃ = Sᵀ W with M⁻¹ = S Sᵀ. Where G alone is
known, every non-zero entry between two contacts stands for a body that both touch. A friction law and the law that
bounds it are coupled like contacts of one body. The connected components of this graph are contact problems of their
own, which only stand in one vector.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray
from .pieces import Pieces
from .problem import ContactProblem


def components(problem: ContactProblem) -> IntArray:
    """Return the connected component of each contact, numbered from 0 by their first contacts, shape (n_contacts,)."""
    layout = problem.layout
    if layout.n_blocks <= 1:
        return np.zeros(layout.n_blocks, dtype=np.int64)
    n_bodies, starts, bodies, numbers, contacts = _touching(problem)
    root = np.arange(layout.n_blocks)
    if not layout.bounds_are_own:
        _unite_partners(root, layout.partner)
    found: IntArray = _components(root, n_bodies, starts, bodies, numbers, contacts)
    return found


def largest_around(problem: ContactProblem, values: FloatArray) -> FloatArray:
    """Return for each contact the largest of the values of all that share a body with it, and its own.

    Args:
        problem: the problem.
        values: one number ≥ 0 a contact, shape (n_contacts,).
    """
    n_bodies, starts, bodies, numbers, contacts = _touching(problem)
    largest = values.copy()
    if problem.factors is None:
        _largest_of_neighbours(starts, bodies, numbers, contacts, values, largest)
    else:
        _largest_over_bodies(n_bodies, starts, bodies, numbers, contacts, values, largest)
    if not problem.layout.bounds_are_own:
        partner = problem.layout.partner
        np.maximum.at(largest, partner, values)
        largest = np.maximum(largest, values[partner])
    return largest


def _touching(problem: ContactProblem) -> tuple[int, NDArray[Any], NDArray[Any], NDArray[Any], IntArray]:
    """Return a sparse matrix whose row i belongs to contact contacts[i], and whose columns are the bodies it touches.

    Returns:
        Number of bodies, first entry of each row, column and value of each entry, contact of each row.
    """
    layout = problem.layout
    if problem.factors is None:
        matrix = problem.delassus()
        return layout.n_blocks, matrix.indptr, layout.contact_of_row[matrix.indices], matrix.data, layout.contact_of_row
    given, inverse = problem.factors.directions, problem.factors.inverse_mass
    if isinstance(given, Pieces) and layout.is_dense and inverse.root_blocks(given.length) is not None:
        is_body = (given.chunks < given.n_chunks).astype(np.float64)
        return given.n_chunks + 1, given.starts, given.chunks, is_body, np.arange(layout.n_blocks)
    columns = problem.factors.force_directions if inverse.is_diagonal else problem.factors.scaled_directions
    return problem.factors.n_dofs, columns.indptr, columns.indices, columns.data, layout.contact_of_row


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
def _components(root, n_bodies, starts, bodies, numbers, contacts):  # type: ignore[no-untyped-def]
    """Unite each contact with the one that touched the body before it, and number the sets (union–find).

    Where bodies are contacts themselves each has touched its own before, because its diagonal block is not zero or it
    is alone.
    """
    last = np.full(n_bodies, -1, dtype=np.int64)
    for row in range(len(contacts)):
        contact = contacts[row]
        for p in range(starts[row], starts[row + 1]):
            body = bodies[p]
            before = last[body]
            if before == contact or numbers[p] == 0.0:
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
def _largest_of_neighbours(starts, bodies, numbers, contacts, values, largest):  # type: ignore[no-untyped-def]
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            if numbers[p] != 0.0:
                a, b = contacts[row], bodies[p]
                largest[a], largest[b] = max(largest[a], values[b]), max(largest[b], values[a])


@njit(cache=True)
def _largest_over_bodies(n_bodies, starts, bodies, numbers, contacts, values, largest):  # type: ignore[no-untyped-def]
    of_body = np.zeros(n_bodies)
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            if numbers[p] != 0.0:
                of_body[bodies[p]] = max(of_body[bodies[p]], values[contacts[row]])
    for row in range(len(contacts)):
        for p in range(starts[row], starts[row + 1]):
            if numbers[p] != 0.0:
                largest[contacts[row]] = max(largest[contacts[row]], of_body[bodies[p]])
