"""A contact problem in the units of an interior point method, contact by contact.

    û = V ξ + s e_N,      Λ = S r,      û = Ĝ r + ĉ + s e_N,      Ĝ = V G S,  ĉ = V c

V = κ k diag(1, μ, μ) and S = k/(κρ) diag(1, μ, μ) of each contact turn its friction cone {‖Λ_T‖ ≤ μΛ_N} and the dual
one into the second-order cone. κ is one over the largest free velocity of its component, ρ the mean of α, the largest
diagonal entry of G of each contact, and k = √(ρ/α): neither units nor masses decide where the path begins. Both sides
carry k, so Ĝ is symmetric where G is, and r∘û does not depend on k at all.
"""

from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from . import cones

Formulation = Literal["de_saxce", "bounded"]


class ScaledProblem:
    """One problem, scaled, its contacts sorted into the kinds of ``cones``.

    Attributes:
        kind: of each contact, shape (n,).
        uses: which lanes are unknowns, shape (n, 3).
        friction: μ of bounds that move with the contact's own r_N, in scaled units, shape (n,), else 0.
        fixed_bound: a in scaled units, shape (n,).
        impulse_scale: S, shape (n, 3), 0 on lanes that are not used.
        velocity_scale: V, as S.
        free_velocity: ĉ, shape (n, 3).
        has_remote_bounds: whether a friction law is bounded by the impulse of another contact.
    """

    def __init__(self, problem: ContactProblem, residual: Residual, formulation: Formulation) -> None:
        layout = problem.layout
        self._problem, self._residual, self.layout = problem, residual, layout
        self.kind, self._is_remote = _kinds(layout, formulation)
        n, width = layout.n_blocks, layout.width
        self.uses = np.zeros((n, 3), dtype=np.bool_)
        self.uses[:, :width] = layout.pad(np.ones(problem.n_rows)) > 0.0
        self.uses[self.kind == cones.NORMAL, 1:] = False
        self.uses[self.kind == cones.DISC, 0] = False
        self.uses[self.kind == cones.IDLE] = False
        is_cone = self.kind == cones.CONE
        own = (self.kind == cones.BOTH) & ~self._is_remote
        self.friction: FloatArray = np.where(own, layout.friction_coefficient, 0.0)
        self.is_cone = is_cone
        self._scale(problem, residual)
        self.free_velocity = self.velocity_scale * self._three(layout.pad(problem.free_velocity))

    @property
    def n_contacts(self) -> int:
        """Number of contacts."""
        return len(self.kind)

    @property
    def has_remote_bounds(self) -> bool:
        """Whether a friction law is bounded by the impulse of another contact."""
        return bool(self._is_remote.any())

    @property
    def is_remote(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which contacts have such a friction law, shape (n,)."""
        return self._is_remote

    def bounds(self, r: FloatArray) -> FloatArray:
        """Return the scaled friction bound of every contact, shape (n,), for r of shape (n, 3)."""
        bounds: FloatArray = self.fixed_bound + self.friction * r[:, 0]
        remote = np.flatnonzero(self._is_remote)
        if len(remote):
            partner = self.layout.partner[remote]
            normal = np.maximum(self.impulse_scale[partner, 0] * r[partner, 0], 0.0)
            bounds[remote] += self.layout.friction_coefficient[remote] * normal / self._bound_scale[remote]
        return bounds

    def impulses(self, r: FloatArray) -> FloatArray:
        """Return Λ [N s] over rows, shape (n_rows,), of r."""
        return self.layout.unpad(np.ascontiguousarray((self.impulse_scale * r)[:, : self.layout.width]))

    def judged(self, r: FloatArray) -> tuple[FloatArray, float]:
        """Return Λ of r and its residual in the judge's arithmetic."""
        impulses = self.impulses(r)
        return impulses, self._residual(impulses, self._problem.relative_velocity(impulses))

    def of_impulses(self, impulses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return r and û, shape (n, 3), of Λ [N s] over rows, with s = ‖û_T‖."""
        scale = np.where(self.uses, self.impulse_scale, 1.0)
        r = np.where(self.uses, self._three(self.layout.pad(impulses)) / scale, 0.0)
        velocity = self._problem.relative_velocity(impulses)
        u = self.velocity_scale * self._three(self.layout.pad(velocity))
        u[self.is_cone, 0] += tangential_lengths(u)[self.is_cone]
        return r, u

    def _three(self, padded: FloatArray) -> FloatArray:
        """Return an array over lanes with lanes of zeros up to three."""
        if padded.shape[1] == 3:
            return padded
        three = np.zeros((len(padded), 3))
        three[:, : padded.shape[1]] = padded
        return three

    def _scale(self, problem: ContactProblem, residual: Residual) -> None:
        layout = self.layout
        law = np.where(layout.normal_law >= 0, layout.normal_law, layout.friction_law)
        speed = (residual.scale if residual.scale > 0.0 else 1.0) / residual.ratios[law]
        tangential = np.where(self.is_cone, layout.friction_coefficient, 1.0)
        shape = np.column_stack([np.ones_like(tangential), tangential, tangential]) * self.uses
        alpha = layout.pad(problem.delassus_diagonal).max(axis=1, initial=0.0)
        mean = float(alpha[alpha > 0.0].mean()) if (alpha > 0.0).any() else 1.0
        stretch = np.sqrt(mean / np.where(alpha > 0.0, alpha, mean))
        self._bound_scale = speed * stretch / mean
        self.impulse_scale = self._bound_scale[:, None] * shape
        self.velocity_scale = (stretch / speed)[:, None] * shape
        self.fixed_bound: FloatArray = layout.fixed_bound / self._bound_scale


def tangential_lengths(lanes: FloatArray) -> FloatArray:
    """Return ‖x_T‖ of every contact, shape (n,), of lanes, shape (n, 3)."""
    lengths: FloatArray = np.sqrt(lanes[:, 1] ** 2 + lanes[:, 2] ** 2)
    return lengths


def _kinds(
    layout: BlockLayout, formulation: Formulation
) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], np.ndarray[tuple[int], np.dtype[np.bool_]]]:
    """Return the kind of each contact, and whether its friction is bounded by another contact's impulse."""
    own = layout.partner == np.arange(layout.n_blocks)
    mu, fixed = layout.friction_coefficient, layout.fixed_bound
    has_normal, has_friction = layout.normal_law >= 0, layout.friction_law >= 0
    is_remote = has_friction & ~own & (mu > 0.0)
    rubs = has_friction & ((mu > 0.0) | (fixed > 0.0))
    kind = np.full(layout.n_blocks, cones.IDLE, dtype=np.int64)
    kind[has_normal & ~rubs] = cones.NORMAL
    kind[has_normal & rubs] = cones.BOTH
    kind[~has_normal & rubs] = cones.DISC
    if formulation == "de_saxce":
        kind[has_normal & own & (mu > 0.0) & (fixed == 0.0)] = cones.CONE
    return kind, is_remote
