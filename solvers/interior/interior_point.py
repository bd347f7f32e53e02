"""InteriorPoint: Newton's method inside the friction cones, with De Saxcé's term as an unknown.

With u = ξ + μ‖ξ_T‖ e_N for each contact, Coulomb's law is K_μ ∋ Λ ⟂ u ∈ K_μ* (De Saxcé & Feng 1998). In the units of
``scaled_problem``, both cones are the second-order cone. With s = ‖û_T‖ as a separate unknown, the equations are

    R_p = û − Ĝr − ĉ − s e_N = 0,      R_s = s − ‖û_T‖ = 0,      r ∘ û = τ e,      τ → 0

(Acary, Armand, Nguyen & Shpakovych, Optimization Methods and Software 39(3), 2024). For fixed s this is the central
path of a convex cone program. A step has two parts, which share one factorisation of Ĝ + D with block-diagonal D
(``cones``):

    affine      towards τ = 0, with the step length α_a that the cones allow and τ_a at its end
    combined    towards στ, σ = σ₀ min(1, (τ_a/τ)^β), β = max(1, 3α_a²), with Mehrotra's second-order term if σ < ¼

If ‖R_s‖ > ‖r∘û‖, the step has one part, towards σ₀τ. The step length is the same for all contacts.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from . import cones
from .progress import Progress
from .runs import InteriorMethod, NewtonSystem, PreparedRuns
from .scaled_problem import ScaledProblem, tangential_lengths
from .smoothing import on_manifold
from .systems.delassus_system import REFINEMENTS

START, START_TANGENT = 1.0, 0.1
"""r_N = û_N and û_T of each contact at the start from zero, in scaled units; r_T is û_T times the friction bound."""

CENTRING = 0.499
"""σ₀, the largest σ."""

SECOND_ORDER = 0.25
"""Mehrotra's second-order term is used below this σ."""

BASE_FRACTION, FURTHER_FRACTION = 0.9, 0.09
"""A step covers this fraction of the distance to the boundary: the first number + the second × the last step length."""

REFINED_RESIDUAL = 1e-5
"""Residual below which directions are refined; above it, directions are accurate enough without refinement."""

WARM_SHARE, MIN_WARM_TAU, MAX_WARM_TAU = 0.1, 1e-8, 0.5
"""A solve from a given Λ begins at τ = share × its residual, within these limits."""


@dataclass(frozen=True)
class InteriorPoint(InteriorMethod):
    """A primal-dual interior point method for exact Coulomb friction; one iteration is one Newton step.

    Attributes:
        form: "delassus" factorises over contacts with the assembled G, "factors" over bodies with W and M⁻¹.

    Raises:
        SolverError: if the form is unknown.
    """

    form: Literal["delassus", "factors"] = "delassus"

    def run(self, prepared: PreparedRuns, progress: Progress) -> None:
        """Do Newton steps until ``progress`` has an outcome."""
        iterate = _Iterate(prepared.scaled_problem, prepared.system, progress.best, progress.best_residual)
        while progress.outcome is None:
            iterate.step(progress)
            progress.check_gain()


class _Iterate:
    """r, û and s of one solve, strictly inside the cones."""

    def __init__(self, scaled_problem: ScaledProblem, system: NewtonSystem, first: FloatArray, residual: float) -> None:
        self._scaled_problem, self._system = scaled_problem, system
        n, width = self._scaled_problem.uses.shape
        self._kind, self._friction = self._scaled_problem.kind, self._scaled_problem.friction
        # the matrix of a step treats a bound as constant if another contact determines it
        self._share = np.where(self._scaled_problem.is_remote, 0.0, 1.0)
        self._step_length, self._refinements = 1.0, 0
        self._matrices, self._coupled = np.zeros((n, width, width)), np.empty((n, width, width))
        self._shifts, self._second = np.zeros((n, width)), np.zeros((n, width + 1))
        self._p, self._q, self._right = np.empty((n, width)), np.empty((n, width)), np.empty((n, width))
        self._du, self._ds = np.empty((n, width)), np.empty(n)
        self._laws = (self._kind, self._friction, self._share)
        self._linearised, self._reduced = (self._matrices, self._shifts), (self._coupled, self._right)
        if np.any(first):
            tau = float(np.clip(WARM_SHARE * residual, MIN_WARM_TAU, MAX_WARM_TAU))
            r, u = self._scaled_problem.of_impulses(first)
            bound = self._scaled_problem.bounds(np.maximum(r, 0.0))
            fixed_bound = np.maximum(bound - self._friction * np.maximum(r[:, 0], 0.0), tau)
            self._r, self._u, self._s = on_manifold(self._kind, fixed_bound, self._friction, tau, r - u)
        else:
            self._start_cold()
        self._keep_inside()

    def _start_cold(self) -> None:
        kind, uses = self._kind, self._scaled_problem.uses
        has_friction = kind >= cones.CONE
        self._r, self._u = np.zeros(uses.shape), np.zeros(uses.shape)
        has_normal = (kind == cones.NORMAL) | (kind == cones.CONE) | (kind == cones.BOTH)
        self._r[has_normal, 0] = self._u[has_normal, 0] = START
        self._u[:, 1:] = np.where(uses[:, 1:] & has_friction[:, None], START_TANGENT, 0.0)
        bound = np.where(kind == cones.CONE, START, self._scaled_problem.bounds(self._r))
        self._r[:, 1:] = self._u[:, 1:] * bound[:, None]
        self._s = np.where(kind == cones.CONE, tangential_lengths(self._u), START)

    def _keep_inside(self) -> None:
        self._scaled_problem.lanes.equalise_normals(self._r)
        cones.keep_inside(self._kind, self._scaled_problem.bounds(self._r), self._r, self._u, self._s)

    def step(self, progress: Progress) -> None:
        """Do one Newton step."""
        scaled_problem, kind = self._scaled_problem, self._kind
        self._bound = scaled_problem.bounds(self._r)
        cones.write_pairs(kind, self._bound, self._r, self._u, self._s, self._p, self._q)
        tau, norm = cones.complementarity(kind, self._p, self._q, self._r, self._u)
        self._lag = np.where(scaled_problem.is_cone, self._s - tangential_lengths(self._u), 0.0)
        self._primal = self._u - self._system.times(self._r) - scaled_problem.free_velocity
        self._primal[:, 0] += np.where(scaled_problem.is_cone, self._lag - self._s, 0.0)  # R_p + R_s e_N
        self._refinements = REFINEMENTS if progress.best_residual <= REFINED_RESIDUAL else 0
        dr = self._combined_step(tau, bool(np.linalg.norm(self._lag) > norm), progress)
        if dr is None:
            return
        longest = self._longest_step(dr)
        self._step_length = min(1.0, (BASE_FRACTION + FURTHER_FRACTION * self._step_length) * longest)
        self._r, self._u = self._r + self._step_length * dr, self._u + self._step_length * self._du
        self._s = self._s + self._step_length * self._ds
        self._keep_inside()
        progress.record(*scaled_problem.judged(self._r), self._step_length)
        progress.check_feasibility(self._r)

    def _combined_step(self, tau: float, has_large_lag: bool, progress: Progress) -> FloatArray | None:
        """Return dr of the combined step and store dû and ds; return None if there is no step.

        ``has_large_lag`` means that ‖R_s‖ > ‖r∘û‖, so that the step has one part.
        """
        self._second[:] = 0.0
        sigma = CENTRING
        self._linearise(CENTRING * tau if has_large_lag else 0.0)
        if not progress.factorise(lambda: self._system.factorise(self._coupled)):
            return None
        dr = self._solve()
        if not has_large_lag and np.isfinite(dr).all():
            fraction = min(1.0, self._longest_step(dr))
            tau_ratio = max(self._tau_at(dr, fraction) / tau, 0.0) if tau > 0.0 else 0.0
            sigma = CENTRING * min(1.0, tau_ratio ** max(1.0, 3.0 * fraction**2))
            if sigma < SECOND_ORDER:
                cones.write_second_order(self._kind, self._friction, dr, self._du, self._ds, self._second)
            self._linearise(sigma * tau)
            dr = self._solve()
        if not (np.isfinite(dr).all() and np.isfinite(self._du).all()):
            progress.end(Status.STALLED, f"the Newton system is singular at residual {progress.best_residual:.1e}")
            return None
        return dr

    def _linearise(self, target: float) -> None:
        """Linearise complementarity towards ``target`` = στ, and couple the lanes of each contact."""
        cones.linearise(self._kind, self._p, self._q, target, self._second, *self._linearised)
        cones.couple(*self._laws, self._r, self._u, *self._linearised, target, self._second, *self._reduced)

    def _solve(self) -> FloatArray:
        """Return dr of the linearised equations, and store dû and ds."""
        uses = self._scaled_problem.uses
        right = np.where(uses, self._right + self._primal, 0.0)
        dr = np.where(uses, self._system.solve(right, self._refinements), 0.0)
        cones.write_changes(*self._laws, self._u, *self._linearised, *self._reduced, self._lag, dr, self._du, self._ds)
        return dr

    def _longest_step(self, dr: FloatArray) -> float:
        return float(
            cones.longest_steps(self._kind, self._friction, self._p, self._q, self._r, self._u, dr, self._du, self._ds)
        )

    def _tau_at(self, dr: FloatArray, fraction: float) -> float:
        """Return τ after a step of length ``fraction``."""
        r, u, s = self._r + fraction * dr, self._u + fraction * self._du, self._s + fraction * self._ds
        p, q = np.empty_like(r), np.empty_like(u)
        cones.write_pairs(self._kind, self._scaled_problem.bounds(r), r, u, s, p, q)
        return float(cones.complementarity(self._kind, p, q, r, u)[0])
