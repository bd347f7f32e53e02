"""The judge, which measures how well impulses solve a contact problem, from the impulses alone.

Let ξ = GΛ + c. For law i, let α_i be the largest diagonal entry of its block of G, and C_i(Λ) its set of admissible
impulses. Then

    R_i = Λ_i − prox_{C_i(Λ)}(Λ_i − ξ_i/α_i),      residual = max_k ( max_{i in k} α_i ‖R_i‖ / max_{i in k} ‖c_i‖ ),

over the connected components k of the contacts (see ``coupling``). This is the largest velocity by which a law is
violated, relative to the largest free velocity of a law in its component. It does not depend on the step size of a
solver, on units, on the choice of tangents, on the number of contacts, or on other components. It remains meaningful at
large mass ratios, where an impulse error relative to max|Λ| does not. If the free velocity of a component is zero, or
no more than rounding, its residual is relative to the largest free velocity of the problem.

The rows of rolling friction contain angular velocities [rad/s]. They are converted to velocities [m/s] at the
distance from the axis

    ℓ_i = √(α_N/α_i)      (1 for all other laws),

where α_N belongs to the unilateral law of the contact. For a single body ℓ_i is a radius of gyration.
The violation is ℓ_i α_i ‖R_i‖ and the free velocity ℓ_i ‖c_i‖, so that the residual does not depend on the unit of
length.

Impulses of wedged bodies may be huge, and the terms of ξ = GΛ + c then cancel. Therefore ξ is summed in twice the
working precision (``matrices.accurate``), and violations are computed without cancellation (``residual``). Every
reported error is at least its possible rounding error.

The impulse of a unilateral law with α = 0 has no effect on velocities, but it may permit friction. Such a law is
given the largest α of the friction laws that it bounds, so that Λ_N > 0 at an opening contact is a violation.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, real_vector
from ..compilation.interpretation import interprets_kernels
from ..engine_model import own_residual
from ..errors import ProblemError
from ..representation import html_table
from .answer import ratio
from .coupling import NEGLIGIBLE, largest_around
from .model import Model
from .problem import ContactProblem
from .projections import onto_contact_cones
from .residual import PROJECTION_ROUNDINGS, UNIT, Residual, violations
from .transformations import in_units

JUDGE = 3
"""Version of the judge; residuals of different versions are not comparable. Version 1 did not separate components, and
version 2 returned 0 if huge impulses cancelled."""

NON_NUMERIC_FIELDS = ("model", "component_residuals")
"""Fields of a verdict that are not numbers."""

UNITS = {
    "penetration_velocity": " [m/s]",
    "cone_violation": " [N s]",
    "complementarity": " [J]",
    "dissipated_energy": " [J]",
}
"""Units of the fields of a verdict that are not ratios."""


@dataclass(frozen=True)
class Verdict:
    """The errors of one vector of impulses.

    Attributes:
        residual: the judge's residual, as in the module docstring; inf if Λ is not finite or the problem is infeasible.
        local_residual: max_i α_i ‖R_i‖/s_i, where s_i is the largest ‖c‖ of the contacts that share a body with the
            contact of law i, but at least the velocity of free fall in a step, if known.
        local_median: median of α_i ‖R_i‖/s_i over the laws.
        local_q90: the 90 % quantile of the same ratios.
        local_q99: the 99 % quantile of the same ratios.
        energy_residual: max_i(√α_i ‖R_i‖) / max_i(‖c_i‖/√α_i), the same violations as roots of energies.
        natural_map_q: FCLIB's error ‖Λ − P_K(Λ − ū)‖₂ / ‖c‖₂ with ū = ξ + (μ‖ξ_T‖ + μ_r‖ξ_R‖) e_N (De Saxcé), ρ = 1.
        natural_map_max: the same error divided by max(‖c‖, ‖Λ‖, ‖ξ‖), as in Siconos.
        penetration_velocity: max_i (−ξ_N)₊ [m/s].
        cone_violation: distance of Λ from its bounds, the largest of (−Λ_N)₊, (‖Λ_T‖ − b)₊ and (‖Λ_R‖ − b)₊/ℓ [N s].
        complementarity: largest absolute Λ_N ξ_N [J].
        dissipated_energy: −(½ ΛᵀGΛ + Λᵀc) [J], the energy lost relative to the free motion; exact for ε = 0.
        velocity_error: ‖ξ − ξ*‖∞ / max_i ‖c_i‖ if the answer of the problem contains ξ*, otherwise None.
        infeasible: whether no impulse can satisfy some law: a unilateral one with α_i = 0 and c_i < 0, or a bilateral
            one with α_i = 0 and c_i ≠ 0.
        model: the friction model of the residuals.
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

    def __repr__(self) -> str:
        infeasible = ", infeasible" if self.infeasible else ""
        local = f"local {self.local_residual:.3g}"
        return f"<Verdict: residual {self.residual:.3g}, {local}, {self.model} model{infeasible}>"

    def _repr_html_(self) -> str:
        known = {name: value for name, value in self.numeric_fields().items() if value is not None}
        facts = {f"{name.replace('_', ' ')}{UNITS.get(name, '')}": value for name, value in known.items()}
        return html_table(f"Verdict by the {self.model} model", facts)

    def numeric_fields(self) -> dict[str, float | bool | None]:
        """Return the fields that are single numbers, by name."""
        return {name: value for name, value in vars(self).items() if name not in NON_NUMERIC_FIELDS}


@interprets_kernels
@np.errstate(over="ignore", invalid="ignore")  # overflow gives inf
def judge(problem: ContactProblem, impulses: ArrayLike, model: Model = Model.COULOMB) -> Verdict:
    """Judge how well impulses solve a contact problem.

    Args:
        problem: the contact problem.
        impulses: Λ [N s], shape (n_rows,).
        model: the friction model; it affects the residuals, not the other errors. ``Model.ENGINE`` in a captured step
            affects ``residual`` only.

    Returns:
        The verdict, with all errors of the impulses.

    Raises:
        ProblemError: if ``problem`` is not a contact problem, Λ is not an array of the right shape, ``model`` is not a
            model, or the model does not apply to the problem's laws.
    """
    arguments: tuple[object, object] = (problem, model)
    if not isinstance(arguments[0], ContactProblem):
        kind = type(problem).__name__
        raise ProblemError(f"judge takes a ContactProblem, not {kind}; read one with load(name) or load(path).")
    if hasattr(impulses, "impulses"):
        raise ProblemError("judge takes the impulses of a solution, not the solution; pass solution.impulses.")
    impulses = real_vector(impulses, "impulses", problem.n_rows)
    if not isinstance(arguments[1], Model):
        raise ProblemError(f"model must be a Model, such as Model.COULOMB, not {model!r:.60}.")
    if model == Model.ENGINE and problem.engine is not None:
        return replace(judge(problem, impulses), residual=own_residual(problem.engine, impulses), model=model)
    residual, inf = Residual(problem), np.inf
    known = None if problem.answer is None else problem.answer.velocity
    if not np.isfinite(impulses).all():
        return _infinite_verdict(problem, residual, model)
    if residual.unit != 1.0:
        scaled = in_units(problem, time=residual.unit).problem
        return _in_usual_units(judge(scaled, residual.unit * impulses, model), residual.unit)
    velocity, rounding = problem.accurate_velocity(impulses)
    violation = np.maximum(violations(problem, residual, impulses, velocity, model), residual.law_rounding(rounding))
    speed = np.maximum(np.abs(velocity), rounding)
    root = residual.lengths * np.sqrt(residual.alpha)
    energy, energy_scale = _largest_ratio(violation, root), _largest_ratio(residual.speeds, root)
    natural_map = _natural_map(problem, impulses, velocity, rounding)
    norms = [float(np.linalg.norm(vector)) for vector in (problem.free_velocity, impulses, velocity)]
    deviation = None if known is None else float(np.maximum(np.abs(velocity - known), rounding).max(initial=0.0))
    infeasible, normal = residual.infeasible, problem.laws.first_row[problem.laws.is_unilateral]
    is_stuck = np.arange(len(violation)) == residual.stuck_law
    local = _local_ratios(problem, residual, violation, problem.free_fall)
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
        penetration_velocity=float(np.maximum(-velocity[normal], rounding[normal]).max(initial=0.0)),
        cone_violation=_cone_violation(problem, residual, impulses),
        complementarity=float(np.abs(impulses[normal] * speed[normal]).max(initial=0.0)),
        dissipated_energy=-0.5 * float(impulses @ (velocity + problem.free_velocity)),
        velocity_error=None if deviation is None else ratio(deviation, residual.scale),
        infeasible=infeasible,
        model=model,
        component_residuals=_component_residuals(residual, np.where(is_stuck, inf, violation)),
    )


@np.errstate(over="ignore", invalid="ignore")
def local_residual(problem: ContactProblem, impulses: FloatArray, free_fall: float = 0.0) -> float:
    """Return ``Verdict.local_residual`` of impulses, without computing a full verdict.

    Args:
        problem: the contact problem.
        impulses: Λ [N s], shape (n_rows,).
        free_fall: velocity that forces cause within a step [m/s], if the problem does not contain it.
    """
    residual = Residual(problem)
    if residual.infeasible or not np.isfinite(impulses).all():
        return np.inf
    if residual.unit != 1.0:
        unit = residual.unit
        return local_residual(in_units(problem, time=unit).problem, unit * impulses, unit * free_fall)
    velocity, rounding = problem.accurate_velocity(impulses)
    violation = violations(problem, residual, impulses, velocity, Model.COULOMB)
    violation = np.maximum(violation, residual.law_rounding(rounding))
    return float(_local_ratios(problem, residual, violation, max(problem.free_fall, free_fall)).max(initial=0.0))


def _infinite_verdict(problem: ContactProblem, residual: Residual, model: Model) -> Verdict:
    """Return the verdict on impulses that are not all finite; all of its errors are infinite or NaN."""
    values: dict[str, Any] = {item.name: np.inf for item in fields(Verdict) if item.name not in NON_NUMERIC_FIELDS}
    if problem.answer is None or problem.answer.velocity is None:
        values["velocity_error"] = None
    values |= {"dissipated_energy": np.nan, "infeasible": residual.infeasible}
    n_components = int(residual.components.max(initial=-1)) + 1
    return Verdict(**values, model=model, component_residuals=(np.inf,) * n_components)


def _in_usual_units(verdict: Verdict, unit: float) -> Verdict:
    """Convert a verdict from other units of time to the units of the problem; ratios do not change."""
    return replace(
        verdict,
        penetration_velocity=verdict.penetration_velocity / unit,
        cone_violation=verdict.cone_violation / unit,
        complementarity=verdict.complementarity / unit / unit,
        dissipated_energy=verdict.dissipated_energy / unit / unit,
    )


def _component_residuals(residual: Residual, violation: FloatArray) -> tuple[float, ...]:
    """Return the residual of each component."""
    largest = np.zeros(int(residual.components.max(initial=-1)) + 1)
    np.maximum.at(largest, residual.components, residual.ratios * violation)
    return tuple(ratio(value, residual.scale) for value in largest)


def _local_ratios(problem: ContactProblem, residual: Residual, violation: FloatArray, free_fall: float) -> FloatArray:
    """Return α_i ‖R_i‖/s_i of each law, shape (n_laws,).

    s_i is the largest ‖c‖ of its contact and of the contacts that share a body with it, and at least ``free_fall``. If
    this is negligible, s_i is the scale of the law's component.
    """
    layout, laws = problem.layout, problem.laws
    contact = layout.contact_of_row[laws.first_row]
    speeds = np.zeros(layout.n_blocks)
    np.maximum.at(speeds, contact, residual.speeds)
    nearby = np.maximum(largest_around(problem, speeds)[contact], free_fall)
    scales = np.where(nearby > NEGLIGIBLE * residual.scale, nearby, residual.scale / residual.ratios)
    local = np.where(violation == 0.0, 0.0, np.inf)
    positive = (scales > 0.0) & (violation == violation)
    local[positive] = violation[positive] / scales[positive]
    return local


def _quantiles(values: FloatArray, shares: tuple[float, ...]) -> list[float]:
    """Return the quantile of the values for each share; 0 if there are no values."""
    if not len(values):
        return [0.0] * len(shares)
    indices = [max(0, math.ceil(share * len(values)) - 1) for share in shares]
    ordered = np.partition(values, indices)
    return [float(ordered[index]) for index in indices]


def _natural_map(problem: ContactProblem, impulses: FloatArray, velocity: FloatArray, rounding: FloatArray) -> float:
    """Return ‖Λ − P_K(Λ − ū)‖₂ with ū = ξ + (μ‖ξ_T‖ + μ_r‖ξ_R‖) e_N, at least its possible rounding error.

    The bound of a friction law that does not follow its partner is fixed at its current value.
    """
    layout, lanes, velocities = problem.layout, problem.layout.pad(impulses), problem.layout.pad(velocity)
    friction, fixed_bound = layout.friction_coefficient, layout.fixed_bound
    if not layout.bounds_are_own:
        is_own_partner = layout.partner == np.arange(layout.n_blocks)
        remote_bound = friction * np.maximum(lanes[layout.partner, 0], 0.0)
        friction, fixed_bound = (
            np.where(is_own_partner, friction, 0.0),
            fixed_bound + np.where(is_own_partner, 0.0, remote_bound),
        )
    tangent, rolling = velocities[:, 1 : 1 + layout.sliding], velocities[:, 1 + layout.sliding :]
    lift = friction * np.sqrt(_squares(tangent))
    if layout.rolling:
        lift += layout.rolling_coefficient * np.sqrt(_squares(rolling))
    velocities[:, 0] += lift
    cones = friction, (fixed_bound, layout.rolling_bound), np.ones(layout.n_blocks)
    difference = lanes - onto_contact_cones(layout, lanes - velocities, *cones)
    frictionless = (layout.friction_law < 0) & (layout.rolling_law < 0) & ~layout.is_bilateral
    difference[frictionless, 0] = np.minimum(lanes[frictionless, 0], velocities[frictionless, 0])
    difference[layout.is_bilateral] = velocities[layout.is_bilateral]
    roundings = np.where(frictionless | layout.is_bilateral, 0.0, PROJECTION_ROUNDINGS * UNIT)
    possible_error = roundings * np.sqrt(_squares(lanes)) + np.einsum("ij->i", layout.pad(rounding))
    return float(np.sqrt(np.maximum(_squares(difference), possible_error**2).sum()))


def _squares(vectors: FloatArray) -> FloatArray:
    """Return the squared length of each row."""
    lengths: FloatArray = np.einsum("ij,ij->i", vectors, vectors)
    return lengths


def _cone_violation(problem: ContactProblem, residual: Residual, impulses: FloatArray) -> float:
    laws = problem.laws
    pulling = (-impulses[laws.first_row[laws.is_unilateral]]).max(initial=0.0)
    bounds = laws.friction_bounds(impulses)[laws.is_friction]
    excess, possible_error = laws.friction_norms(impulses) - bounds, PROJECTION_ROUNDINGS * UNIT * bounds
    excess = np.where(excess < -possible_error, excess, np.maximum(excess, possible_error))
    lengths = residual.lengths[laws.is_friction]  # 0 if α_N/α_i underflows
    excess = np.divide(excess, lengths, out=np.where(excess > 0.0, np.inf, 0.0), where=lengths > 0.0)
    return float(max(pulling, excess.max(initial=0.0)))


def _largest_ratio(values: FloatArray, scales: FloatArray) -> float:
    """Return the largest value/scale over the entries with a positive scale."""
    positive = scales > 0
    return float((values[positive] / scales[positive]).max(initial=0.0))
