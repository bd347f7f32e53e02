"""The central path of one problem: steps along it by power series, and Newton corrections back to it.

See ``central_path`` for the definition of the path.
"""

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from . import cones
from .power_series import Direction, Series, local_product, write_lower_orders, write_right_side
from .progress import Progress
from .runs import NewtonSystem
from .scaled_problem import ScaledProblem
from .smoothing import on_manifold

STARTS = (0.1, 1.0, 10.0, 100.0)
"""Values of τ at which the first point of the path is sought, in this order."""

WARM_SHARE, MIN_WARM_TAU = 0.1, 1e-6
"""From a given Λ, the first search is at τ = share × its residual, at most the share and at least the minimum."""

CLOSE, LOOSE = 0.1, 1.0
"""R_p relative to τ at which corrections end, and the largest one that is accepted at the end of a series."""

ROUNDING = 1e-14
"""Rounding error of R_p, relative to the largest scaled impulse, or to 1 if that is larger."""

FIRST_STEPS, FURTHER_STEPS = 30, 3
"""Largest number of Newton steps of the first correction, and of corrections after a series."""

MIN_STEP = 1.0 / 32.0
"""The smallest fraction of a Newton step in the first correction."""

ACCURACY = 1e-2
"""ε, the largest size of the term of the last order of a series, relative to that of the first order."""

MAX_RANGE = 3.0
"""Largest range of a series, relative to √(2n) for n cones."""

MAX_SHORTENINGS, SHORTENING = 20, 0.6
"""Largest number of ranges of a series that are tried, and the factor from one to the next."""

MAX_RETRIES, RETRY_SHARE = 6, 0.3
"""Largest number of end points of a series that are corrected, and the factor of the length after each failure."""

MIN_TAU_RATIO = 1e-3
"""Smallest ratio of τ at the end of a series to τ at its beginning."""

MIN_TAU, MAX_TAU = 1e-20, 1e4
"""Limits of τ within which the path is followed."""


class Point:
    """A point of the manifold r∘û = τ e, and its distance from the path, the largest entry of R_p."""

    def __init__(self, scaled_problem: ScaledProblem, system: NewtonSystem, v: FloatArray, tau: float) -> None:
        self.v, self.tau = v, tau
        self.r, self.u, self.s = on_manifold(
            scaled_problem.kind, scaled_problem.fixed_bound, scaled_problem.friction, tau, v
        )
        lift = np.where(scaled_problem.is_cone, self.s, 0.0)
        self.primal = self.u - system.times(self.r) - scaled_problem.free_velocity
        self.primal[:, 0] -= lift
        self.primal[~scaled_problem.uses] = 0.0
        self.distance = float(np.abs(self.primal).max(initial=0.0))
        largest = float(np.abs(self.r).max(initial=1.0))
        self.is_finite = bool(np.isfinite(self.distance) and np.isfinite(largest))
        self._rounding = ROUNDING * max(1.0, largest)

    def is_within(self, share: float) -> bool:
        """Whether R_p is at most ``share`` times τ, up to rounding."""
        return self.is_finite and self.distance <= share * self.tau + self._rounding


class FollowedPath:
    """The path of one problem, which several solves may follow."""

    def __init__(self, scaled_problem: ScaledProblem, system: NewtonSystem, order: int, progress: Progress) -> None:
        self._scaled_problem, self._system, self._order = scaled_problem, system, order
        self._progress, n, width = progress, scaled_problem.n_cones, scaled_problem.lanes.width
        self._full_shares = np.ones(n)
        self._matrices, self._coupled = np.zeros((n, width, width)), np.empty((n, width, width))
        self._shifts, self._right = np.zeros((n, width)), np.zeros((n, width))
        self._linearised, self._reduced = (self._matrices, self._shifts), (self._coupled, self._right)
        self._complementarity_terms, self._lift_terms = np.zeros((n, width + 1)), np.zeros(n)
        self._p, self._q = np.empty((n, width)), np.empty((n, width))
        self._point: Point
        self._tangent: Direction | None = None

    def resume(self, progress: Progress) -> None:
        """Follow the path from the last point, or find a first one, until ``progress`` has an outcome."""
        self._progress = progress
        if self._tangent is None:
            self.find(progress.best)
        else:
            self._point = self._correct_across(self._point)
        self.follow()

    def follow(self) -> None:
        """Follow the path until the progress has an outcome."""
        while self._progress.outcome is None:
            self.advance()

    def find(self, first: FloatArray) -> None:
        """Find a point of the path from Λ = ``first``, shape (n_rows,)."""
        starts: tuple[float, ...] = STARTS
        r, u = self._scaled_problem.of_impulses(first)
        v = r - u if np.any(first) else np.zeros_like(r)
        if np.any(first):
            starts = (max(WARM_SHARE * min(self._progress.best_residual, 1.0), MIN_WARM_TAU), *STARTS)
        for tau in starts:
            self._point = self._correct(Point(self._scaled_problem, self._system, v, tau))
            if self._progress.outcome is not None or self._point.is_within(CLOSE):
                return
            v = np.zeros_like(v)
        self._progress.end(Status.STALLED, f"no point of the path was found, best residual {self._best_residual_text}")

    def advance(self) -> None:
        """Follow one series, and correct its end."""
        point = self._point
        if point.tau > MAX_TAU:
            self._progress.end(
                Status.DIVERGED, f"the path leads away from the solution, best residual {self._best_residual_text}"
            )
            return
        if point.tau < MIN_TAU:
            self._progress.end(Status.STALLED, f"the path ends at tau = 0, best residual {self._best_residual_text}")
            return
        if not self._factorise(point):
            return
        self._tangent = self._oriented_tangent(point)
        series = self._series(point, self._tangent)
        reach = self._range(series)
        for _ in range(MAX_RETRIES):
            end = self._end_of(series, point, reach)
            if end is None:
                break
            end_point, length = end
            self._record(end_point)
            corrected = self._correct_across(end_point)
            if corrected.is_within(LOOSE):
                self._point = corrected
            if self._point is corrected or self._progress.outcome is not None:
                return
            reach = RETRY_SHARE * length
        self._progress.end(
            Status.STALLED, f"the path cannot be followed further, best residual {self._best_residual_text}"
        )

    @property
    def _best_residual_text(self) -> str:
        return f"{self._progress.best_residual:.1e}"

    def _record(self, point: Point) -> None:
        self._progress.record(*self._scaled_problem.judged(point.r))
        self._progress.check_feasibility(point.r)

    def _factorise(self, point: Point) -> bool:
        """Linearise at a point and factorise; return whether the factorisation succeeded."""
        scaled_problem, kind = self._scaled_problem, self._scaled_problem.kind
        cones.write_pairs(kind, scaled_problem.bounds(point.r), point.r, point.u, point.s, self._p, self._q)
        self._complementarity_terms[:] = 0.0
        cones.linearise(kind, self._p, self._q, point.tau, self._complementarity_terms, *self._linearised)
        laws = (kind, scaled_problem.friction, self._full_shares)
        cones.couple(*laws, point.r, point.u, *self._linearised, point.tau, self._complementarity_terms, *self._reduced)
        self._factorised_point = point
        return self._progress.factorise(lambda: self._system.factorise(self._coupled))

    def _tau_right_side(self) -> FloatArray:
        """Return the right-hand side of complementarity for dτ = τ."""
        complementarity_terms = np.zeros_like(self._complementarity_terms)
        complementarity_terms[:, 0] = complementarity_terms[:, -1] = self._factorised_point.tau
        return complementarity_terms

    def _solve(
        self,
        complementarity_terms: FloatArray,
        lift_terms: FloatArray,
        primal: FloatArray | None = None,
        refinements: int = 1,
    ) -> Direction:
        """Return the solution of the linear system at the factorised point, with zero change of τ."""
        scaled_problem, point = self._scaled_problem, self._factorised_point
        write_right_side(
            scaled_problem.kind, self._p, point.r, point.u, complementarity_terms, lift_terms, self._shifts, self._right
        )
        total = self._right if primal is None else self._right + primal
        dr = np.where(
            scaled_problem.uses, self._system.solve(np.where(scaled_problem.uses, total, 0.0), refinements), 0.0
        )
        du, ds = np.empty_like(dr), np.empty(len(dr))
        laws = (scaled_problem.kind, scaled_problem.friction, self._full_shares)
        cones.write_changes(*laws, point.u, *self._linearised, *self._reduced, -lift_terms, dr, du, ds)
        return Direction(dr, du, ds, 0.0)

    def _product(self, x: Direction, y: Direction) -> float:
        """Return ⟨x, y⟩ (``power_series``) in the metric of the factorised point."""
        scaled_problem, point = self._scaled_problem, self._factorised_point
        inner = local_product(
            scaled_problem.kind,
            scaled_problem.friction,
            self._p,
            self._q,
            point.r,
            point.u,
            x.r,
            x.u,
            x.s,
            y.r,
            y.u,
            y.s,
        )
        return float(inner) + float(x.tau) * float(y.tau)  # NumPy scalars would warn if the path overflows

    def _oriented_tangent(self, point: Point) -> Direction:
        """Return the forward unit tangent: τ decreases if det (Ĝ + D) > 0, as at the start; otherwise it increases."""
        along = self._solve(self._tau_right_side(), np.zeros_like(point.s))
        tangent = Direction(along.r, along.u, along.s, 1.0)
        length = np.sqrt(max(self._product(tangent, tangent), 1e-300))
        return tangent.times(-self._system.determinant_sign() / length)

    def _series(self, point: Point, tangent: Direction) -> Series:
        """Return the power series from ``point`` whose first-order term is the unit ``tangent``."""
        scaled_problem = self._scaled_problem
        series = Series(self._order, point.r, point.u, point.s)
        series.put(1, tangent)
        for order in range(2, self._order + 1):
            write_lower_orders(
                scaled_problem.kind,
                scaled_problem.friction,
                series.r,
                series.u,
                series.s,
                order,
                self._complementarity_terms,
                self._lift_terms,
            )
            particular = self._solve(self._complementarity_terms, self._lift_terms, refinements=0)
            series.put(order, particular.plus(-self._product(tangent, particular), tangent))
        return series

    def _range(self, series: Series) -> float:
        """Return the length within which a series approximates the path."""
        longest = MAX_RANGE * np.sqrt(2.0 * max(series.s.shape[1], 1))
        last = Direction(series.r[-1], series.u[-1], series.s[-1], series.tau[-1])
        size = np.sqrt(max(self._product(last, last), 0.0))
        if not np.isfinite(size):
            return 0.0
        return float(min(longest, (ACCURACY / size) ** (1.0 / (self._order - 1)))) if size > 0.0 else longest

    def _end_of(self, series: Series, point: Point, reach: float) -> tuple[Point, float] | None:
        """Return an end point of a series, within ``reach`` and close to the path, and the length to it; else None."""
        for _ in range(MAX_SHORTENINGS):
            if not series.tau_at(reach) > MIN_TAU_RATIO:
                reach = _last_above(series, MIN_TAU_RATIO, reach)
            tau = series.tau_at(reach) * point.tau
            end_point = Point(self._scaled_problem, self._system, series.manifold_vector(reach), tau)
            if end_point.is_within(LOOSE):
                return end_point, reach
            reach *= SHORTENING
        return None

    def _correct(self, point: Point, max_steps: int = FIRST_STEPS) -> Point:
        """Return the point after Newton steps at fixed τ; a step is shortened if R_p does not decrease."""
        for _ in range(max_steps):
            if point.is_within(CLOSE) or self._progress.outcome is not None or not self._factorise(point):
                break
            step = self._solve(self._complementarity_terms * 0.0, self._lift_terms * 0.0, point.primal, 2)
            fraction, change = 1.0, step.r - step.u
            candidate = Point(self._scaled_problem, self._system, point.v + change, point.tau)
            while not candidate.distance < point.distance and fraction > MIN_STEP:
                fraction *= 0.5
                candidate = Point(self._scaled_problem, self._system, point.v + fraction * change, point.tau)
            if not candidate.is_finite:
                break
            point = candidate
            self._record(point)
        return point

    def _correct_across(self, point: Point) -> Point:
        """Return the point after Newton steps in the plane normal to the last tangent, where τ may change."""
        assert self._tangent is not None
        for _ in range(FURTHER_STEPS):
            if point.is_within(CLOSE) or self._progress.outcome is not None or not self._factorise(point):
                break
            newton = self._solve(self._complementarity_terms * 0.0, self._lift_terms * 0.0, point.primal, 2)
            along = self._solve(self._tau_right_side(), self._lift_terms * 0.0)
            along = Direction(along.r, along.u, along.s, 1.0)
            slope = self._product(self._tangent, along)
            share = -self._product(self._tangent, newton) / slope if abs(slope) > 0.0 else 0.0
            share = float(np.clip(share, -2.0, 2.0)) if np.isfinite(share) else 0.0
            change = newton.plus(share, along)
            candidate = Point(
                self._scaled_problem, self._system, point.v + change.r - change.u, point.tau * float(np.exp(share))
            )
            if not candidate.is_finite:
                break
            point = candidate
            self._record(point)
        return point


def _last_above(series: Series, floor: float, reach: float) -> float:
    """Return, by bisection, the largest a below ``reach`` with τ(a)/τ₀ above ``floor``."""
    low, high = 0.0, reach
    for _ in range(40):
        middle = 0.5 * (low + high)
        if series.tau_at(middle) > floor:
            low = middle
        else:
            high = middle
    return low
