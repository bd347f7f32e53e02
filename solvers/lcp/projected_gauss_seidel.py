"""Projected Gauss–Seidel on the complementarity problem with box friction, as physics engines do it.

The regular k-gon with an even number of sides is a sum of k/2 segments (a zonotope), so a friction pyramid is k/2
one-dimensional friction laws along the edges e_s of the k-gon, with unknowns x_s of their own:

    Λ_T = Σ_s e_s x_s,      |x_s| ≤ (a + μ Λ_N) sin(π/k),      x_s ← clip(x_s − ω e_sᵀξ_T / e_sᵀG_TT e_s)

and every scalar unknown is visited in turn with the newest values of all others. Planar friction is one segment, exact.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.delassus import DelassusBlocks
from ...problems.contact.judge import ModelResidual, Residual
from ...problems.contact.laws import LawKind
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..interface import SolverError
from ..iteration.loop import PreparedIteration
from ..sweeps.delassus import DelassusSweep, block_product
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes
from .formulation import check_sides

DECOMPOSITIONS = 100
"""Alternating projections that share a first Λ_T out among the segments; an inexact share only costs sweeps."""


@dataclass(frozen=True)
class PyramidPGS:
    """Projected Gauss–Seidel over scalar laws, with a friction pyramid in place of the cone.

    Attributes:
        sides: k, even and at least 4.
        relaxation: ω.

    Raises:
        SolverError: for an option out of range.
    """

    sides: int = 8
    relaxation: float = 1.0

    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_sides(self.sides)
        if self.sides % 2:
            raise SolverError(
                f"sides must be even, got {self.sides}: only then is the pyramid a sum of friction laws along lines."
            )
        check_relaxation(self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    @property
    def model(self) -> Model:
        """The pyramid of ``sides`` sides."""
        return Model.pyramid(self.sides)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G, the segments of every friction law and their step sizes."""
        blocks = problem.delassus_blocks()
        if problem.layout.width < 3:  # one segment a contact: the sweep of SORprox, law by law
            sizes = diagonal_step_sizes(problem, self.relaxation)
            return PreparedIteration(problem, Residual(problem), DelassusSweep.over(problem, blocks, sizes).begin)
        segments = Segments.of(problem, blocks, self.sides, self.relaxation)
        residual = ModelResidual(problem, self.model)
        return PreparedIteration(problem, residual, lambda start: PyramidIterates(problem, blocks, segments, start))


@dataclass(frozen=True, eq=False)
class Segments:
    """The one-dimensional friction laws of every block.

    Attributes:
        edges: unit directions in (T1, T2), zero where a block has fewer, shape (n_blocks, n_segments, 2).
        share: of the friction bound that a segment may bear: 1 (planar) or sin(π/k), shape (n_blocks,).
        sizes: ω over the curvature along each direction [kg], shape (n_blocks, n_segments).
        normal_sizes: ω/G_NN [kg], shape (n_blocks,).
    """

    edges: FloatArray
    share: FloatArray
    sizes: FloatArray
    normal_sizes: FloatArray

    @staticmethod
    def of(problem: ContactProblem, blocks: DelassusBlocks, sides: int, relaxation: float) -> "Segments":
        """Return the segments of pyramids with ``sides`` sides."""
        kind = np.append(problem.laws.kind, LawKind.UNILATERAL)[problem.layout.friction_law]  # the last: no friction
        angle = np.pi / sides * (2 * np.arange(sides // 2) + 1) + np.pi / 2
        edges = np.zeros((len(kind), sides // 2, 2))
        edges[kind == LawKind.SPATIAL_FRICTION] = np.column_stack([np.cos(angle), np.sin(angle)])
        edges[kind == LawKind.PLANAR_FRICTION, 0, 0] = 1.0
        share = np.where(kind == LawKind.SPATIAL_FRICTION, np.sin(np.pi / sides), 1.0)
        own = blocks.values[blocks.starts[:-1]]
        curvature = np.einsum("bsi,bij,bsj->bs", edges, own[:, 1:, 1:], edges)
        return Segments(edges, share, _inverse(curvature, relaxation), _inverse(own[:, 0, 0], relaxation))

    @property
    def arguments(self) -> tuple[FloatArray, ...]:
        """What the kernel takes."""
        return self.edges, self.share, self.sizes, self.normal_sizes

    def shared_out(self, layout: BlockLayout, padded: FloatArray) -> FloatArray:
        """Return x with Σ_s e_s x_s = Λ_T within its bounds, as nearly as there is one, shape (n_blocks, n_segments).

        Args:
            layout: the padded blocks.
            padded: Λ, shape (n_blocks, 3).
        """
        target = padded[:, 1:]
        normal = np.maximum(padded[layout.partner, 0], 0.0)
        bound = (self.share * (layout.fixed_bound + layout.friction_coefficient * normal))[:, None]
        weight = max(0.5 * self.edges.shape[1], 1.0)  # E Eᵀ is this times the identity, or less for planar friction
        shares = np.zeros(self.edges.shape[:2])
        for _ in range(DECOMPOSITIONS):
            missing = target - np.einsum("bs,bsi->bi", shares, self.edges)
            shares += np.einsum("bsi,bi->bs", self.edges, missing) / weight
            shares = np.clip(shares, -bound, bound)
        return shares


class PyramidIterates:
    """Λ of the iteration and its shares; see ``prox.iteration.Iterates``."""

    def __init__(self, problem: ContactProblem, blocks: DelassusBlocks, segments: Segments, start: FloatArray) -> None:
        self._layout = layout = problem.layout
        lanes = (3 * blocks.columns).astype(np.uint32)
        self._matrix: tuple[Any, Any, FloatArray] = (blocks.starts.astype(np.uint64), lanes, blocks.values.reshape(-1))
        self._free = layout.pad(problem.free_velocity).reshape(-1)
        partner = (3 * layout.partner).astype(np.uint64)
        laws = (layout.friction_coefficient, layout.fixed_bound, partner, *segments.arguments)
        padded = layout.pad(start)
        self._shares = segments.shared_out(layout, padded) if start.any() else np.zeros(segments.sizes.shape)
        self._impulses = padded.reshape(-1)
        self._velocity = np.empty_like(self._impulses)
        self._arguments: tuple[Any, ...] = (*self._matrix, self._free, *laws, self._shares, self._impulses)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        _sweep(count, *self._arguments)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._layout.unpad(self._impulses)

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        block_product(3, *self._matrix, self._impulses, self._free, self._velocity)
        return self._layout.unpad(self._velocity)


def _inverse(curvature: FloatArray, relaxation: float) -> FloatArray:
    """Return ω/curvature, 0 where nothing moves."""
    return np.divide(relaxation, curvature, out=np.zeros_like(curvature), where=curvature > 0.0)


@njit(cache=True, fastmath={"contract"})
def _sweep(  # type: ignore[no-untyped-def]
    count, starts, lanes, values, free, friction, fixed, partner, edges, share, sizes, normal_sizes, shares, impulses
):
    one, two, three = uint64(1), uint64(2), uint64(3)
    segments = uint64(sizes.shape[1])
    edges, sizes, shares = edges.reshape(-1), sizes.reshape(-1), shares.reshape(-1)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k = three * i
            normal, first, second = free[k], free[k + one], free[k + two]
            for p in range(starts[i], starts[i + one]):
                j, v = uint64(lanes[p]), uint64(9) * p
                n, t, s = impulses[j], impulses[j + one], impulses[j + two]
                normal += values[v] * n + values[v + one] * t + values[v + two] * s
                first += values[v + three] * n + values[v + uint64(4)] * t + values[v + uint64(5)] * s
                second += values[v + uint64(6)] * n + values[v + uint64(7)] * t + values[v + uint64(8)] * s
            own = uint64(9) * starts[i]
            old = impulses[k]
            new = max(old - normal_sizes[i] * normal, 0.0)
            impulses[k] = new
            first += values[own + three] * (new - old)
            second += values[own + uint64(6)] * (new - old)
            g_11, g_12 = values[own + uint64(4)], values[own + uint64(5)]
            g_21, g_22 = values[own + uint64(7)], values[own + uint64(8)]
            bound = share[i] * (fixed[i] + friction[i] * impulses[partner[i]])
            sum_1, sum_2 = 0.0, 0.0
            for e in range(segments * i, segments * (i + one)):
                x, y = edges[two * e], edges[two * e + one]
                held = shares[e]
                moved = min(max(held - sizes[e] * (x * first + y * second), -bound), bound)
                shares[e] = moved
                sum_1 += x * moved
                sum_2 += y * moved
                step = moved - held
                first += (g_11 * x + g_12 * y) * step
                second += (g_21 * x + g_22 * y) * step
            impulses[k + one] = sum_1
            impulses[k + two] = sum_2
