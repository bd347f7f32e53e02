"""The path of one solve: a point on it, the way to the next by power series, and the corrections in between.

See ``central_path`` for what it is a path of.
"""

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from . import cones
from .interior_point import NewtonSystem
from .power_series import Direction, Series, local_product, products, write_right
from .progress import Progress
from .scaled_problem import ScaledProblem
from .smoothing import on_manifold

STARTS = (0.1, 1.0, 10.0, 100.0)
"""τ at which the path is looked for, one after the other."""

WARM_SHARE, LEAST_WARM = 0.1, 1e-6
"""From a given Λ it is looked for first at τ = share × its residual, at least the other."""

CLOSE, LOOSE = 0.1, 1.0
"""R_p relative to τ that a correction has to reach, and that the end of a series may have."""

ROUNDING = 1e-14
"""What rounding leaves in R_p, relative to the largest scaled impulse or 1."""

FIRST_STEPS, FURTHER_STEPS = 30, 3
"""Newton steps of the first correction, and of those after a series."""

SHORTEST_SEARCH = 1.0 / 32.0
"""The shortest part of a step of the first correction."""

ACCURACY = 1e-2
"""ε, what the last order of a series may grow to beside the first."""

LONGEST = 3.0
"""Longest range of a series, times √(2n)."""

TRIES, SHORTER = 20, 0.6
"""How often a range is shortened, and by what."""

RETURNS, RETURN_SHARE = 6, 0.3
"""How often a series is begun again because its end could not be corrected, and how far it goes then."""

DROP = 1e-3
"""τ falls by no more than this factor within a series."""

LEAST_TAU, LARGEST_TAU = 1e-20, 1e4
"""Where the path is followed no further."""


class Point:
    """A point of the manifold r∘û = τ e, and how far it is from the path."""

    def __init__(self, scaled: ScaledProblem, system: NewtonSystem, v: FloatArray, tau: float) -> None:
        self.v, self.tau = v, tau
        self.r, self.u, self.s = on_manifold(scaled.kind, scaled.fixed_bound, scaled.friction, tau, v)
        lift = np.where(scaled.is_cone, self.s, 0.0)
        self.primal = self.u - system.times(self.r) - scaled.free_velocity
        self.primal[:, 0] -= lift
        self.primal[~scaled.uses] = 0.0
        self.distance = float(np.abs(self.primal).max(initial=0.0))
        largest = float(np.abs(self.r).max(initial=1.0))
        self.is_finite = bool(np.isfinite(self.distance) and np.isfinite(largest))
        self._rounding = ROUNDING * max(1.0, largest)

    def is_within(self, share: float) -> bool:
        """Whether R_p is at most that share of τ, or what rounding leaves."""
        return self.is_finite and self.distance <= share * self.tau + self._rounding


class FollowedPath:
    """The path of one solve."""

    def __init__(self, scaled: ScaledProblem, system: NewtonSystem, order: int, progress: Progress) -> None:
        self._scaled, self._system, self._order = scaled, system, order
        self._progress, n, width = progress, scaled.n_cones, scaled.lanes.width
        self._full, self._none = np.ones(n), np.zeros(n)
        self._matrices, self._coupled = np.zeros((n, width, width)), np.empty((n, width, width))
        self._shifts, self._right = np.zeros((n, width)), np.zeros((n, width))
        self._heads, self._lifts = np.zeros((n, width + 1)), np.zeros(n)
        self._p, self._q = np.empty((n, width)), np.empty((n, width))
        self._point: Point
        self._tangent: Direction | None = None

    def go_on(self, progress: Progress) -> None:
        """Follow the path until ``progress`` has ended, from where it was left or else is found."""
        self._progress = progress
        if self._tangent is None:
            self.begin(progress.best)
        else:
            self._point = self._corrected_across(self._point)
        self.follow()

    def follow(self) -> None:
        """Go on until the progress has ended."""
        while self._progress.ended is None:
            self.advance()

    def begin(self, first: FloatArray) -> None:
        """Find a point of the path from Λ = ``first``, shape (n_rows,)."""
        starts: tuple[float, ...] = STARTS
        r, u = self._scaled.of_impulses(first)
        v = r - u if np.any(first) else np.zeros_like(r)
        if np.any(first):
            starts = (max(WARM_SHARE * min(self._progress.best_residual, 1.0), LEAST_WARM), *STARTS)
        for tau in starts:
            self._point = self._corrected(Point(self._scaled, self._system, v, tau))
            if self._progress.ended is not None or self._point.is_within(CLOSE):
                return
            v = np.zeros_like(v)
        self._progress.end(Status.STALLED, f"no point of the path was found, residual {self._reached}")

    def advance(self) -> None:
        """Follow one series, and come back to the path."""
        point = self._point
        if point.tau > LARGEST_TAU:
            self._progress.end(Status.DIVERGED, f"the path leads away from the answer, best residual {self._reached}")
            return
        if point.tau < LEAST_TAU:
            self._progress.end(Status.STALLED, f"the path ends at tau = 0, best residual {self._reached}")
            return
        if not self._factorised(point):
            return
        self._tangent = self._oriented(point)
        series = self._series(point, self._tangent)
        reach = self._range(series)
        for _ in range(RETURNS):
            following = self._end_of(series, point, reach)
            if following is None:
                break
            self._arrive(following[0])
            found = self._corrected_across(following[0])
            if found.is_within(LOOSE):
                self._point = found
            if self._point is found or self._progress.ended is not None:
                return
            reach = RETURN_SHARE * following[1]
        self._progress.end(Status.STALLED, f"the path cannot be followed further, best residual {self._reached}")

    @property
    def _reached(self) -> str:
        return f"{self._progress.best_residual:.1e}"

    def _arrive(self, point: Point) -> None:
        self._progress.arrive(*self._scaled.judged(point.r))
        self._progress.look_for_proof(point.r)

    def _factorised(self, point: Point) -> bool:
        """Linearise at a point and factorise; say whether there are factors."""
        scaled, kind = self._scaled, self._scaled.kind
        cones.write_pairs(kind, scaled.bounds(point.r), point.r, point.u, point.s, self._p, self._q)
        self._heads[:] = 0.0
        cones.linearise_plainly(kind, self._p, self._q, point.tau, self._heads, self._matrices, self._shifts)
        cones.couple(
            kind,
            scaled.friction,
            self._full,
            point.r,
            point.u,
            self._matrices,
            self._shifts,
            point.tau,
            self._heads,
            self._coupled,
            self._right,
        )
        self._at = point
        return self._progress.factorised(lambda: self._system.factorise(self._coupled))

    def _towards_tau(self) -> FloatArray:
        """Return the right side of complementarity for τ growing by its own size."""
        heads = np.zeros_like(self._heads)
        heads[:, 0] = heads[:, -1] = self._at.tau
        return heads

    def _solved(
        self, heads: FloatArray, lifts: FloatArray, primal: FloatArray | None = None, refinements: int = 1
    ) -> Direction:
        """Return the direction of the linear system at the factorised point, its part in τ left at 0."""
        scaled, point = self._scaled, self._at
        write_right(scaled.kind, self._p, point.r, point.u, heads, lifts, self._shifts, self._right)
        total = self._right if primal is None else self._right + primal
        dr = np.where(scaled.uses, self._system.solve(np.where(scaled.uses, total, 0.0), refinements), 0.0)
        du, ds = np.empty_like(dr), np.empty(len(dr))
        cones.follow(
            scaled.kind,
            scaled.friction,
            self._full,
            point.u,
            self._matrices,
            self._shifts,
            self._coupled,
            self._right,
            -lifts,
            dr,
            du,
            ds,
        )
        return Direction(dr, du, ds, 0.0)

    def _product(self, x: Direction, y: Direction) -> float:
        scaled, point = self._scaled, self._at
        inner = local_product(
            scaled.kind,
            scaled.friction,
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
        return float(inner) + x.tau * y.tau

    def _oriented(self, point: Point) -> Direction:
        """Return the unit tangent that goes on: τ falls where det (Ĝ + D) > 0, as at the beginning, else it rises."""
        along = self._solved(self._towards_tau(), np.zeros_like(point.s))
        tangent = Direction(along.r, along.u, along.s, 1.0)
        length = np.sqrt(max(self._product(tangent, tangent), 1e-300))
        return tangent.times(-self._system.determinant_sign() / length)

    def _series(self, point: Point, tangent: Direction) -> Series:
        scaled = self._scaled
        series = Series(self._order, point.r, point.u, point.s)
        series.put(1, tangent)
        for order in range(2, self._order + 1):
            products(scaled.kind, scaled.friction, series.r, series.u, series.s, order, self._heads, self._lifts)
            particular = self._solved(self._heads, self._lifts, refinements=0)
            series.put(order, particular.plus(-self._product(tangent, particular), tangent))
        return series

    def _range(self, series: Series) -> float:
        """Return the length within which a series is taken for the path."""
        longest = LONGEST * np.sqrt(2.0 * max(series.s.shape[1], 1))
        last = Direction(series.r[-1], series.u[-1], series.s[-1], series.tau[-1])
        size = np.sqrt(max(self._product(last, last), 0.0))
        if not np.isfinite(size):
            return 0.0
        return float(min(longest, (ACCURACY / size) ** (1.0 / (self._order - 1)))) if size > 0.0 else longest

    def _end_of(self, series: Series, point: Point, reach: float) -> tuple[Point, float] | None:
        """Return the point at the end of a series within ``reach``, and its length; None if that is its beginning."""
        for _ in range(TRIES):
            if not series.tau_at(reach) > DROP:
                reach = _last_above(series, DROP, reach)
            found = Point(self._scaled, self._system, series.manifold_vector(reach), series.tau_at(reach) * point.tau)
            if found.is_within(LOOSE):
                return found, reach
            reach *= SHORTER
        return None

    def _corrected(self, point: Point, most_steps: int = FIRST_STEPS) -> Point:
        """Return the point after Newton steps at fixed τ, shortened where R_p does not fall."""
        for _ in range(most_steps):
            if point.is_within(CLOSE) or self._progress.ended is not None or not self._factorised(point):
                break
            step = self._solved(self._heads * 0.0, self._lifts * 0.0, point.primal, 2)
            part, change = 1.0, step.r - step.u
            following = Point(self._scaled, self._system, point.v + change, point.tau)
            while not following.distance < point.distance and part > SHORTEST_SEARCH:
                part *= 0.5
                following = Point(self._scaled, self._system, point.v + part * change, point.tau)
            if not following.is_finite:
                break
            point = following
            self._arrive(point)
        return point

    def _corrected_across(self, point: Point) -> Point:
        """Return the point after Newton steps in the plane across the last tangent, where τ may change."""
        assert self._tangent is not None
        for _ in range(FURTHER_STEPS):
            if point.is_within(CLOSE) or self._progress.ended is not None or not self._factorised(point):
                break
            newton = self._solved(self._heads * 0.0, self._lifts * 0.0, point.primal, 2)
            along = self._solved(self._towards_tau(), self._lifts * 0.0)
            along = Direction(along.r, along.u, along.s, 1.0)
            across = self._product(self._tangent, along)
            share = -self._product(self._tangent, newton) / across if abs(across) > 0.0 else 0.0
            share = float(np.clip(share, -2.0, 2.0)) if np.isfinite(share) else 0.0
            change = newton.plus(share, along)
            following = Point(
                self._scaled, self._system, point.v + change.r - change.u, point.tau * float(np.exp(share))
            )
            if not following.is_finite:
                break
            point = following
            self._arrive(point)
        return point


def _last_above(series: Series, floor: float, reach: float) -> float:
    """Return about the largest a below ``reach`` with τ(a)/τ₀ above ``floor``."""
    low, high = 0.0, reach
    for _ in range(40):
        middle = 0.5 * (low + high)
        if series.tau_at(middle) > floor:
            low = middle
        else:
            high = middle
    return low
