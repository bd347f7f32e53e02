"""Positions of the lanes of cones in the blocks of a problem.

A block has the lanes N, T, R (``problems.contact.blocks``). Its first cone has N and T; a contact with rolling friction
has a second cone, with R and a copy of N. The lanes r of impulses and û of velocities (``cones``) satisfy

    r_N of both = r_N of the block,      û_N¹ + û_N² = û_N of the block.

Impulses are copied from blocks to cones, and velocities are summed from cones to blocks. D of a block, its part of the
matrix Ĝ + D of a Newton step, is the sum of the D of its cones. The system does not contain the two parts of û_N.
"""

import numpy as np

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.blocks import BlockLayout


class Lanes:
    """The lanes of m cones with w lanes each in n blocks: one cone per block, with its lanes padded by zeros.

    Attributes:
        width: number of lanes of a cone, w, 3 or 4.
        block: block of each cone, first cones of all blocks in order, then second cones, shape (m,).
    """

    width: int = 3

    def __init__(self, layout: BlockLayout) -> None:
        self._layout = layout
        self.block: IntArray = np.arange(layout.n_blocks)

    def from_block(self, blocks: FloatArray) -> FloatArray:
        """Return impulses of cones, shape (m, w), from those of blocks; both cones receive Λ_N."""
        if blocks.shape[1] == self.width:
            return blocks
        lanes = np.zeros((len(blocks), self.width))
        lanes[:, : blocks.shape[1]] = blocks
        return lanes

    def split_from_block(self, blocks: FloatArray) -> FloatArray:
        """Return velocities of cones, shape (m, w), from those of blocks; the first cone receives all of ξ_N."""
        return self.from_block(blocks)

    def to_block(self, cones: FloatArray) -> FloatArray:
        """Return impulses of blocks, shape (n, width), from those of cones, whose Λ_N agree."""
        return np.ascontiguousarray(cones[:, : self._layout.width])

    def sum_to_block(self, cones: FloatArray) -> FloatArray:
        """Return velocities of blocks, shape (n, width), from those of cones."""
        return self.to_block(cones)

    def matrices_to_block(self, cones: FloatArray) -> FloatArray:
        """Return D of blocks, shape (n, width, width), from D of cones, shape (m, w, w)."""
        return np.ascontiguousarray(cones[:, : self._layout.width, : self._layout.width])

    def equalise_normals(self, impulses: FloatArray) -> None:
        """Set Λ_N of both cones of each block to the larger of the two in ``impulses``, shape (m, w)."""


class RollingLanes(Lanes):
    """Lanes with a second cone for each block with rolling friction; this cone uses its N lane if μ_r > 0."""

    def __init__(self, layout: BlockLayout) -> None:
        super().__init__(layout)
        n = layout.n_blocks
        self._rolling_blocks = np.flatnonzero(layout.rolling_law >= 0)
        self.width = max(3, 1 + layout.rolling)
        self.block = np.concatenate([np.arange(n), self._rolling_blocks])
        self._first, self._second = slice(0, n), slice(n, n + len(self._rolling_blocks))
        self._sliding, self._rolling = 1 + layout.sliding, layout.rolling
        uses_normal = layout.rolling_coefficient[self._rolling_blocks] > 0.0
        self._shared_blocks = self._rolling_blocks[uses_normal]
        self._copies = n + np.flatnonzero(uses_normal)
        self._without_rolling = np.flatnonzero(layout.rolling_law < 0)

    def from_block(self, blocks: FloatArray) -> FloatArray:
        """See ``Lanes``."""
        lanes = self.split_from_block(blocks)
        lanes[self._second, 0] = blocks[self._rolling_blocks, 0]
        return lanes

    def split_from_block(self, blocks: FloatArray) -> FloatArray:
        """See ``Lanes``."""
        lanes = np.zeros((len(self.block), self.width))
        lanes[self._first, : self._sliding] = blocks[:, : self._sliding]
        lanes[self._second, 1 : 1 + self._rolling] = blocks[self._rolling_blocks, self._sliding :]
        return lanes

    def to_block(self, cones: FloatArray) -> FloatArray:
        """See ``Lanes``."""
        blocks = np.zeros((self._layout.n_blocks, self._layout.width))
        blocks[:, : self._sliding] = cones[self._first, : self._sliding]
        blocks[self._rolling_blocks, self._sliding :] = cones[self._second, 1 : 1 + self._rolling]
        return blocks

    def sum_to_block(self, cones: FloatArray) -> FloatArray:
        """See ``Lanes``."""
        blocks = self.to_block(cones)
        blocks[self._shared_blocks, 0] += cones[self._copies, 0]
        return blocks

    def matrices_to_block(self, cones: FloatArray) -> FloatArray:
        """See ``Lanes``."""
        sliding, rolling = self._sliding, slice(1, 1 + self._rolling)
        blocks = np.zeros((self._layout.n_blocks, self._layout.width, self._layout.width))
        blocks[:, :sliding, :sliding] = cones[self._first, :sliding, :sliding]
        blocks[self._rolling_blocks, sliding:, sliding:] = cones[self._second, rolling, rolling]
        blocks[self._shared_blocks, 0, 0] += cones[self._copies, 0, 0]
        blocks[self._shared_blocks, 0, sliding:] = cones[self._copies, 0, rolling]
        blocks[self._shared_blocks, sliding:, 0] = cones[self._copies, rolling, 0]
        blocks[self._without_rolling, sliding:, sliding:] = np.eye(self._rolling)
        return blocks

    def equalise_normals(self, impulses: FloatArray) -> None:
        """See ``Lanes``."""
        larger = np.maximum(impulses[self._shared_blocks, 0], impulses[self._copies, 0])
        impulses[self._shared_blocks, 0] = impulses[self._copies, 0] = larger


def lanes_of(layout: BlockLayout) -> Lanes:
    """Return the lanes of the cones of a layout."""
    return RollingLanes(layout) if layout.rolling else Lanes(layout)
