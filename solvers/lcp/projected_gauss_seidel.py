"""PyramidPGS: projected Gauss–Seidel on the complementarity problem with box friction, as in physics engines.

The regular k-gon with an even number of sides is a sum of k/2 segments (a zonotope). A friction pyramid is therefore
k/2 one-dimensional friction laws along the edges e_s of the k-gon, with unknowns x_s:

    Λ_T = Σ_s e_s x_s,      |x_s| ≤ (a + μ Λ_N) sin(π/k),      x_s ← clip(x_s − ω e_sᵀξ_T / e_sᵀG_TT e_s)

Scalar unknowns are updated one after the other with the newest values of the others. Planar friction has one segment
and is exact.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import ModelResidual, Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import SLIDING, Method, check_option
from ..sweeps.delassus import DelassusState, DelassusSweep, FlatDelassus, LawArrays, spatial_velocity
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes, inverse
from .formulation import check_sides

DECOMPOSITIONS = 100
"""Number of projected steps that distribute the first Λ_T over the segments; errors only lead to more sweeps."""


@dataclass(frozen=True)
class PyramidPGS(Method):
    """Projected Gauss–Seidel over scalar laws, with a friction pyramid in place of the cone.

    Attributes:
        sides: k, the number of sides of a friction pyramid; even and at least 4.
        relaxation: ω, the factor of each change of an impulse, as in ``SORprox``.

    Raises:
        SolverError: if an option is out of range.
    """

    sides: int = 8
    relaxation: float = 1.0

    law_kinds: ClassVar[frozenset[int]] = SLIDING

    def __post_init__(self) -> None:
        check_sides(self.sides)
        is_valid = self.sides % 2 == 0
        check_option("sides", self.sides, is_valid, "even, so that the pyramid is a sum of friction laws along lines")
        check_relaxation(self.relaxation)

    @property
    def model(self) -> Model:
        """The pyramid of ``sides`` sides."""
        return Model.pyramid(self.sides)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G, the segments of every friction law and their step sizes."""
        self.check_supports(problem)
        if problem.layout.width < 3:  # with at most one segment per contact, the sweep is that of SORprox
            sweep = DelassusSweep.over(problem, diagonal_step_sizes(problem, self.relaxation))
            return PreparedIteration(problem, Residual(problem), sweep.begin)
        delassus, segments = FlatDelassus.of(problem), Segments.of(problem, self.sides, self.relaxation)
        residual = ModelResidual(problem, self.model)
        return PreparedIteration(problem, residual, lambda start: PyramidIterates(delassus, segments, start))


@dataclass(frozen=True, eq=False)
class Segments:
    """The one-dimensional friction laws of every block.

    Attributes:
        edges: e_s in (T1, T2), unit vectors, or zero if a block has fewer segments, shape (n_blocks, n_segments, 2).
        share: bound of a segment relative to the friction bound, 1 (planar) or sin(π/k), shape (n_blocks,).
        edge_step_sizes: ω divided by the curvature along each edge [kg], shape (n_blocks, n_segments).
        normal_step_sizes: ω/G_NN [kg], shape (n_blocks,).
    """

    edges: FloatArray
    share: FloatArray
    edge_step_sizes: FloatArray
    normal_step_sizes: FloatArray

    @staticmethod
    def of(problem: ContactProblem, sides: int, relaxation: float) -> "Segments":
        """Return the segments of pyramids with ``sides`` sides."""
        blocks = problem.delassus_blocks()
        rows = np.append(problem.laws.row_count, 0)[problem.layout.friction_law]  # the last entry is for no friction
        angle = np.pi / sides * (2 * np.arange(sides // 2) + 1) + np.pi / 2
        edges = np.zeros((len(rows), sides // 2, 2))
        edges[rows == 2] = np.column_stack([np.cos(angle), np.sin(angle)])
        edges[rows == 1, 0, 0] = 1.0
        share = np.where(rows == 2, np.sin(np.pi / sides), 1.0)
        diagonal = blocks.values[blocks.starts[:-1]]
        curvature = np.einsum("bsi,bij,bsj->bs", edges, diagonal[:, 1:, 1:], edges)
        return Segments(edges, share, inverse(curvature, relaxation), inverse(diagonal[:, 0, 0], relaxation))

    def distribute(self, layout: BlockLayout, padded: FloatArray) -> FloatArray:
        """Return x within its bounds with Σ_s e_s x_s closest to Λ_T, shape (n_blocks, n_segments).

        ``padded`` is Λ, shape (n_blocks, 3).
        """
        target = padded[:, 1:]
        normal = np.maximum(padded[layout.partner, 0], 0.0)
        bound = (self.share * (layout.fixed_bound + layout.friction_coefficient * normal))[:, None]
        weight = max(0.5 * self.edges.shape[1], 1.0)  # Σ e_s e_sᵀ is this times the identity, or less if planar
        shares = np.zeros(self.edges.shape[:2])
        for _ in range(DECOMPOSITIONS):
            remainder = target - np.einsum("bs,bsi->bi", shares, self.edges)
            shares += np.einsum("bsi,bi->bs", self.edges, remainder) / weight
            shares = np.clip(shares, -bound, bound)
        return shares


class PyramidIterates(DelassusState):
    """Λ of the iteration, and x of its segments."""

    def __init__(self, delassus: FlatDelassus, segments: Segments, start: FloatArray) -> None:
        super().__init__(delassus, start)
        shares = np.zeros(segments.edge_step_sizes.shape)
        if start.any():
            shares = segments.distribute(self.layout, self.padded.reshape(-1, 3))
        laws = LawArrays.of(self.layout, segments.normal_step_sizes)
        self._arguments = (
            *delassus.arrays,
            *laws,
            segments.edges,
            segments.share,
            segments.edge_step_sizes,
            shares,
            self.padded,
        )

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        _sweep(count, *self._arguments)


@njit(cache=True, fastmath={"contract"})
def _sweep(  # type: ignore[no-untyped-def]
    count,
    starts,
    lanes,
    values,
    free_velocity,
    normal_step_sizes,
    friction,
    fixed_bound,
    partner,
    edges,
    share,
    edge_step_sizes,
    shares,
    impulses,
):
    """Do ``count`` sweeps over all contacts, in ``impulses`` and the unknowns x of segments in ``shares``."""
    one, two, three = uint64(1), uint64(2), uint64(3)
    segments = uint64(edge_step_sizes.shape[1])
    edges, edge_step_sizes, shares = edges.reshape(-1), edge_step_sizes.reshape(-1), shares.reshape(-1)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k = three * i
            normal, first, second = spatial_velocity(i, 0, starts, lanes, values, free_velocity, impulses)
            block_start = uint64(9) * starts[i]
            old = impulses[k]
            new = max(old - normal_step_sizes[i] * normal, 0.0)
            impulses[k] = new
            first += values[block_start + three] * (new - old)
            second += values[block_start + uint64(6)] * (new - old)
            g_11, g_12 = values[block_start + uint64(4)], values[block_start + uint64(5)]
            g_21, g_22 = values[block_start + uint64(7)], values[block_start + uint64(8)]
            bound = share[i] * (fixed_bound[i] + friction[i] * impulses[partner[i]])
            sum_1, sum_2 = 0.0, 0.0
            for e in range(segments * i, segments * (i + one)):
                x, y = edges[two * e], edges[two * e + one]
                old_share = shares[e]
                new_share = min(max(old_share - edge_step_sizes[e] * (x * first + y * second), -bound), bound)
                shares[e] = new_share
                sum_1 += x * new_share
                sum_2 += y * new_share
                step = new_share - old_share
                first += (g_11 * x + g_12 * y) * step
                second += (g_21 * x + g_22 * y) * step
            impulses[k + one] = sum_1
            impulses[k + two] = sum_2
