"""The arguments of kernels for small problems that depend only on the laws, computed once per ``Laws`` object."""

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numba import njit

from ....problems.arrays import read_only
from ....problems.compilation.interpretation import interpretable
from ....problems.contact.blocks import write_layout
from ....problems.contact.laws import ROWS_OF_KIND, SET_OF_KIND, LawKind, Laws

_FIRST_ROLLING = int(LawKind.PLANAR_ROLLING)


class LawArguments(NamedTuple):
    """Arguments of kernels that depend on the laws alone.

    Attributes:
        preparation: arguments of the functions in ``preparation``, after G or its factors and c.
        sweeps: arguments of the functions in ``sweeps``, after c.
    """

    preparation: tuple[Any, ...]
    sweeps: tuple[Any, ...]

    @staticmethod
    def of(laws: Laws) -> "LawArguments | None":
        """Return the arguments, or None unless the laws form contacts with equal numbers of rows."""
        law_arrays = laws.kind, laws.partner, laws.friction_coefficient, laws.fixed_bound
        are_equal_contacts, *arrays = _lay_out_contacts(*law_arrays)
        if not are_equal_contacts:
            return None
        sets, row_count, is_rolling, slot, contact_of_row, partner, friction, fixed_bound, partner_lanes = arrays
        read_only(sets, row_count, slot, partner, friction, fixed_bound)
        first_row = laws.first_row
        preparation = sets, row_count, is_rolling, first_row, laws.partner, slot, contact_of_row, partner
        residual = sets, row_count, first_row, laws.friction_coefficient, laws.fixed_bound, laws.partner
        return LawArguments(preparation, (friction, fixed_bound, partner_lanes, *residual))


_ARGUMENTS: WeakKeyDictionary[Laws, LawArguments | None] = WeakKeyDictionary()


def law_arguments(laws: Laws) -> LawArguments | None:
    """Return the arguments for ``laws``; repeated calls return the same object."""
    arguments = _ARGUMENTS.get(laws)
    if arguments is None and laws not in _ARGUMENTS:
        arguments = _ARGUMENTS[laws] = LawArguments.of(laws)
    return arguments


@interpretable
@njit(cache=True)
def _lay_out_contacts(kind, partner_law, mu, fixed_bound):  # type: ignore[no-untyped-def]
    """Return whether the laws form contacts with equal numbers of rows, and the arrays of ``Laws`` and ``BlockLayout``.

    The arrays hold, for each law, its set, its number of rows and whether it is rolling friction; for each row, its
    slot and its contact; and for each contact, its partner, μ, the fixed bound, and the normal lane of its partner.
    """
    n_laws, n_rows = len(kind), 0
    sets, row_count = np.empty(n_laws, dtype=np.int8), np.empty(n_laws, dtype=np.int64)
    is_rolling = np.empty(n_laws, dtype=np.bool_)
    for law in range(n_laws):
        sets[law], row_count[law] = SET_OF_KIND[kind[law]], ROWS_OF_KIND[kind[law]]
        is_rolling[law] = kind[law] >= _FIRST_ROLLING
        n_rows += row_count[law]
    slot, indices, bounds = (
        np.empty(n_rows, dtype=np.int64),
        np.empty((5, n_laws), dtype=np.int64),
        np.empty((4, n_laws)),
    )
    is_bilateral = np.empty(n_laws, dtype=np.bool_)
    laws = (sets, row_count, is_rolling, partner_law, mu, fixed_bound)
    sliding, width, n_blocks, n_joints = write_layout(*laws, slot, indices, bounds, is_bilateral)
    are_equal_contacts = width == 1 + sliding and n_joints == 0 and n_rows == width * n_blocks
    partner, partner_lanes = indices[3, :n_blocks], np.empty(n_blocks, dtype=np.uint64)
    for b in range(n_blocks):
        partner_lanes[b] = width * partner[b]
    friction, block_fixed_bound = bounds[0, :n_blocks], bounds[1, :n_blocks]
    arrays = (sets, row_count, is_rolling, slot, slot // width, partner, friction, block_fixed_bound, partner_lanes)
    return (are_equal_contacts, *arrays)
