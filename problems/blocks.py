"""The contacts of a problem as blocks of equal width, the layout that kernels run over.

A block is a unilateral law with the friction law it bounds, or one law alone. Its lanes are N, T1, T2, cut to the width
of the widest block: 1 (no friction anywhere), 2 (planar) or 3 (spatial). A lane that a block does not use has a zero
row and column in G and c, and stays at Λ = 0 under every projection, so kernels need no case distinctions.
"""

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from .laws import FloatArray, IntArray, LawKind, Laws, frozen


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
        n = laws.n_laws
        joins = np.zeros(n, dtype=bool)  # friction laws that stand right behind their partner share its block
        joins[1:] = laws.is_friction[1:] & (laws.partner[1:] == np.arange(n - 1))
        block = np.cumsum(~joins) - 1
        n_blocks = int(block[-1]) + 1 if n else 0
        width = 1 + int(laws.kind.max(initial=0))
        unilateral = np.flatnonzero(~laws.is_friction)
        friction = np.flatnonzero(laws.is_friction)

        normal_law = np.full(n_blocks, -1, dtype=np.int64)
        normal_law[block[unilateral]] = unilateral
        friction_law = np.full(n_blocks, -1, dtype=np.int64)
        friction_law[block[friction]] = friction
        coefficient = np.zeros(n_blocks)
        coefficient[block[friction]] = laws.friction_coefficient[friction]
        fixed = np.zeros(n_blocks)
        fixed[block[friction]] = laws.fixed_bound[friction]
        partner = np.arange(n_blocks)
        bounded = friction[laws.partner[friction] >= 0]
        partner[block[bounded]] = block[laws.partner[bounded]]

        slot = np.zeros(laws.n_rows, dtype=np.int64)
        slot[laws.first_row] = width * block + laws.is_friction
        spatial = laws.kind == LawKind.SPATIAL_FRICTION
        slot[laws.first_row[spatial] + 1] = width * block[spatial] + 2
        return BlockLayout(
            width,
            frozen(slot, np.int64),
            frozen(normal_law, np.int64),
            frozen(friction_law, np.int64),
            frozen(coefficient, np.float64),
            frozen(fixed, np.float64),
            frozen(partner, np.int64),
        )

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.partner)

    @cached_property
    def is_dense(self) -> bool:
        """Whether every lane is a row, so that padded and plain vectors are the same numbers."""
        return len(self.slot) == self.n_blocks * self.width

    def pad(self, rows: FloatArray) -> FloatArray:
        """Return a vector over rows as a fresh array of shape (n_blocks, width), unused lanes zero."""
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
