"""How far impulses violate the laws of a contact problem, law by law, under Coulomb's law and under other models.

With α_i and R_i as in ``judge``, the violation of law i is the velocity α_i ‖R_i‖ [m/s]. Solvers stop on the largest of
them, relative to the free velocity of its component, which ``Residual`` prepares once for many impulses.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
from numba import njit, uint64

from ..arrays import FloatArray, IntArray
from ..errors import ProblemError
from .answer import ratio
from .coupling import components
from .laws import LawKind, Laws
from .model import Model
from .problem import FREE_FALL, ContactProblem
from .projections import onto_friction_cone, onto_polygon

ROUNDING = 2.0**-40
"""Free velocities of this part of the largest one are rounding of it."""


LEAST_SQUARED, LARGEST_SQUARED = 1e-100, 1e100
"""Velocities [m/s] between these are squared as they are."""


class Residual:
    """The judge's residual of one problem, prepared once for many impulses (solvers stop on it).

    Attributes:
        alpha: α_i of each law [1/kg], shape (n_laws,); that of the friction it bounds for a normal without any effect.
        speeds: ‖c_i‖ of each law [m/s], shape (n_laws,).
        scale: max ‖c_i‖ over the laws [m/s]; the norm of both tangential entries does not depend on their axes.
        ratios: ``scale`` over the scale of each law's component, shape (n_laws,).
        stuck_law: a unilateral law with α_i = 0 and c_i < 0, −1 if there is none.
        infeasible: whether there is one.
        unit: power of two that impulses and velocities are multiplied by where their squares would leave the range of
            double precision; 1 elsewhere.
    """

    def __init__(self, problem: ContactProblem) -> None:
        laws = problem.laws
        self.alpha: FloatArray
        self.speeds: FloatArray
        self.stuck_law: int
        self.scale: float
        self.alpha, self.speeds, self.ratios, self._squares = np.empty((4, laws.n_laws))
        self._diagonal = problem.delassus_diagonal
        self.stuck_law, self.scale = _write_scales(
            laws.kind, laws.first_row, laws.partner, self._diagonal, problem.free_velocity, self.alpha, self.speeds
        )
        self._contacts, self._layout = components(problem), problem.layout
        _write_ratios(
            self._contacts, self._layout.slot, self._layout.width, laws.first_row, self.speeds, self.scale, self.ratios
        )
        self.infeasible = self.stuck_law >= 0
        self.unit = _unit(self.scale)
        self._scale = self.unit * self.scale
        fixed = laws.fixed_bound if self.unit == 1.0 else self.unit * laws.fixed_bound
        self._arguments = laws.kind, laws.first_row, laws.friction_coefficient, fixed, laws.partner, self.alpha

    @cached_property
    def components(self) -> IntArray:
        """The connected component of each law, shape (n_laws,)."""
        return self._contacts[self._layout.contact_of_row[self._arguments[1]]]

    def largest_held(self, impulses: FloatArray) -> float:
        """Return the largest G_hh |Λ_h| over all rows h, each times the ratio of its law [m/s]."""
        return float(_largest_held(self._arguments[0], self._arguments[1], self.ratios, self._diagonal, impulses))

    def __call__(self, impulses: FloatArray, velocity: FloatArray) -> float:
        """Return the residual of Λ [N s] with ξ = GΛ + c [m/s] given, both of shape (n_rows,)."""
        if self.infeasible:
            return np.inf
        if self.unit != 1.0:
            impulses, velocity = self.unit * impulses, self.unit * velocity
        largest = _squared_violations(*self._arguments, impulses, velocity, self.ratios, self._squares)
        return ratio(largest, self._scale)


class ModelResidual(Residual):
    """The residual under another model than Coulomb's law; attributes as there."""

    def __init__(self, problem: ContactProblem, model: Model) -> None:
        super().__init__(problem)
        self._problem, self._model = in_units(problem, self.unit), model

    def __call__(self, impulses: FloatArray, velocity: FloatArray) -> float:
        """Return the residual of Λ [N s] with ξ = GΛ + c [m/s] given, both of shape (n_rows,)."""
        if self.infeasible:
            return np.inf
        impulses, velocity = self.unit * impulses, self.unit * velocity
        relative = self.ratios * violations(self._problem, self, impulses, velocity, self._model)
        return ratio(relative.max(initial=0.0), self.unit * self.scale)


def in_units(problem: ContactProblem, unit: float) -> ContactProblem:
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


def _unit(scale: float) -> float:
    """Return a power of two that brings ``scale`` near 1 if squares of such numbers leave the range, else 1."""
    if scale == 0.0 or LEAST_SQUARED <= scale <= LARGEST_SQUARED:
        return 1.0
    return float(np.ldexp(1.0, int(np.clip(-np.frexp(scale)[1], -1021, 1021))))


@njit(cache=True)
def _write_ratios(component, slot, width, first_row, speeds, scale, ratios):  # type: ignore[no-untyped-def]
    """Write ``scale`` over the largest speed in the component of each law; 1 where that is rounding of ``scale``.

    ``component`` is that of each contact.
    """
    largest = np.zeros(len(component))
    for law in range(len(speeds)):
        own = component[slot[first_row[law]] // width]
        largest[own] = max(largest[own], speeds[law])
    for law in range(len(speeds)):
        own = largest[component[slot[first_row[law]] // width]]
        ratios[law] = scale / own if own > ROUNDING * scale else 1.0


@njit(cache=True)
def _largest_held(kind, first_row, ratios, diagonal, impulses):  # type: ignore[no-untyped-def]
    """Return the largest ratio · |G_hh Λ_h| over the rows of all laws; NaN if any is."""
    largest = 0.0
    for law in range(len(kind)):
        for row in range(first_row[law], first_row[law] + max(kind[law], 1)):
            held = ratios[law] * abs(diagonal[row] * impulses[row])
            largest = held if held > largest or held != held else largest
    return largest


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


def violations(
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
    found = _coulomb_violations(laws, mu, fixed, residual, impulses, velocity)
    if model.kind == "frictionless":  # tangential velocity is free, only Λ_T = 0 is required
        tangent = tangents(problem, impulses)
        friction = laws.is_friction
        found[friction] = residual.alpha[friction] * np.sqrt((tangent**2).sum(axis=1))
    return found


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
    projected = onto_polygon(target, friction_bounds(problem, impulses)[spatial], sides)
    violations[spatial] = alpha[spatial] * np.sqrt(((held - projected) ** 2).sum(axis=1))
    return violations


def friction_bounds(problem: ContactProblem, impulses: FloatArray) -> FloatArray:
    """Friction bound a + μ max(Λ_partner, 0) of every law [N s], shape (n_laws,)."""
    laws = problem.laws
    normal = np.maximum(impulses[laws.first_row[np.maximum(laws.partner, 0)]], 0.0) if laws.n_laws else np.zeros(0)
    bounds: FloatArray = laws.fixed_bound + np.where(laws.partner >= 0, laws.friction_coefficient * normal, 0.0)
    return bounds


def tangents(problem: ContactProblem, rows: FloatArray) -> FloatArray:
    """Both tangential entries of every friction law, the second 0 for planar ones, shape (n_friction_laws, 2)."""
    laws = problem.laws
    first = laws.first_row[laws.is_friction]
    second = np.where(laws.kind[laws.is_friction] == LawKind.SPATIAL_FRICTION, first + 1, 0)
    return np.column_stack([rows[first], np.where(second > 0, rows[second], 0.0)])


@njit(cache=True)
def _write_scales(kind, first_row, partner, diagonal, free_velocity, alpha, speeds):  # type: ignore[no-untyped-def]
    """Write α_i and ‖c_i‖ of every law; return a unilateral law with α_i = 0 and c_i < 0, −1 if none, and max ‖c_i‖."""
    stuck, largest = -1, 0.0
    for law in range(len(kind)):
        row = first_row[law]
        alpha[law], speeds[law] = diagonal[row], abs(free_velocity[row])
        if kind[law] == 2:
            alpha[law] = max(alpha[law], diagonal[row + 1])
            speeds[law] = np.hypot(speeds[law], free_velocity[row + 1])
        if kind[law] == 0 and alpha[law] == 0.0 and free_velocity[row] < 0.0:
            stuck = law
        largest = max(largest, speeds[law])
    for law in range(len(kind)):
        normal = partner[law]
        if normal >= 0 and diagonal[first_row[normal]] == 0.0:
            alpha[normal] = max(alpha[normal], alpha[law])
    return stuck, largest
