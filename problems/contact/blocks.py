"""The contacts of a problem as blocks of equal width, the layout that kernels run over.

A block is a unilateral law with the friction law it bounds, or one law alone. Its lanes are N, T1, T2, cut to the width
of the widest block: 1 (no friction anywhere), 2 (planar) or 3 (spatial). A lane that a block does not use has a zero
row and column in G and c, and stays at Λ = 0 under every projection, so kernels need no case distinctions.
"""

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numba import njit

from ..arrays import FloatArray, IntArray, read_only
from .laws import Laws


@dataclass(frozen=True, eq=False)
class BlockLayout:
    """Where each row of a problem stands in the padded blocks, and each block's friction bound.

    The bound of the tangential lanes is fixed_bound + friction_coefficient · max(Λ_N of block ``partner``, 0).

    Attributes:
        width: lanes per block, 1, 2 or 3.
        slot: padded index (block · width + lane) of each row, shape (n_rows,).
        normal_law: index of the block's unilateral law, −1 for none, shape (n_blocks,).
        friction_law: index of the block's friction law, −1 for none, shape (n_blocks,).
        friction_coefficient: μ, shape (n_blocks,).
        fixed_bound: a [N s], shape (n_blocks,).
        partner: block whose normal impulse bounds the friction; the block itself where there is none, (n_blocks,).
    """

    width: int
    slot: IntArray
    normal_law: IntArray
    friction_law: IntArray
    friction_coefficient: FloatArray
    fixed_bound: FloatArray
    partner: IntArray

    @staticmethod
    def of(laws: Laws) -> "BlockLayout":
        """Return a new layout of ``laws``; ``layout_of`` keeps one for each ``Laws`` object."""
        n_laws = laws.n_laws
        slot, numbers, bounds = np.empty(laws.n_rows, np.int64), np.empty((4, n_laws), np.int64), np.empty((2, n_laws))
        arguments = (laws.kind, laws.partner, laws.friction_coefficient, laws.fixed_bound)
        width, n = _lay_out(*arguments, slot, numbers, bounds)
        normal, friction, partner = numbers[0, :n], numbers[1, :n], numbers[2, :n]
        coefficient, fixed = bounds[0, :n], bounds[1, :n]
        read_only(slot, normal, friction, partner, coefficient, fixed)
        return BlockLayout(width, slot, normal, friction, coefficient, fixed, partner)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.partner)

    @cached_property
    def contact_of_row(self) -> IntArray:
        """Block of each row, shape (n_rows,)."""
        return self.slot // self.width

    @cached_property
    def is_dense(self) -> bool:
        """Whether every lane is a row, so that padded and plain vectors are the same numbers."""
        return len(self.slot) == self.n_blocks * self.width

    @cached_property
    def bounds_are_own(self) -> bool:
        """Whether no friction is bounded by the impulse of another block."""
        return bool(np.array_equal(self.partner, np.arange(self.n_blocks)))

    def pad(self, rows: FloatArray) -> FloatArray:
        """Return a vector over rows as a fresh array of shape (n_blocks, width), unused lanes zero."""
        if self.is_dense:
            return rows.reshape(self.n_blocks, self.width).copy()
        padded = np.zeros(self.n_blocks * self.width)
        padded[self.slot] = rows
        return padded.reshape(self.n_blocks, self.width)

    def unpad(self, padded: FloatArray) -> FloatArray:
        """Return a fresh vector over rows, shape (n_rows,), from an array of shape (n_blocks, width)."""
        flat = padded.reshape(-1)
        return flat.copy() if self.is_dense else flat[self.slot]


_LAYOUTS: WeakKeyDictionary[Laws, BlockLayout] = WeakKeyDictionary()


def layout_of(laws: Laws) -> BlockLayout:
    """Return the layout of ``laws``, the same object each time; time stepping meets the same laws again and again."""
    layout = _LAYOUTS.get(laws)
    if layout is None:
        layout = _LAYOUTS[laws] = BlockLayout.of(laws)
    return layout


@njit(cache=True)
def _lay_out(kind, partner_law, mu, fixed, slot, numbers, bounds):  # type: ignore[no-untyped-def]
    """Return lanes a block and the number of blocks.

    Writes slots of the rows, normal law, friction law and partner of each block, block of each law, and μ and a of each
    block.
    """
    block, n_blocks, width = numbers[3], 0, 1
    for law in range(len(kind)):  # friction right behind its partner shares its block
        width = max(width, 1 + kind[law])
        if law == 0 or kind[law] == 0 or partner_law[law] != law - 1:
            n_blocks += 1
        block[law] = n_blocks - 1
    normal, friction, partner = numbers[0], numbers[1], numbers[2]
    for b in range(n_blocks):
        normal[b], friction[b], partner[b] = -1, -1, b
        bounds[0, b] = bounds[1, b] = 0.0
    row = 0
    for law in range(len(kind)):
        b = block[law]
        if kind[law] == 0:
            normal[b] = law
            slot[row] = width * b
            row += 1
            continue
        friction[b] = law
        bounds[0, b], bounds[1, b] = mu[law], fixed[law]
        if partner_law[law] >= 0:
            partner[b] = block[partner_law[law]]
        for lane in range(kind[law]):
            slot[row] = width * b + 1 + lane
            row += 1
    return width, n_blocks
