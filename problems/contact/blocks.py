"""The layout of a problem in blocks of equal width, which lets kernels treat all contacts alike.

A block is a unilateral law with the friction laws that it bounds and that follow it, or a single law. Its lanes are
N, T1, T2, R1, R2, R3, without those that no block uses. An unused lane of a block has a zero row and column in G and a
zero in c, and every projection keeps Λ = 0 in it.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from ..arrays import FloatArray, IntArray, ReadOnlyRecord, read_only
from ..compilation.interpretation import interpretable
from .laws import BALL, HALF_LINE, LINE, Laws


@dataclass(frozen=True, eq=False)
class BlockLayout(ReadOnlyRecord):
    """The place of each row of a problem in the padded blocks, and the friction bound of each block.

    The bound of the tangential lanes is fixed_bound + friction_coefficient · max(Λ_N, 0) with Λ_N of block ``partner``.
    The bound of the rolling lanes is rolling_bound + rolling_coefficient · max(Λ_N, 0) with the block's own Λ_N.

    Attributes:
        width: lanes per block, 1 + ``sliding`` + ``rolling``.
        sliding: tangential lanes per block, 0, 1 or 2.
        slot: padded index (block · width + lane) of each row, shape (n_rows,).
        normal_law: index of the block's unilateral or bilateral law, −1 for none, shape (n_blocks,).
        friction_law: index of the block's law of sliding friction, −1 for none, shape (n_blocks,).
        rolling_law: index of the block's law of rolling friction, −1 for none, shape (n_blocks,).
        friction_coefficient: μ, shape (n_blocks,).
        fixed_bound: a [N s], shape (n_blocks,).
        rolling_coefficient: μ_r [m], shape (n_blocks,).
        rolling_bound: a of the rolling friction [N m s], shape (n_blocks,).
        partner: block whose normal impulse bounds the friction, shape (n_blocks,); the block itself if there is none.
        is_bilateral: whether the block is a bilateral law, shape (n_blocks,).
        has_contacts_only: whether there are neither joints nor rolling friction, so that every block has one friction
            cone.
    """

    width: int
    sliding: int
    slot: IntArray
    normal_law: IntArray
    friction_law: IntArray
    rolling_law: IntArray
    friction_coefficient: FloatArray
    fixed_bound: FloatArray
    rolling_coefficient: FloatArray
    rolling_bound: FloatArray
    partner: IntArray
    is_bilateral: NDArray[np.bool_]
    has_contacts_only: bool

    @staticmethod
    def of(laws: Laws) -> "BlockLayout":
        """Return a new layout of ``laws``; ``layout_of`` caches one per ``Laws`` object."""
        n_laws = laws.n_laws
        slot, indices, bounds = np.empty(laws.n_rows, np.int64), np.empty((5, n_laws), np.int64), np.empty((4, n_laws))
        is_bilateral = np.empty(n_laws, np.bool_)
        arguments = (
            laws.sets,
            laws.row_count,
            laws.is_rolling,
            laws.partner,
            laws.friction_coefficient,
            laws.fixed_bound,
        )
        sliding, width, n, n_joints = map(int, write_layout(*arguments, slot, indices, bounds, is_bilateral))
        read_only(slot, indices, bounds, is_bilateral)
        owners, partner = (indices[0, :n], indices[1, :n], indices[2, :n]), indices[3, :n]
        limits = (bounds[0, :n], bounds[1, :n], bounds[2, :n], bounds[3, :n])
        has_contacts_only = width == 1 + sliding and n_joints == 0
        return BlockLayout(width, sliding, slot, *owners, *limits, partner, is_bilateral[:n], has_contacts_only)

    def first(self, n_blocks: int) -> "BlockLayout":
        """Return the layout of the first ``n_blocks`` blocks.

        The layout must be dense, and no later block may bound the friction of these blocks.
        """
        arrays = {name: getattr(self, name)[:n_blocks] for name in _OF_BLOCKS}
        layout = replace(self, slot=self.slot[: n_blocks * self.width], **arrays)
        if self.bounds_are_own:
            layout.__dict__["bounds_are_own"] = True
        return layout

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
        """Whether every lane is a row, so that padded and unpadded vectors have the same entries."""
        return len(self.slot) == self.n_blocks * self.width

    @property
    def rolling(self) -> int:
        """Rolling lanes per block, 0 to 3."""
        return self.width - 1 - self.sliding

    @cached_property
    def bounds_are_own(self) -> bool:
        """Whether no friction is bounded by the impulse of another block."""
        return bool(np.array_equal(self.partner, np.arange(self.n_blocks)))

    @cached_property
    def has_fixed_bounds(self) -> bool:
        """Whether the bound of the sliding friction of a block has a fixed part."""
        return bool(self.fixed_bound.any())

    def pad(self, rows: FloatArray) -> FloatArray:
        """Return a vector over rows as a new array, shape (n_blocks, width), with zeros in unused lanes."""
        if self.is_dense:
            return rows.reshape(self.n_blocks, self.width).copy()
        padded = np.zeros(self.n_blocks * self.width)
        padded[self.slot] = rows
        return padded.reshape(self.n_blocks, self.width)

    def unpad(self, padded: FloatArray) -> FloatArray:
        """Return a new vector over rows, shape (n_rows,), from an array of shape (n_blocks, width)."""
        flat = padded.reshape(-1)
        return flat.copy() if self.is_dense else flat[self.slot]

    def rows_of(self, padded: FloatArray) -> FloatArray:
        """Return ``unpad`` of a flat array, without a copy if every lane is a row."""
        return padded if self.is_dense else padded[self.slot]


_OF_BLOCKS = (
    *("normal_law", "friction_law", "rolling_law", "friction_coefficient", "fixed_bound"),
    *("rolling_coefficient", "rolling_bound", "partner", "is_bilateral"),
)
"""Fields of a layout with one entry per block."""

_LAYOUTS: WeakKeyDictionary[Laws, BlockLayout] = WeakKeyDictionary()


def layout_of(laws: Laws) -> BlockLayout:
    """Return the layout of ``laws``, the same object at each call."""
    layout = _LAYOUTS.get(laws)
    if layout is None:
        layout = _LAYOUTS[laws] = _part_of_layout(laws) or BlockLayout.of(laws)
    return layout


def _part_of_layout(laws: Laws) -> BlockLayout | None:
    """Return the layout of laws that begin a longer list of equal contacts, from the layout of the list.

    Return None for other laws.
    """
    if laws.equal_laws is None or not laws.n_laws:
        return None
    longer = layout_of(laws.equal_laws)
    return longer.first(laws.n_laws * longer.n_blocks // laws.equal_laws.n_laws)


@njit(cache=True, inline="always")
def block_of(slot, width):  # type: ignore[no-untyped-def]
    """Return ``slot // width`` of a slot that is not negative; the usual widths are constants, which divide faster."""
    unsigned, three, two = uint64(slot), uint64(3), uint64(2)
    if width == 3:
        return unsigned // three
    return unsigned // two if width == 2 else unsigned // uint64(width)


@interpretable
@njit(cache=True, error_model="numpy")
def write_layout(  # type: ignore[no-untyped-def]
    sets, row_count, is_rolling, partner_law, mu, fixed_bound, slot, indices, bounds, is_bilateral
):
    """Return the numbers of tangential lanes and of all lanes per block, of blocks, and of joints.

    Write the slot of each row and the block of each law. For each block, write the normal, friction
    and rolling law, the partner, μ, a, μ_r, the rolling a, and whether it is a joint.
    """
    block, n_blocks, sliding, rolling = indices[4], 0, 0, 0
    for law in range(len(sets)):  # friction that directly follows its partner shares its block; so does rolling
        if is_rolling[law]:
            rolling = max(rolling, row_count[law])
        elif sets[law] == BALL:
            sliding = max(sliding, row_count[law])
        if law == 0 or sets[law] == HALF_LINE or (not is_rolling[law] and partner_law[law] != law - 1):
            n_blocks += 1
        block[law] = n_blocks - 1
    width, partner = 1 + sliding + rolling, indices[3]
    for b in range(n_blocks):
        indices[0, b], indices[1, b], indices[2, b], partner[b] = -1, -1, -1, b
        bounds[0, b] = bounds[1, b] = bounds[2, b] = bounds[3, b] = 0.0
        is_bilateral[b] = False
    row, n_joints = 0, 0
    for law in range(len(sets)):
        b = block[law]
        if sets[law] != BALL:
            indices[0, b], is_bilateral[b] = law, sets[law] == LINE
            n_joints += sets[law] == LINE
            slot[row] = width * b
            row += 1
            continue
        rolls = 1 if is_rolling[law] else 0
        indices[1 + rolls, b] = law
        bounds[2 * rolls, b], bounds[2 * rolls + 1, b] = mu[law], fixed_bound[law]
        if rolls == 0 and partner_law[law] >= 0:
            partner[b] = block[partner_law[law]]
        first = 1 + sliding if rolls == 1 else 1
        for lane in range(row_count[law]):
            slot[row] = width * b + first + lane
            row += 1
    return sliding, width, n_blocks, n_joints
