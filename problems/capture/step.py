"""One step of MuJoCo as a contact problem, with MuJoCo's forces and the model that MuJoCo solves.

With time step h and constraint Jacobian J, MuJoCo computes the forces f of the constraint rows in the state before the
step. The step then ends with

    u⁺ = u* + M̂⁻¹ Jᵀ h f,      so that      J u⁺ = G Λ + c,   G = J M̂⁻¹ Jᵀ,   c = J u*,   Λ = h f,

with u* = u + h M̂⁻¹ f_smooth, the velocity without constraints. M̂ is the mass matrix of the integrator, with damping D
and stiffness K: M + hD (Euler), M − h ∂f_smooth/∂u (implicitfast), M + hD + h²K (discrete, where u* = u + h q̈_smooth).
MuJoCo stores the factor of M̂ in ``qH``. A step that does not end with this velocity is not captured, because this
problem does not describe it.

The impulses of refused rows, as MuJoCo computed them, are part of the free velocity.
"""

import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..arrays import FloatArray
from ..contact.judge import judge
from ..contact.matrices.factors import InverseMass
from ..contact.problem import FREE_FALL, ContactProblem
from ..engine_model import EngineModel, judge_own_model
from ..errors import ProblemError
from .contact_keys import distinct_keys
from .mujoco_import import mujoco
from .rows import CapturedRows, RefusedRow, captured_rows, engine_sets

STEP_ERROR = 1e-9
"""Largest accepted error of the velocity after a step, relative to its largest term."""

VELOCITY_ERROR = "velocity_error"
"""Entry of the provenance: the error of the velocity after the step, relative to its largest term."""

UNSUPPORTED_INTEGRATORS = {
    "RK4": "solves the constraints four times in a step",
    "IMPLICIT": "has a mass matrix that is not symmetric",
}
"""Why an integrator of MuJoCo is not supported, by its name."""

INTEGRATOR_REMEDY = 'set integrator to "implicitfast", "Euler" or "discrete"'
"""Remedy for an unsupported integrator."""


class EmptyStepError(ProblemError):
    """A step has no constraint row, or none that is supported.

    Attributes:
        refused: its constraint rows, all without a law.
    """

    def __init__(self, message: str = "", refused: tuple[RefusedRow, ...] = ()) -> None:
        super().__init__(message)
        self.refused = refused


@dataclass(frozen=True, eq=False)
class CapturedStep:
    """One step of an engine.

    Attributes:
        problem: the step under Coulomb's law, with the model that the engine solved.
        forces: f as computed by the engine [N], shape (n_engine_rows,).
        solver: name of the engine's solver.
        iterations: iterations of that solver.
        anchors: point of each contact in the frames of its geometries [m], 0 for single laws, shape (len(keys), 2, 3).
        refused: rows of the engine without a law.
    """

    problem: ContactProblem
    forces: FloatArray
    solver: str
    iterations: int
    anchors: FloatArray
    refused: tuple[RefusedRow, ...] = ()

    @property
    def engine(self) -> EngineModel:
        """The model that the engine solved."""
        if self.problem.engine is None:
            raise ProblemError(f"{self.problem.name!r} has no model of an engine; capture it again.")
        return self.problem.engine

    @property
    def impulses(self) -> FloatArray:
        """The forces as impulses of the problem [N s], shape (n_rows,)."""
        return self.engine.impulses(self.forces)

    @property
    def keys(self) -> tuple[str, ...]:
        """Name of each contact or single law, in the order of the problem's rows; persistent in a sequence."""
        return self.problem.keys


@dataclass(frozen=True)
class StepVerdict:
    """Quality of the forces of an engine, in its own model and under Coulomb's law.

    Attributes:
        own: residual of the engine's own model.
        coulomb: the judge's residual, under Coulomb's law.
        separation: largest separation velocity of a contact with an impulse [m/s]; 0 under Coulomb's law.
    """

    own: float
    coulomb: float
    separation: float


def from_mujoco(model: Any, data: Any, name: str = "") -> ContactProblem:
    """Return the contact problem of the step that MuJoCo would take from the state of ``data``, which is unchanged.

    Args:
        model: ``mujoco.MjModel``, or the wrapper of dm_control.
        data: its ``mujoco.MjData``.
        name: name of the problem; that of the model if empty.

    Raises:
        ProblemError: if MuJoCo is not installed or its version is not supported, no row is supported, or the step does
            not correspond to a contact problem.
    """
    return captured_step(model, data, name).problem


def captured_step(model: Any, data: Any, name: str = "") -> CapturedStep:
    """Return the same problem as ``from_mujoco``, with MuJoCo's own model and forces.

    Raises:
        EmptyStepError: if the step has no supported row.
        ProblemError: as ``from_mujoco``.
    """
    module = mujoco()
    model, data = getattr(model, "ptr", model), getattr(data, "ptr", data)
    _require_supported_options(module, model)
    if (data.qpos.size, data.qvel.size, data.ctrl.size) != (model.nq, model.nv, model.nu):
        raise ProblemError("the data belong to another model; pass mujoco.MjData(model).")
    before, after = data.qvel.copy(), copy.copy(data)
    after.qH[:] = np.nan
    take_step(model, after)
    if not after.nefc:
        raise EmptyStepError(
            f"the step at {data.time:g} s has no contact and no other constraint; capture a later one."
        )
    jacobian = _jacobian(module, model, after)
    rows = captured_rows(model, after, jacobian)
    if not rows.laws.n_rows:
        first = rows.refused[0]
        raise EmptyStepError(
            f"none of the {after.nefc} constraint rows at {data.time:g} s is supported: {first.name} is refused "
            f"because {first.reason}.",
            rows.refused,
        )
    mass = _tree_matrix(model, after.M)
    own_mass = inverse = InverseMass.of_mass(mass + sp.triu(mass.T, 1))
    is_discrete = model.opt.integrator == module.mjtIntegrator.mjINT_DISCRETE
    if np.isfinite(after.qH).all():
        inverse = _effective_mass(model, after.qH)
        own_mass = inverse if is_discrete else own_mass
    step, force = float(model.opt.timestep), after.efc_force.copy()
    smooth = after.qacc_smooth if is_discrete else inverse.times(after.qfrc_smooth)
    free_motion = before + step * smooth
    total = jacobian.T @ force
    if inverse is own_mass:
        # such a step uses the acceleration of the solver, which matches its forces only when the solver has converged
        total = total + _unbalanced(inverse, after, total)
    error = _velocity_error(free_motion + inverse.times(step * total), after.qvel, before, free_motion)
    _require_small(error, data.time)
    problem = _problem(module, model, data, rows, (jacobian, inverse, free_motion, step * force), name)
    problem = problem.renamed(problem.name, **{VELOCITY_ERROR: error})
    engine = _engine_model(module, after, own_mass, jacobian, sp.csr_array(step * rows.force), step)
    problem = replace(problem, keys=distinct_keys(rows.keys, rows.anchors), engine=engine)
    solver = module.mjtSolver(model.opt.solver).name.removeprefix("mjSOL_")
    solver_name = f"{solver} and noslip" if model.opt.noslip_iterations else solver
    return CapturedStep(problem, force, solver_name, int(after.solver_niter.sum()), rows.anchors, rows.refused)


def take_step(model: Any, data: Any) -> None:
    """Let MuJoCo take one step.

    Raises:
        ProblemError: if MuJoCo fails, or resets the state because a number is huge or not finite.
    """
    module = mujoco()
    time, kinds = data.time, module.mjtWarning
    warnings = [data.warning[int(kind)] for kind in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)]
    for warning in warnings:
        warning.number = 0
    try:
        module.mj_step(model, data)
    except module.FatalError as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise ProblemError(
            f"MuJoCo failed in the step at {time:g} s: {reason}; correct the model, or stop before this step."
        ) from None
    if any(warning.number for warning in warnings):
        raise ProblemError(f"MuJoCo reset the state in the step at {time:g} s; choose a smaller timestep in the model.")


def judge_step(step: CapturedStep) -> StepVerdict:
    """Judge the forces of the engine in its own model and under Coulomb's law."""
    impulses, laws = step.impulses, step.problem.laws
    velocity = step.problem.relative_velocity(impulses)
    normal = laws.first_row[laws.is_unilateral]
    carries = impulses[normal] > 1e-9 * np.abs(impulses).max(initial=0.0)
    separation = float(np.max(velocity[normal], initial=0.0, where=carries))
    return StepVerdict(judge_own_model(step.engine, step.forces), judge(step.problem, impulses).residual, separation)


def _require_supported_options(module: Any, model: Any) -> None:
    integrator = module.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_")
    if integrator in UNSUPPORTED_INTEGRATORS:
        reason = UNSUPPORTED_INTEGRATORS[integrator]
        raise ProblemError(f"the integrator {integrator} {reason}; {INTEGRATOR_REMEDY}.")
    if model.opt.enableflags & module.mjtEnableBit.mjENBL_IPC:
        raise ProblemError("the flag ipc replaces contact forces by barriers, which are not force laws; disable it.")


def _jacobian(module: Any, model: Any, data: Any) -> sp.csr_array[Any]:
    """Return J of all constraint rows, shape (n_engine_rows, n_dofs)."""
    shape = int(data.nefc), int(model.nv)
    if not module.mj_isSparse(model):
        return sp.csr_array(data.efc_J.reshape(shape))
    starts = np.append(data.efc_J_rowadr, data.efc_J_rowadr[-1] + data.efc_J_rownnz[-1])
    count = int(starts[-1])
    return sp.csr_array((data.efc_J[:count].copy(), data.efc_J_colind[:count].copy(), starts), shape=shape)


def _tree_matrix(model: Any, values: FloatArray) -> sp.csr_array[Any]:
    """Return the lower triangle whose entries MuJoCo stores in the pattern of M, shape (n_dofs, n_dofs)."""
    starts = np.append(model.M_rowadr, model.M_rowadr[-1] + model.M_rownnz[-1])
    return sp.csr_array((values.copy(), model.M_colind.copy(), starts), shape=(model.nv, model.nv))


def _effective_mass(model: Any, factor: FloatArray) -> InverseMass:
    """Return M̂⁻¹ from the factors of M̂ = Lᵀ D L, where L has a unit diagonal."""
    lower = _tree_matrix(model, factor)
    diagonal = lower.diagonal()
    unit = sp.csr_array(lower - sp.diags_array(diagonal) + sp.eye_array(model.nv))
    mass = sp.csr_array(unit.T @ sp.diags_array(diagonal) @ unit)
    return InverseMass.of_mass(sp.csr_array((mass + mass.T) / 2))


def _unbalanced(inverse: InverseMass, data: Any, total: FloatArray) -> FloatArray:
    """Return M (q̈ − q̈_smooth) − Jᵀ f [N], shape (n_dofs,)."""
    assert inverse.mass is not None
    unbalanced: FloatArray = inverse.mass @ (data.qacc - data.qacc_smooth) - total
    return unbalanced


def _velocity_error(expected: FloatArray, after: FloatArray, before: FloatArray, free_motion: FloatArray) -> float:
    """Return the error of the velocity after a step, relative to its largest term; NaN if a velocity is not finite.

    The velocity without constraints is a term, because it is by far the largest one if bodies are at rest.
    """
    scale = np.abs([before, free_motion, expected, after]).max()
    return float(np.abs(after - expected).max() / scale) if scale else 0.0


def _require_small(error: float, time: float) -> None:
    """Raise ``ProblemError`` unless the step ended with the velocity of its forces."""
    if not error <= STEP_ERROR:
        raise ProblemError(
            f"the step at {time:g} s differs by a relative {error:.1e} from the velocity of its forces, so it has "
            f"terms that a contact problem lacks (a reset of the state, deformable bodies); remove them from the model."
        )


def _problem(
    module: Any,
    model: Any,
    data: Any,
    rows: CapturedRows,
    parts: tuple[Any, InverseMass, FloatArray, FloatArray],
    name: str,
) -> ContactProblem:
    jacobian, inverse, free_motion, impulse = parts
    directions = sp.csc_array((rows.velocity @ jacobian).T)
    if rows.refused:
        refused = [row.row for row in rows.refused]
        free_motion = free_motion + inverse.times(jacobian[refused].T @ impulse[refused])
    velocity = directions.T @ free_motion + rows.surface_velocity
    provenance: dict[str, str | int | float] = {
        "engine": f"MuJoCo {module.__version__}",
        "integrator": module.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_").lower(),
        "cone": "elliptic" if model.opt.cone else "pyramidal",
        "time": float(data.time),
        "time_step": float(model.opt.timestep),
        "engine_rows": len(impulse),
        "refused_rows": len(rows.refused),
    }
    fall = float(model.opt.timestep * np.linalg.norm(model.opt.gravity))
    if fall:
        provenance[FREE_FALL] = fall
    return ContactProblem.from_factors(
        directions,
        inverse,
        velocity,
        laws=rows.laws,
        free_motion=free_motion,
        name=name or model_name(model),
        provenance=provenance,
    )


def model_name(model: Any) -> str:
    """Return the name of a model."""
    return bytes(model.names).split(b"\0", 1)[0].decode() or "mujoco"


def _engine_model(
    module: Any, data: Any, mass: InverseMass, jacobian: Any, combination: sp.csr_array[Any], step: float
) -> EngineModel:
    kinds, first_rows, coefficient = engine_sets(data)
    return EngineModel(
        name=f"MuJoCo {module.__version__}",
        matrix=sp.csr_array(jacobian @ mass.matrix @ jacobian.T),
        regularisation=data.efc_R,
        offset=jacobian @ data.qacc_smooth - data.efc_aref,
        scale=float(np.max(abs(jacobian) @ np.abs(data.qacc_smooth) + np.abs(data.efc_aref))),
        kind=np.array(kinds, dtype=np.int8),
        first_row=np.array(first_rows, dtype=np.int64),
        coefficient=coefficient,
        bound=data.efc_frictionloss,
        combination=combination,
        time_step=step,
    )
