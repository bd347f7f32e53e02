"""The judge: how well impulses solve a contact problem, from the impulses alone.

For law i with α_i = the largest diagonal entry of its block of G, and the prox taken onto the law's set C_i(Λ),

    R_i = Λ_i − prox_{C_i(Λ)}(Λ_i − ξ_i/α_i),      residual = max_k ( max_{i in k} α_i ‖R_i‖ / max_{i in k} ‖c_i‖ ),

over the connected components k of the contacts (see ``coupling``): the largest velocity by which a law is violated,
relative to the largest free velocity of a law in its component. It depends on no solver's step size, on no unit, on no
choice of tangents, not on the number of contacts, and not on what else stands in the same vector; it holds across mass
ratios, where an impulse error relative to max|Λ| does not. A component whose free velocity is zero, or rounding of that
of the others, counts against the whole.

A unilateral law whose own α is zero moves nothing, but the friction that it bounds may: it takes the largest α of those
friction laws, so that Λ_N > 0 at an opening contact is a violation as soon as it buys friction.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit, uint64
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray, real_numbers
from ..errors import ProblemError
from .answer import ratio
from .coupling import components, largest_around
from .laws import ROWS_OF_KIND, LawKind, Laws
from .model import Model
from .problem import FREE_FALL, ContactProblem
from .projections import onto_friction_cone, onto_polygon

ROUNDING = 2.0**-40
"""Free velocities of this part of the largest one are rounding of it."""

LEAST_SQUARED, LARGEST_SQUARED = 1e-100, 1e100
"""Velocities [m/s] between these are squared as they are."""


@dataclass(frozen=True)
class Verdict:
    """What the judge says of one vector of impulses.

    Attributes:
        residual: the number that counts, see the module; inf if Λ is not finite or the problem is infeasible.
        local_residual: max_i α_i ‖R_i‖/s_i with s_i the largest ‖c‖ of the contacts that share a body with contact i,
            at least the free fall of a step where the problem knows it: what the worst contact sees.
        local_median: the median of the same over the laws.
        local_q90: their 90 % quantile.
        local_q99: their 99 % quantile.
        energy_residual: max_i √α_i ‖R_i‖ over max_i ‖c_i‖/√α_i, the same violation in the scale of energy.
        natural_map_q: FCLIB's error ‖Λ − P_K(Λ − ū)‖₂ / ‖c‖₂ with ū = ξ + μ‖ξ_T‖ e_N (De Saxcé) and ρ = 1.
        natural_map_max: the same over max(‖c‖, ‖Λ‖, ‖ξ‖), as Siconos relates it.
        penetration_velocity: max_i (−ξ_N)₊ [m/s].
        cone_violation: how far Λ lies outside its bounds, max of (−Λ_N)₊ and (‖Λ_T‖ − b)₊ [N s].
        complementarity: largest absolute Λ_N ξ_N [J].
        dissipated_energy: −(½ ΛᵀGΛ + Λᵀc) [J], what the impulses take from the free motion; exact for ε = 0.
        velocity_error: ‖ξ − ξ*‖∞ / ‖c‖∞ where the problem knows ξ*, else None.
        infeasible: a unilateral law with α_i = 0 and c_i < 0, which no impulse can satisfy.
        model: the model that the residuals hold the impulses to.
        component_residuals: the residual of each connected component, in the order of their first contacts.
    """

    residual: float
    local_residual: float
    local_median: float
    local_q90: float
    local_q99: float
    energy_residual: float
    natural_map_q: float
    natural_map_max: float
    penetration_velocity: float
    cone_violation: float
    complementarity: float
    dissipated_energy: float
    velocity_error: float | None
    infeasible: bool
    model: Model
    component_residuals: tuple[float, ...]

    def numbers(self) -> dict[str, float | bool | None]:
        """Return what is a number of its own, by name: everything but the model and the residuals of components."""
        return {name: value for name, value in vars(self).items() if name not in ("model", "component_residuals")}


class Residual:
    """The judge's residual of one problem, prepared once for many impulses (solvers stop on it).

    Attributes:
        alpha: α_i of each law [1/kg], shape (n_laws,); that of the friction it bounds for a normal without any effect.
        speeds: ‖c_i‖ of each law [m/s], shape (n_laws,).
        scale: max ‖c_i‖ over the laws [m/s]; the norm of both tangential entries does not depend on their axes.
        components: the connected component of each law, shape (n_laws,).
        ratios: ``scale`` over the scale of each law's component, shape (n_laws,).
        infeasible: whether some unilateral law has α_i = 0 and c_i < 0.
        unit: power of two that impulses and velocities are multiplied by where their squares would leave the range of
            double precision; 1 elsewhere.
    """

    def __init__(self, problem: ContactProblem) -> None:
        laws, layout = problem.laws, problem.layout
        self.alpha: FloatArray
        self.speeds: FloatArray
        self.alpha, self.speeds, stuck = _scales(
            laws.kind, laws.first_row, laws.partner, problem.delassus_diagonal, problem.free_velocity
        )
        self.scale = float(self.speeds.max(initial=0.0))
        self.components: IntArray = components(problem)[layout.contact_of_row[laws.first_row]]
        self.ratios: FloatArray = _ratios(self.components, self.speeds, self.scale)
        self.infeasible = stuck >= 0
        self.unit = _unit(self.scale)
        self._squares = np.empty(laws.n_laws)
        fixed = laws.fixed_bound if self.unit == 1.0 else self.unit * laws.fixed_bound
        self._arguments = laws.kind, laws.first_row, laws.friction_coefficient, fixed, laws.partner, self.alpha

    @cached_property
    def row_ratios(self) -> FloatArray:
        """``ratios`` of the law of each row, shape (n_rows,)."""
        return np.repeat(self.ratios, ROWS_OF_KIND[self._arguments[0]])

    def __call__(self, impulses: FloatArray, velocity: FloatArray) -> float:
        """Return the residual of Λ [N s] with ξ = GΛ + c [m/s] given, both of shape (n_rows,)."""
        if self.infeasible:
            return np.inf
        if self.unit != 1.0:
            impulses, velocity = self.unit * impulses, self.unit * velocity
        largest = _squared_violations(*self._arguments, impulses, velocity, self.ratios, self._squares)
        return ratio(largest, self.unit * self.scale)


class ModelResidual(Residual):
    """The residual under another model than Coulomb's law; attributes as there."""

    def __init__(self, problem: ContactProblem, model: Model) -> None:
        super().__init__(problem)
        self._problem, self._model = _in_units(problem, self.unit), model

    def __call__(self, impulses: FloatArray, velocity: FloatArray) -> float:
        """Return the residual of Λ [N s] with ξ = GΛ + c [m/s] given, both of shape (n_rows,)."""
        if self.infeasible:
            return np.inf
        impulses, velocity = self.unit * impulses, self.unit * velocity
        violations = self.ratios * _violations(self._problem, self, impulses, velocity, self._model)
        return ratio(violations.max(initial=0.0), self.unit * self.scale)


def judge(problem: ContactProblem, impulses: ArrayLike, model: Model = Model.COULOMB) -> Verdict:
    """Judge impulses Λ [N s], shape (n_rows,), against ``problem``.

    Args:
        problem: the contact problem.
        impulses: Λ, shape (n_rows,).
        model: hold Λ to this model instead of Coulomb's law; everything but the two residuals stays as it is.

    Raises:
        ProblemError: if Λ has the wrong shape, or the model does not apply to the problem's laws.
    """
    given = np.asarray(real_numbers(impulses, "impulses"), dtype=np.float64)
    if given.shape != (problem.n_rows,):
        raise ProblemError(f"impulses must have shape ({problem.n_rows},), one entry a row; got {given.shape}.")
    residual, inf = Residual(problem), np.inf
    known = None if problem.answer is None else problem.answer.velocity
    if not np.isfinite(given).all():
        return _not_finite(problem, residual, model)
    if residual.unit != 1.0:
        return _in_usual_units(judge(_in_units(problem, residual.unit), residual.unit * given, model), residual.unit)
    velocity = problem.relative_velocity(given)
    violation = _violations(problem, residual, given, velocity, model)
    root = np.sqrt(residual.alpha)
    energy, energy_scale = _largest_ratio(violation, root), _largest_ratio(residual.speeds, root)
    natural_map = _natural_map(problem, given, velocity)
    norms = [float(np.linalg.norm(vector)) for vector in (problem.free_velocity, given, velocity)]
    error = None if known is None else ratio(float(np.abs(velocity - known).max(initial=0.0)), residual.scale)
    infeasible, normal = residual.infeasible, problem.laws.first_row[~problem.laws.is_friction]
    components = _of_components(residual, violation)
    local = _local(problem, residual, violation)
    median, q90, q99 = _quantiles(local, (0.5, 0.9, 0.99))
    return Verdict(
        residual=inf if infeasible else ratio((residual.ratios * violation).max(initial=0.0), residual.scale),
        local_residual=inf if infeasible else float(local.max(initial=0.0)),
        local_median=median,
        local_q90=q90,
        local_q99=q99,
        energy_residual=inf if infeasible else ratio(energy, energy_scale),
        natural_map_q=ratio(natural_map, norms[0]),
        natural_map_max=ratio(natural_map, max(norms)),
        penetration_velocity=float((-velocity[normal]).max(initial=0.0)),
        cone_violation=_cone_violation(problem, given),
        complementarity=float(np.abs(given[normal] * velocity[normal]).max(initial=0.0)),
        dissipated_energy=-0.5 * float(given @ (velocity + problem.free_velocity)),
        velocity_error=error,
        infeasible=infeasible,
        model=model,
        component_residuals=components,
    )


def _not_finite(problem: ContactProblem, residual: Residual, model: Model) -> Verdict:
    """Return the verdict on impulses that are not all finite: nothing of it may read as success."""
    inf = np.inf
    return Verdict(
        residual=inf,
        local_residual=inf,
        local_median=inf,
        local_q90=inf,
        local_q99=inf,
        energy_residual=inf,
        natural_map_q=inf,
        natural_map_max=inf,
        penetration_velocity=inf,
        cone_violation=inf,
        complementarity=inf,
        dissipated_energy=np.nan,
        velocity_error=None if problem.answer is None or problem.answer.velocity is None else inf,
        infeasible=residual.infeasible,
        model=model,
        component_residuals=(inf,) * (int(residual.components.max(initial=-1)) + 1),
    )


def _in_units(problem: ContactProblem, unit: float) -> ContactProblem:
    """Return the problem whose impulses and velocities are ``unit`` times those of ``problem``."""
    if unit == 1.0:
        return problem
    answer, known = problem.answer, {}
    if problem.free_fall:
        known = {FREE_FALL: unit * problem.free_fall}
    if answer is not None and answer.velocity is not None:
        answer = replace(answer, velocity=unit * answer.velocity)
    return replace(
        problem,
        free_velocity=unit * problem.free_velocity,
        laws=replace(problem.laws, fixed_bound=unit * problem.laws.fixed_bound),
        answer=answer,
        provenance={**problem.provenance, **known},
    )


def _in_usual_units(verdict: Verdict, unit: float) -> Verdict:
    """Return the verdict on a problem from that on it ``_in_units``; ratios stay as they are."""
    return replace(
        verdict,
        penetration_velocity=verdict.penetration_velocity / unit,
        cone_violation=verdict.cone_violation / unit,
        complementarity=verdict.complementarity / unit / unit,
        dissipated_energy=verdict.dissipated_energy / unit / unit,
    )


def _unit(scale: float) -> float:
    """Return a power of two that brings ``scale`` near 1 if squares of such numbers leave the range, else 1."""
    if scale == 0.0 or LEAST_SQUARED <= scale <= LARGEST_SQUARED:
        return 1.0
    return float(np.ldexp(1.0, int(np.clip(-np.frexp(scale)[1], -1021, 1021))))


@njit(cache=True)
def _ratios(component, speeds, scale):  # type: ignore[no-untyped-def]
    """Return ``scale`` over the largest speed in the component of each law; 1 where that is rounding of ``scale``."""
    largest = np.zeros(len(component))
    for law in range(len(component)):
        largest[component[law]] = max(largest[component[law]], speeds[law])
    ratios = np.ones(len(component))
    for law in range(len(component)):
        own = largest[component[law]]
        if own > ROUNDING * scale:
            ratios[law] = scale / own
    return ratios


def _of_components(residual: Residual, violation: FloatArray) -> tuple[float, ...]:
    """Return the residual of each component."""
    largest = np.zeros(int(residual.components.max(initial=-1)) + 1)
    np.maximum.at(largest, residual.components, residual.ratios * violation)
    return tuple(ratio(value, residual.scale) for value in largest)


def _local(problem: ContactProblem, residual: Residual, violation: FloatArray) -> FloatArray:
    """Return α_i ‖R_i‖/s_i of every law, s_i the largest ‖c‖ around its contact, at least the free fall of a step.

    Where both are zero, s_i is the scale that the residual has.
    """
    layout, laws = problem.layout, problem.laws
    contact = layout.contact_of_row[laws.first_row]
    speeds = np.zeros(layout.n_blocks)
    np.maximum.at(speeds, contact, residual.speeds)
    around = np.maximum(largest_around(problem, speeds)[contact], problem.free_fall)
    scales = np.where(around > ROUNDING * residual.scale, around, residual.scale / residual.ratios)
    local = np.where(violation == 0.0, 0.0, np.inf)
    positive = (scales > 0.0) & (violation == violation)
    local[positive] = violation[positive] / scales[positive]
    return local


def _quantiles(values: FloatArray, shares: tuple[float, ...]) -> list[float]:
    """Return for each share the least value that it of the values do not exceed; 0 for none."""
    ordered = np.sort(values)
    return [float(ordered[max(0, math.ceil(share * len(ordered)) - 1)]) if len(ordered) else 0.0 for share in shares]


@njit(cache=True)
def _squared_violations(  # type: ignore[no-untyped-def]
    kind, first_row, mu, fixed, partner, alpha, impulses, velocity, ratios, squares
):
    """Write (α ‖Λ − prox_C(Λ − ξ/α)‖)² [m²/s²] of every law; return the largest of their roots times their ratios.

    That is a velocity [m/s], and NaN if any of them is.

    Because α prox_C(x) = prox_{αC}(αx), it is evaluated as ‖αΛ − prox_{αC}(αΛ − ξ)‖, which needs no division and holds
    for α = 0: a unilateral law without any effect is violated by (−ξ)₊, a friction law by nothing.
    """
    largest = 0.0
    for law in range(uint64(len(kind))):
        row, a = uint64(first_row[law]), alpha[law]
        held = a * impulses[row]
        x = held - velocity[row]
        if kind[law] == 0:
            square = (held - max(x, 0.0)) ** 2
        else:
            bound = fixed[law]
            if partner[law] >= 0:
                bound += mu[law] * max(impulses[uint64(first_row[uint64(partner[law])])], 0.0)
            bound *= a
            if kind[law] == 1:
                square = (held - min(max(x, -bound), bound)) ** 2
            else:
                held_2 = a * impulses[row + uint64(1)]
                y = held_2 - velocity[row + uint64(1)]
                length_squared = x * x + y * y
                if length_squared > bound * bound:
                    scale = bound / np.sqrt(length_squared)
                    x *= scale
                    y *= scale
                square = (held - x) ** 2 + (held_2 - y) ** 2
        squares[law] = square
        square *= ratios[law] * ratios[law]
        largest = square if square > largest or square != square else largest
    return np.sqrt(largest)


def _violations(
    problem: ContactProblem, residual: Residual, impulses: FloatArray, velocity: FloatArray, model: Model
) -> FloatArray:
    """Return α_i ‖R_i‖ [m/s] of every law under ``model``, shape (n_laws,)."""
    laws = problem.laws
    if model.kind == "convex":
        return _convex_violations(problem, residual.alpha, impulses, velocity)
    if model.kind == "pyramid":
        return _pyramid_violations(problem, residual, impulses, velocity, model.sides)
    weight = 0.0 if model.kind == "frictionless" else 1.0
    mu, fixed = weight * laws.friction_coefficient, weight * laws.fixed_bound
    violations = _coulomb_violations(laws, mu, fixed, residual, impulses, velocity)
    if model.kind == "frictionless":  # tangential velocity is free, only Λ_T = 0 is required
        tangent = _tangent(problem, impulses)
        friction = laws.is_friction
        violations[friction] = residual.alpha[friction] * np.sqrt((tangent**2).sum(axis=1))
    return violations


def _coulomb_violations(
    laws: Laws, mu: FloatArray, fixed: FloatArray, residual: Residual, impulses: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Return α_i ‖R_i‖ [m/s] of every law, with friction coefficients and fixed bounds as given, shape (n_laws,)."""
    squares = np.empty(laws.n_laws)
    given = laws.kind, laws.first_row, mu, fixed, laws.partner, residual.alpha, impulses, velocity, residual.ratios
    _squared_violations(*given, squares)
    return np.sqrt(squares)


def convex_obstacle(problem: ContactProblem) -> str | None:
    """Say why the associated (convex) model does not apply to the laws of ``problem``, or None if it does."""
    layout = problem.layout
    remote = np.flatnonzero(layout.partner != np.arange(layout.n_blocks))
    if not len(remote):
        return None
    law = int(layout.friction_law[remote[0]])
    return f"friction law {law} is bounded by a unilateral law that it does not follow, so contact and cone are apart"


def _convex_violations(
    problem: ContactProblem, alpha: FloatArray, impulses: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Violation of −ξ ∈ N_K(Λ) with K the whole set {Λ_N ≥ 0, ‖Λ_T‖ ≤ a + μΛ_N} of a contact, α its largest."""
    obstacle = convex_obstacle(problem)
    if obstacle:
        raise ProblemError(f"the convex model does not apply to {problem.name!r}: {obstacle}.")
    layout, lanes, moved = problem.layout, problem.layout.pad(impulses), problem.layout.pad(velocity)
    with_none = np.append(alpha, 0.0)  # the last entry answers for law −1
    block_alpha = np.maximum(with_none[layout.normal_law], with_none[layout.friction_law])
    step = 1.0 / np.where(block_alpha > 0, block_alpha, np.inf)
    target = lanes - step[:, None] * moved
    normal, tangent = onto_friction_cone(target[:, 0], target[:, 1:], layout.friction_coefficient, layout.fixed_bound)
    violation = block_alpha * np.sqrt((lanes[:, 0] - normal) ** 2 + ((lanes[:, 1:] - tangent) ** 2).sum(axis=1))
    of_law = np.zeros(problem.laws.n_laws)
    owner = np.where(layout.normal_law >= 0, layout.normal_law, layout.friction_law)
    of_law[owner] = violation
    return of_law


def _pyramid_violations(
    problem: ContactProblem, residual: Residual, impulses: FloatArray, velocity: FloatArray, sides: int
) -> FloatArray:
    """As Coulomb's law, with the disc of a spatial friction law replaced by its inscribed polygon."""
    laws, alpha = problem.laws, residual.alpha
    violations = _coulomb_violations(laws, laws.friction_coefficient, laws.fixed_bound, residual, impulses, velocity)
    spatial = np.flatnonzero((laws.kind == LawKind.SPATIAL_FRICTION) & (alpha > 0))
    rows = laws.first_row[spatial]
    held = np.column_stack([impulses[rows], impulses[rows + 1]])
    moved = np.column_stack([velocity[rows], velocity[rows + 1]])
    target = held - moved / alpha[spatial, None]
    projected = onto_polygon(target, _bounds(problem, impulses)[spatial], sides)
    violations[spatial] = alpha[spatial] * np.sqrt(((held - projected) ** 2).sum(axis=1))
    return violations


def _bounds(problem: ContactProblem, impulses: FloatArray) -> FloatArray:
    """Friction bound a + μ max(Λ_partner, 0) of every law [N s], shape (n_laws,)."""
    laws = problem.laws
    normal = np.maximum(impulses[laws.first_row[np.maximum(laws.partner, 0)]], 0.0) if laws.n_laws else np.zeros(0)
    bounds: FloatArray = laws.fixed_bound + np.where(laws.partner >= 0, laws.friction_coefficient * normal, 0.0)
    return bounds


def _tangent(problem: ContactProblem, rows: FloatArray) -> FloatArray:
    """Both tangential entries of every friction law, the second 0 for planar ones, shape (n_friction_laws, 2)."""
    laws = problem.laws
    first = laws.first_row[laws.is_friction]
    second = np.where(laws.kind[laws.is_friction] == LawKind.SPATIAL_FRICTION, first + 1, 0)
    return np.column_stack([rows[first], np.where(second > 0, rows[second], 0.0)])


@njit(cache=True)
def _scales(kind, first_row, partner, diagonal, free_velocity):  # type: ignore[no-untyped-def]
    """Return α_i and ‖c_i‖ of every law, and a unilateral law with α_i = 0 and c_i < 0, −1 if there is none."""
    alpha, speeds = np.empty(len(kind)), np.empty(len(kind))
    stuck = -1
    for law in range(len(kind)):
        row = first_row[law]
        alpha[law], speeds[law] = diagonal[row], abs(free_velocity[row])
        if kind[law] == 2:
            alpha[law] = max(alpha[law], diagonal[row + 1])
            speeds[law] = np.hypot(speeds[law], free_velocity[row + 1])
        if kind[law] == 0 and alpha[law] == 0.0 and free_velocity[row] < 0.0:
            stuck = law
    for law in range(len(kind)):
        normal = partner[law]
        if normal >= 0 and diagonal[first_row[normal]] == 0.0:
            alpha[normal] = max(alpha[normal], alpha[law])
    return alpha, speeds, stuck


def _natural_map(problem: ContactProblem, impulses: FloatArray, velocity: FloatArray) -> float:
    """‖Λ − P_K(Λ − ū)‖₂ with ū = ξ + μ‖ξ_T‖ e_N; a friction law apart from its partner keeps its present bound."""
    layout, lanes, moved = problem.layout, problem.layout.pad(impulses), problem.layout.pad(velocity)
    own = layout.partner == np.arange(layout.n_blocks)
    remote_bound = layout.friction_coefficient * np.maximum(lanes[layout.partner, 0], 0.0)
    friction = np.where(own, layout.friction_coefficient, 0.0)
    fixed = layout.fixed_bound + np.where(own, 0.0, remote_bound)
    lifted = moved[:, 0] + friction * np.sqrt((moved[:, 1:] ** 2).sum(axis=1))
    normal, tangent = onto_friction_cone(lanes[:, 0] - lifted, lanes[:, 1:] - moved[:, 1:], friction, fixed)
    return float(np.sqrt(((lanes[:, 0] - normal) ** 2).sum() + ((lanes[:, 1:] - tangent) ** 2).sum()))


def _cone_violation(problem: ContactProblem, impulses: FloatArray) -> float:
    laws = problem.laws
    pulling = (-impulses[laws.first_row[~laws.is_friction]]).max(initial=0.0)
    tangent = np.sqrt((_tangent(problem, impulses) ** 2).sum(axis=1))
    return float(max(pulling, (tangent - _bounds(problem, impulses)[laws.is_friction]).max(initial=0.0)))


def _largest_ratio(values: FloatArray, scales: FloatArray) -> float:
    """Largest value/scale over the entries of positive scale."""
    positive = scales > 0
    return float((values[positive] / scales[positive]).max(initial=0.0))
