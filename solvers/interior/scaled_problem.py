"""A contact problem in the units of an interior point method, cone by cone.

    û = V ξ + s e_N,      Λ = S r,      û = Ĝ r + ĉ + s e_N,      Ĝ = V G S,  ĉ = V c

V = κ k diag(1, μ, μ) and S = k/(κρ) diag(1, μ, μ) of each contact transform its friction cone {‖Λ_T‖ ≤ μΛ_N} and the
dual cone into the second-order cone; rolling friction has μ_r instead of μ. κ is the reciprocal of the largest free
velocity of the component of the contact. α is the largest diagonal entry of its block of G without rolling rows, ρ is
the mean of α, and k = √(ρ/α). The beginning of the central path then depends neither on units nor on masses. Both
factors contain k, so Ĝ is symmetric if G is, and r∘û does not depend on k.
"""

import numpy as np

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from . import cones
from .lanes import lanes_of

Mask = np.ndarray[tuple[int], np.dtype[np.bool_]]
"""Truth values, one for each cone."""


class ScaledProblem:
    """A scaled problem: m cones with w lanes each, classified by the kinds of ``cones``.

    Attributes:
        lanes: positions of the lanes of the cones in the blocks of the problem.
        kind: kind of each cone, shape (m,).
        uses: which lanes are unknowns, shape (m, w).
        is_cone: which cones have De Saxcé's term, shape (m,).
        friction: μ of ``BOTH`` cones with bounds that depend on their own r_N, scaled, shape (m,); 0 for other cones.
        fixed_bound: a in scaled units, shape (m,).
        impulse_scale: S, shape (m, w), 0 on unused lanes.
        velocity_scale: V, shape (m, w), 0 on unused lanes.
        free_velocity: ĉ, shape (m, w).
    """

    def __init__(self, problem: ContactProblem, residual: Residual) -> None:
        layout = problem.layout
        self._problem, self._residual, self.layout = problem, residual, layout
        self.lanes = lanes_of(layout)
        sliding, self._remote = _sliding_kinds(layout)
        second = self.lanes.block[layout.n_blocks :]
        self.kind: IntArray = np.concatenate([sliding, _rolling_kinds(layout)[second]])
        self.uses = self.lanes.from_block(layout.pad(np.ones(problem.n_rows))) > 0.0
        self.uses[(self.kind == cones.NORMAL) | (self.kind == cones.JOINT), 1:] = False
        self.uses[self.kind == cones.DISC, 0] = False
        self.uses[self.kind == cones.IDLE] = False
        self.is_cone: Mask = self.kind == cones.CONE
        self._scale(problem, residual)
        self.free_velocity = self.velocity_scale * self.lanes.split_from_block(layout.pad(problem.free_velocity))

    @property
    def n_cones(self) -> int:
        """Number of cones."""
        return len(self.kind)

    @property
    def is_remote(self) -> Mask:
        """Which cones have a friction law that is bounded by the impulse of another contact, shape (m,)."""
        mask = np.zeros(self.n_cones, dtype=np.bool_)
        mask[self._remote] = True
        return mask

    def bounds(self, r: FloatArray) -> FloatArray:
        """Return the scaled friction bound of every cone, shape (m,), for r of shape (m, w)."""
        bounds: FloatArray = self.fixed_bound + self.friction * r[:, 0]
        remote = self._remote
        if len(remote):
            partner = self.layout.partner[remote]
            normal = np.maximum(self.impulse_scale[partner, 0] * r[partner, 0], 0.0)
            bounds[remote] += self.layout.friction_coefficient[remote] * normal / self._bound_scale[remote]
        return bounds

    def impulses(self, r: FloatArray) -> FloatArray:
        """Return Λ [N s] over rows, shape (n_rows,), from r."""
        return self.layout.unpad(self.lanes.to_block(self.impulse_scale * r))

    def judged(self, r: FloatArray) -> tuple[FloatArray, float]:
        """Return Λ from r, and its residual in the judge's arithmetic."""
        impulses = self.impulses(r)
        return impulses, self._residual.judged(self._problem, impulses)

    def of_impulses(self, impulses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return r and û, shape (m, w), from Λ [N s] over rows, with s = ‖û_T‖."""
        scale = np.where(self.uses, self.impulse_scale, 1.0)
        r = np.where(self.uses, self.lanes.from_block(self.layout.pad(impulses)) / scale, 0.0)
        velocity = self._problem.relative_velocity(impulses)
        u: FloatArray = self.velocity_scale * self.lanes.split_from_block(self.layout.pad(velocity))
        u[self.is_cone, 0] += tangential_lengths(u)[self.is_cone]
        return r, u

    def _scale(self, problem: ContactProblem, residual: Residual) -> None:
        layout, block = self.layout, self.lanes.block
        law = np.where(layout.normal_law >= 0, layout.normal_law, layout.friction_law)
        speed = (residual.scale if residual.scale > 0.0 else 1.0) / residual.ratios[law]
        alpha = layout.pad(problem.delassus_diagonal)[:, : 1 + layout.sliding].max(axis=1, initial=0.0)
        mean = float(alpha[alpha > 0.0].mean()) if (alpha > 0.0).any() else 1.0
        stretch = np.sqrt(mean / np.where(alpha > 0.0, alpha, mean))
        self._bound_scale = speed * stretch / mean
        mu, fixed_bound, arm = self._bounds_of_cones(residual)
        shape = np.column_stack([np.ones_like(mu), *[np.where(self.is_cone, mu, arm)] * (self.lanes.width - 1)])
        shape *= self.uses
        self.impulse_scale: FloatArray = self._bound_scale[block, None] * shape
        self.velocity_scale: FloatArray = (stretch / speed)[block, None] * shape
        has_own_bound = self.kind == cones.BOTH
        has_own_bound[self._remote] = False
        self.friction: FloatArray = np.where(has_own_bound, mu / arm, 0.0)
        self.fixed_bound: FloatArray = fixed_bound / (arm * self._bound_scale[block])

    def _bounds_of_cones(self, residual: Residual) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return μ and a of every cone, and the length by which rolling impulses with a fixed bound are divided."""
        layout = self.layout
        second = self.lanes.block[layout.n_blocks :]
        return (
            np.concatenate([layout.friction_coefficient, layout.rolling_coefficient[second]]),
            np.concatenate([layout.fixed_bound, layout.rolling_bound[second]]),
            np.concatenate([np.ones(layout.n_blocks), residual.lengths[layout.rolling_law[second]]]),
        )


def tangential_lengths(lanes: FloatArray) -> FloatArray:
    """Return ‖x_T‖ of every cone, shape (m,), of lanes, shape (m, w)."""
    tangent = lanes[:, 1:]
    lengths: FloatArray = np.sqrt(np.einsum("ij,ij->i", tangent, tangent))
    return lengths


def _sliding_kinds(layout: BlockLayout) -> tuple[IntArray, IntArray]:
    """Return the kind of each block's first cone, and the blocks whose friction is bounded by another contact."""
    is_own_partner = layout.partner == np.arange(layout.n_blocks)
    mu, fixed_bound = layout.friction_coefficient, layout.fixed_bound
    has_normal, has_friction = layout.normal_law >= 0, layout.friction_law >= 0
    has_bound = has_friction & ((mu > 0.0) | (fixed_bound > 0.0))
    kind = np.full(layout.n_blocks, cones.IDLE, dtype=np.int64)
    kind[has_normal & ~has_bound] = cones.NORMAL
    kind[has_normal & has_bound] = cones.BOTH
    kind[~has_normal & has_bound] = cones.DISC
    kind[has_normal & is_own_partner & (mu > 0.0) & (fixed_bound == 0.0)] = cones.CONE
    kind[layout.is_bilateral] = cones.JOINT
    return kind, np.flatnonzero(has_friction & ~is_own_partner & (mu > 0.0))


def _rolling_kinds(layout: BlockLayout) -> IntArray:
    """Return the kind of each block's second cone, that of rolling friction."""
    mu, fixed_bound = layout.rolling_coefficient, layout.rolling_bound
    kind = np.full(layout.n_blocks, cones.IDLE, dtype=np.int64)
    kind[fixed_bound > 0.0] = cones.DISC
    kind[mu > 0.0] = cones.BOTH
    kind[(mu > 0.0) & (fixed_bound == 0.0)] = cones.CONE
    return kind
