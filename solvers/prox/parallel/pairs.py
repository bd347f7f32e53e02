"""Conversion of problems to contacts of at most two bodies, for sweeps in several threads and on devices."""

import numpy as np

from ....problems.contact.matrices.pieces import Pieces
from ....problems.contact.problem import ContactProblem

MAX_BODIES = 2
"""Largest number of bodies of a contact."""


def unsupported_reason(problem: ContactProblem) -> str | None:
    """Return why a problem cannot be converted to this form, or None."""
    if problem.factors is None:
        return "the problem holds G only, and sweeps over pairs of bodies need the factors W and M⁻¹"
    directions = problem.factors.directions
    has_pairs = isinstance(directions, Pieces) and directions.in_pairs
    if not has_pairs and np.diff(problem.factor_pieces().starts).max(initial=0) > MAX_BODIES:
        return "a contact touches more than two bodies, and sweeps over pairs of bodies support one or two"
    if not problem.layout.bounds_are_own:
        return "the friction of one contact is bounded by the normal impulse of another"
    return None


def in_pairs(pieces: Pieces) -> Pieces:
    """Return pieces of width 3, two for each block; added pieces are zero and belong to the idle chunk."""
    if pieces.in_pairs and pieces.width == 3:
        return pieces
    n_blocks, counts = pieces.n_blocks, np.diff(pieces.starts)
    offsets = np.arange(len(pieces.chunks)) - np.repeat(pieces.starts[:-1], counts)
    positions = 2 * np.repeat(np.arange(n_blocks), counts) + offsets
    chunks, values = np.full(2 * n_blocks, pieces.n_chunks), np.zeros((2 * n_blocks, 3, pieces.length))
    chunks[positions], values[positions, : pieces.width] = pieces.chunks, pieces.values
    return Pieces(2 * np.arange(n_blocks + 1), chunks, values, pieces.n_chunks)
