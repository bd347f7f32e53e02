"""Colours of contacts: two contacts of one colour share no movable body, so that their updates commute.

Each contact in turn gets the smallest colour that none of its bodies has yet (first fit). A body with d contacts needs
at least d colours. In a packing of balls d is small, so that most colours hold many contacts. Once a body has used
``MAX_FIRST_FIT`` colours, its other contacts get further colours, one after the other.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from ....problems.contact.matrices.pieces import Pieces

MAX_FIRST_FIT = 63
"""Number of colours that are assigned by first fit: one for each bit of a signed integer except the sign bit."""


class Colouring(NamedTuple):
    """The colour of each block, from 0, shape (n_blocks,), and the number of colours."""

    colours: Any
    n_colours: int


def colour_contacts(pieces: Pieces) -> Colouring:
    """Colour the blocks of pieces that come in pairs; the idle chunk belongs to no body."""
    colours, n_colours = _first_fit(pieces.chunks, pieces.n_chunks)
    return Colouring(colours, int(n_colours))


@njit(cache=True)
def _first_fit(chunks, idle):  # type: ignore[no-untyped-def]
    """Return the colour of each block, and the number of colours."""
    n_blocks, n_colours = len(chunks) // 2, 0
    colours = np.empty(n_blocks, dtype=np.int64)
    used = np.zeros(idle + 1, dtype=np.int64)  # a bit for each colour of a body
    last_colours = np.full(idle + 1, MAX_FIRST_FIT - 1, dtype=np.int64)  # the last further colour of a body
    for block in range(n_blocks):
        first, second = chunks[2 * block], chunks[2 * block + 1]
        forbidden, last_colour = np.int64(0), MAX_FIRST_FIT - 1
        for body in (first, second):
            if body != idle:
                forbidden |= used[body]
                last_colour = max(last_colour, last_colours[body])
        colour = 0
        while colour < MAX_FIRST_FIT and (forbidden >> colour) & 1:
            colour += 1
        if colour == MAX_FIRST_FIT:
            colour = last_colour + 1
            last_colours[first] = last_colours[second] = colour
        else:
            used[first] |= np.int64(1) << colour
            used[second] |= np.int64(1) << colour
        colours[block] = colour
        n_colours = max(n_colours, colour + 1)
    return colours, n_colours
