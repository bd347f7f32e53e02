"""Violations of the laws of a contact problem by impulses, under Coulomb friction and other models.

With α_i, R_i and ℓ_i as in ``judge``, the violation of law i is the velocity ℓ_i α_i ‖R_i‖ [m/s]. Solvers stop on the
largest violation relative to the free velocity of its component. ``Residual`` does the work that does not depend on the
impulses.

Rounding must not hide a violation, so numbers that may be huge and equal are not subtracted. With h = αΛ and b = α
times the friction bound,

    unilateral:                         α R = min(h, ξ),
    friction that sticks, ‖h − ξ‖ ≤ b:  α R = ξ,
    friction that slides:               α R = h − b (h − ξ)/‖h − ξ‖.

The first two cases have the relative error of ξ, which ``matrices.accurate`` bounds. In the third case h and the
projection may cancel. I − prox and prox are nonexpansive, so rounding of h contributes u‖h‖ and that of h − ξ
contributes ub. The bound, the norm, their quotient and the product have eight roundings, which gives 9ub + u‖h‖ in all.
This is at most u√(90b² + 10‖h‖²), with equality for ‖h‖ = b. The returned violation is at least as large, so the exact
one is at most twice the returned value, up to a relative error of a few u. The third case applies unless ‖h − ξ‖ is
below b by more than rounding.
"""

from functools import cached_property

import numpy as np
from numba import njit, uint64

from ..arrays import FloatArray, IntArray
from ..compilation.interpretation import interpretable
from ..engine_model import EngineModel, own_residual
from ..errors import ProblemError
from .answer import ratio
from .coupling import components, write_scales_and_ratios
from .laws import BALL, HALF_LINE
from .model import Model
from .problem import ContactProblem
from .projections import onto_contact_cones, onto_polygon
from .transformations import in_units

UNIT = 2.0**-53
"""Unit roundoff u."""

INSIDE = 1.0 - 2.0**-48
"""Fraction of b² below which ‖h − ξ‖² is less than b² despite rounding."""

PROJECTION_ROUNDINGS = 8.0
"""Number of roundings of ‖h‖ in a projection onto a cone or a polygon."""

RESOLUTION = 200.0 * UNIT
"""Factor of G_hh |Λ_h| in ``Residual.rounding``."""

MIN_SQUARED, MAX_SQUARED = 1e-100, 1e100
"""Velocities [m/s] in this range are squared without scaling."""


class Residual:
    """The judge's residual of one problem, prepared once for many vectors of impulses; solvers use it to stop.

    Attributes:
        alpha: α_i of each law [1/kg], shape (n_laws,); for a unilateral law with α = 0, that of its friction laws.
        lengths: ℓ_i = √(α_N/α_i) [m] of each rolling law, 1 for the others, shape (n_laws,).
        speeds: ℓ_i ‖c_i‖ of each law [m/s], shape (n_laws,).
        scale: max ℓ_i ‖c_i‖ over the laws [m/s], independent of the choice of tangents.
        ratios: ``scale`` divided by the scale of each law's component, shape (n_laws,).
        stuck_law: index of a unilateral law with α_i = 0 and c_i < 0, or of a bilateral one with α_i = 0 and c_i ≠ 0;
            −1 for none.
        infeasible: whether there is a stuck law.
        unit: power of two by which impulses and velocities are multiplied if their squares would leave the range of
            double precision, else 1.
    """

    def __init__(self, problem: ContactProblem) -> None:
        laws = problem.laws
        self._law_values = np.empty((5, laws.n_laws))
        self.alpha, self.lengths, self.speeds, self.ratios, self._squares = self._law_values
        self._diagonal = problem.delassus_diagonal
        self._contacts, self._layout = components(problem), problem.layout
        law_arrays = laws.sets, laws.row_count, laws.is_rolling, laws.first_row, laws.partner
        contact_arrays = self._contacts, self._layout.slot, self._layout.width
        self.stuck_law, scale = write_scales_and_ratios(
            *law_arrays, self._diagonal, problem.free_velocity, *contact_arrays, self._law_values
        )
        self.scale = float(scale)
        self.infeasible = self.stuck_law >= 0
        self.unit = _unit(self.scale)
        self._scale = self.unit * self.scale
        fixed_bound = laws.fixed_bound if self.unit == 1.0 else self.unit * laws.fixed_bound
        self._rows, self._bounds = (laws.sets, laws.row_count, laws.first_row), (laws.friction_coefficient, fixed_bound)
        self._partner = laws.partner

    @cached_property
    def components(self) -> IntArray:
        """The connected component of each law, shape (n_laws,)."""
        return self._contacts[self._layout.contact_of_row[self._rows[2]]]

    def largest_diagonal_term(self, impulses: FloatArray) -> float:
        """Return the largest G_hh |Λ_h| over all rows h, each times ratio and length of its law [m/s]."""
        _, row_count, first_row = self._rows
        return float(
            find_largest_diagonal_term(row_count, first_row, self.ratios, self.lengths, self._diagonal, impulses)
        )

    def rounding(self, impulses: FloatArray) -> float:
        """Return an estimate of the residual that plain arithmetic cannot distinguish from zero at Λ [N s], (n_rows,).

        It is the effect on ξ of rounding Λ and a few hundred terms of its size.
        """
        return RESOLUTION * self.largest_diagonal_term(impulses) / self.scale if self.scale > 0.0 else 0.0

    def judged(self, problem: ContactProblem, impulses: FloatArray) -> float:
        """Return the judge's residual of Λ [N s], shape (n_rows,), for the problem of this object.

        Plain arithmetic is used if its rounding is negligible.
        """
        plain = self(impulses, problem.relative_velocity(impulses))
        if plain > self.rounding(impulses):
            return plain
        velocity, rounding = problem.accurate_velocity(impulses)
        possible_error = float((self.ratios * self.law_rounding(rounding)).max(initial=0.0))
        return max(self(impulses, velocity), ratio(possible_error, self.scale))

    def law_rounding(self, rounding: FloatArray) -> FloatArray:
        """Return the possible rounding error [m/s] of the violation of each law, shape (n_laws,).

        ``rounding`` is the error bound of each row, shape (n_rows,), from ``ContactProblem.accurate_velocity``.
        """
        first = self._rows[2]
        sums: FloatArray = np.add.reduceat(rounding, first) if len(first) else np.zeros(0)
        return self.lengths * sums

    def __call__(self, impulses: FloatArray, velocity: FloatArray) -> float:
        """Return the residual of Λ [N s] for ξ = GΛ + c [m/s], both of shape (n_rows,)."""
        if self.infeasible:
            return np.inf
        if self.unit != 1.0:
            impulses, velocity = self.unit * impulses, self.unit * velocity
        arguments = *self._rows, *self._bounds, self._partner, self._law_values, impulses, velocity
        return ratio(write_squared_violations(*arguments), self._scale)

    def of_laws(self, impulses: FloatArray, velocity: FloatArray, weight: float = 1.0) -> FloatArray:
        """Return ℓ_i α_i ‖R_i‖ [m/s] of every law under Coulomb friction, shape (n_laws,).

        Args:
            impulses: Λ, shape (n_rows,), multiplied by ``unit``, as the velocity is.
            velocity: ξ, shape (n_rows,).
            weight: factor of all friction bounds.
        """
        mu, fixed_bound = self._bounds
        if weight != 1.0:
            mu, fixed_bound = weight * mu, weight * fixed_bound
        write_squared_violations(*self._rows, mu, fixed_bound, self._partner, self._law_values, impulses, velocity)
        return np.sqrt(self._squares)


class ModelResidual(Residual):
    """The residual under a model other than Coulomb's law; attributes as in ``Residual``."""

    def __init__(self, problem: ContactProblem, model: Model) -> None:
        super().__init__(problem)
        self._model = model
        self._problem = problem if self.unit == 1.0 else in_units(problem, time=self.unit).problem

    def __call__(self, impulses: FloatArray, velocity: FloatArray) -> float:
        """Return the residual of Λ [N s] for ξ = GΛ + c [m/s], both of shape (n_rows,)."""
        if self.infeasible:
            return np.inf
        impulses, velocity = self.unit * impulses, self.unit * velocity
        relative_violations = self.ratios * violations(self._problem, self, impulses, velocity, self._model)
        return ratio(relative_violations.max(initial=0.0), self.unit * self.scale)


class EngineResidual(Residual):
    """The residual under the model of the engine of a captured step; attributes as in ``Residual``.

    The model has a solution for any constraints, because its regularisation makes them compliant.
    """

    def __init__(self, problem: ContactProblem, engine: EngineModel) -> None:
        super().__init__(problem)
        self._engine, self.scale, self.infeasible = engine, engine.scale, False

    def judged(self, problem: ContactProblem, impulses: FloatArray) -> float:
        """Return the judge's residual of Λ [N s], shape (n_rows,), for the problem of this object."""
        return own_residual(self._engine, impulses)

    def __call__(self, impulses: FloatArray, velocity: FloatArray) -> float:
        """Return the residual of Λ [N s], shape (n_rows,); ``velocity`` is not used."""
        return own_residual(self._engine, impulses)


def residual_under(problem: ContactProblem, model: Model) -> Residual:
    """Return the residual of a problem under a model: ``Residual`` or the subclass that fits the model."""
    if model == Model.COULOMB:
        return Residual(problem)
    if model == Model.ENGINE and problem.engine is not None:
        return EngineResidual(problem, problem.engine)
    return ModelResidual(problem, model)


def _unit(scale: float) -> float:
    """Return a power of two that brings ``scale`` near 1 if squares of such numbers leave the range, else 1."""
    if scale == 0.0 or MIN_SQUARED <= scale <= MAX_SQUARED:
        return 1.0
    return float(np.ldexp(1.0, int(np.clip(-np.frexp(scale)[1], -1021, 1021))))


@interpretable
@njit(cache=True, error_model="numpy")
def find_largest_diagonal_term(row_count, first_row, ratios, lengths, diagonal, impulses):  # type: ignore[no-untyped-def]
    """Return the largest ratio · length · |G_hh Λ_h| over the rows of all laws; NaN if one is NaN."""
    largest = 0.0
    for law in range(uint64(len(row_count))):
        factor, first = ratios[law] * lengths[law], uint64(first_row[law])
        for row in range(first, first + uint64(row_count[law])):
            term = factor * abs(diagonal[row] * impulses[row])
            largest = term if term > largest or term != term else largest
    return largest


@interpretable
@njit(cache=True, error_model="numpy")
def write_squared_violations(  # type: ignore[no-untyped-def]
    sets, row_count, first_row, mu, fixed_bound, partner, law_values, impulses, velocity
):
    """Write (ℓ α ‖Λ − prox_C(Λ − ξ/α)‖)² [m²/s²] of every law; return the largest root times ratio [m/s], or NaN.

    Because α prox_C(x) = prox_{αC}(αx), it is evaluated as ‖αΛ − prox_{αC}(αΛ − ξ)‖, which needs no division and holds
    for α = 0: the violation of a unilateral law is then (−ξ)₊, and that of a friction law 0.
    """
    alpha, lengths, _, ratios, squares = law_values
    largest, one = 0.0, uint64(1)
    for law in range(uint64(len(sets))):
        row, a = uint64(first_row[law]), alpha[law]
        if sets[law] == HALF_LINE:
            held = a * impulses[row]
            violation = held if held < velocity[row] or held != held else velocity[row]
            square = violation * violation
        elif sets[law] == BALL:
            bound = fixed_bound[law]
            if partner[law] >= 0:
                bound += mu[law] * max(impulses[uint64(first_row[uint64(partner[law])])], 0.0)
            bound *= a
            if row_count[law] == 1:
                square = _outside_interval(a * impulses[row], velocity[row], bound)
            elif row_count[law] == 2:
                held = a * impulses[row], a * impulses[row + one], 0.0
                square = outside_disc(held, (velocity[row], velocity[row + one], 0.0), bound)
            else:
                square = _outside_ball(row, uint64(row_count[law]), a, bound, impulses, velocity)
            square *= lengths[law] * lengths[law]
        else:  # a line: all of ξ violates the law
            square = velocity[row] * velocity[row]
        squares[law] = square
        square *= ratios[law] * ratios[law]
        largest = square if square > largest or square != square else largest
    return np.sqrt(largest)


@njit(cache=True, inline="always")
def _outside_interval(held, xi, bound):  # type: ignore[no-untyped-def]
    """Return ‖h − prox(h − ξ)‖² for h = αΛ of one row, the prox onto [−bound, bound]."""
    x = held - xi
    limited = min(max(x, -bound), bound)
    violation = xi if limited == x else held - limited
    square = violation * violation
    if not x * x <= INSIDE * bound * bound:
        square = max(square, _sliding_error_squared(held * held, bound))
    return square


@njit(cache=True, inline="always")
def outside_disc(held, xi, bound):  # type: ignore[no-untyped-def]
    """Return ‖h − prox(h − ξ)‖² for h = αΛ, the prox onto a disc; h and ξ are vectors of three numbers in its plane.

    There are no branches, so that compilers vectorise loops over contacts.
    """
    (h_1, h_2, h_3), (xi_1, xi_2, xi_3) = held, xi
    x_1, x_2, x_3 = h_1 - xi_1, h_2 - xi_2, h_3 - xi_3
    squared = x_1 * x_1 + x_2 * x_2 + x_3 * x_3
    scale = bound / np.sqrt(squared if squared > 0.0 else 1.0)
    v_1, v_2, v_3 = h_1 - scale * x_1, h_2 - scale * x_2, h_3 - scale * x_3
    inside, outside = xi_1 * xi_1 + xi_2 * xi_2 + xi_3 * xi_3, v_1 * v_1 + v_2 * v_2 + v_3 * v_3
    square = np.inf if squared == np.inf else inside if squared <= bound * bound else outside
    possible_error = _sliding_error_squared(h_1 * h_1 + h_2 * h_2 + h_3 * h_3, bound)
    return possible_error if not squared <= INSIDE * bound * bound and possible_error > square else square


@njit(cache=True, error_model="numpy")
def _outside_ball(first, count, a, bound, impulses, velocity):  # type: ignore[no-untyped-def]
    """Return ‖h − prox(h − ξ)‖² for ``count`` rows from ``first`` on, the prox onto the ball of radius ``bound``."""
    squared, held_squared, square = 0.0, 0.0, 0.0
    for k in range(first, first + count):
        held, xi = a * impulses[k], velocity[k]
        squared += (held - xi) * (held - xi)
        held_squared += held * held
        square += xi * xi
    if squared == np.inf:
        square = np.inf
    elif not squared <= bound * bound:
        scale, square = bound / np.sqrt(squared), 0.0
        for k in range(first, first + count):
            held = a * impulses[k]
            violation = held - scale * (held - velocity[k])
            square += violation * violation
    if not squared <= INSIDE * bound * bound:
        square = max(square, _sliding_error_squared(held_squared, bound))
    return square


@njit(cache=True, inline="always")
def _sliding_error_squared(held_squared, bound):  # type: ignore[no-untyped-def]
    """Return u²(90b² + 10‖h‖²), the squared rounding error bound of a sliding law; see the module docstring."""
    return UNIT * UNIT * (90.0 * bound * bound + 10.0 * held_squared)


def violations(
    problem: ContactProblem, residual: Residual, impulses: FloatArray, velocity: FloatArray, model: Model
) -> FloatArray:
    """Return ℓ_i α_i ‖R_i‖ [m/s] of every law under ``model``, shape (n_laws,).

    Impulses are multiplied by α before they are squared; velocities are in the units of ``residual.unit``.
    """
    laws = problem.laws
    if model.kind in ("convex", "engine"):
        return _convex_violations(problem, residual, impulses, velocity)
    if model.kind == "pyramid":
        return _pyramid_violations(problem, residual, impulses, velocity, model.sides)
    result = residual.of_laws(impulses, velocity, 0.0 if model.kind == "frictionless" else 1.0)
    if model.kind == "frictionless":  # tangential velocity is free, only Λ_T = 0 is required
        friction, held = laws.is_friction, np.repeat(residual.alpha, laws.row_count) * impulses
        result[friction] = residual.lengths[friction] * laws.friction_norms(held)
    return result


def convex_obstacle(problem: ContactProblem) -> str | None:
    """Return why the associated (convex) model does not apply to the laws of ``problem``, or None if it does."""
    layout = problem.layout
    remote = np.flatnonzero(layout.partner != np.arange(layout.n_blocks))
    if not len(remote):
        return None
    law = int(layout.friction_law[remote[0]])
    return f"friction law {law} does not follow the unilateral law that bounds it, so its contact has no friction cone"


def _convex_violations(
    problem: ContactProblem, residual: Residual, impulses: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Return the violations of −ξ ∈ N_K(Λ) with K = {Λ_N ≥ 0, ‖Λ_T‖ ≤ a + μΛ_N, …} and the largest α of a contact.

    Rolling rows are scaled by the lengths of their laws: ℓξ_R, Λ_R/ℓ, μ_r/ℓ.

    Raises:
        ProblemError: if a friction law does not follow the law that bounds it.
    """
    obstacle = convex_obstacle(problem)
    if obstacle:
        raise ProblemError(f"the convex model does not apply to {problem.name!r}: {obstacle}.")
    layout = problem.layout
    unit = block_lengths(problem, residual)
    lanes, velocities = layout.pad(impulses), layout.pad(velocity)
    lanes[:, 1 + layout.sliding :] /= unit[:, None]
    velocities[:, 1 + layout.sliding :] *= unit[:, None]
    law_alpha = np.append(residual.alpha * residual.lengths**2, 0.0)  # law −1 selects the last entry
    block_alpha = np.maximum(law_alpha[layout.normal_law], law_alpha[layout.friction_law])
    held, moves = block_alpha[:, None] * lanes, block_alpha > 0
    target = held - np.where(moves[:, None], velocities, 0.0)
    bounds = block_alpha * layout.fixed_bound, block_alpha * layout.rolling_bound
    projected = onto_contact_cones(layout, target, layout.friction_coefficient, bounds, unit)
    difference = held - projected
    violation = np.sqrt(difference[:, 0] ** 2 + (difference[:, 1:] ** 2).sum(axis=1))
    violation = np.maximum(violation, PROJECTION_ROUNDINGS * UNIT * np.sqrt((held**2).sum(axis=1)))
    frictionless = (layout.friction_law < 0) & (layout.rolling_law < 0)
    violation[frictionless] = np.abs(np.minimum(held[:, 0], velocities[:, 0]))[frictionless]
    violation[layout.is_bilateral] = np.abs(velocities[layout.is_bilateral, 0])
    law_violations = np.zeros(problem.laws.n_laws)
    owner = np.where(layout.normal_law >= 0, layout.normal_law, layout.friction_law)
    law_violations[owner] = violation
    return law_violations


def block_lengths(problem: ContactProblem, residual: Residual) -> FloatArray:
    """Return the length of each block's rolling friction [m], 1 if there is none, shape (n_blocks,)."""
    lengths: FloatArray = np.append(residual.lengths, 1.0)[problem.layout.rolling_law]
    return lengths


def _pyramid_violations(
    problem: ContactProblem, residual: Residual, impulses: FloatArray, velocity: FloatArray, sides: int
) -> FloatArray:
    """Return the violations with the disc of each spatial friction law replaced by its inscribed polygon."""
    laws, alpha = problem.laws, residual.alpha
    violations = residual.of_laws(impulses, velocity)
    spatial = np.flatnonzero(laws.is_friction & ~laws.is_rolling & (laws.row_count == 2) & (alpha > 0))
    rows = laws.first_row[spatial]
    held = alpha[spatial, None] * np.column_stack([impulses[rows], impulses[rows + 1]])
    target = held - np.column_stack([velocity[rows], velocity[rows + 1]])
    projected = onto_polygon(target, alpha[spatial] * laws.friction_bounds(impulses)[spatial], sides)
    possible_error = PROJECTION_ROUNDINGS * UNIT * np.sqrt((held**2).sum(axis=1))
    violations[spatial] = np.maximum(np.sqrt(((held - projected) ** 2).sum(axis=1)), possible_error)
    return violations
