"""A contact problem in the arrays of MuJoCo's constraint stage, and the import of MuJoCo.

A model is built that has the right number of coordinates and constraint rows: a slide joint of mass 1 for each
coordinate, an equality for each bilateral law, friction loss for each friction with a fixed bound, and a sphere in a
plane for each contact. Its kinematics are not used. In the coordinates S⁻¹ u, with M⁻¹ = S Sᵀ, the mass matrix is the
identity, so that J = (Sᵀ W)ᵀ makes J Jᵀ = G. With accelerations instead of velocities, q̈_smooth = 0 and a_ref = −c,
the forces of MuJoCo are the impulses. The data are scaled: G has a diagonal of about 1, and c is at most 1.
"""

import importlib
from typing import Any

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.laws import LawKind
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle
from ...problems.contact.solver import SolverError

TRIED = "4.0"
"""Beginning of the tested versions of MuJoCo."""

MAX_ENTRIES = 4_000_000
"""Largest number of entries of the dense J, and of the matrices of coordinates and of rows."""

MIN_FRICTION = 1e-5
"""MuJoCo's smallest friction coefficient."""


def unsupported_reason(problem: ContactProblem) -> str | None:
    """Return why MuJoCo's rows cannot represent ``problem``, or None."""
    laws = problem.laws
    if laws.is_rolling.any():
        return "MuJoCo has one bound for sliding and rolling friction, but this problem has two"
    bounded = laws.is_friction & (laws.partner < 0)
    if (bounded & (laws.kind != LawKind.PLANAR_FRICTION)).any():
        return "MuJoCo bounds single rows of friction, but this problem has discs with a fixed bound"
    if (laws.fixed_bound[laws.partner >= 0] > 0.0).any():
        return "it has contacts whose friction also has a fixed bound, and MuJoCo has no such cone"
    obstacle = convex_obstacle(problem)
    if obstacle:
        return obstacle
    size = max(problem.n_rows, problem.factors.n_dofs if problem.factors is not None else 0) ** 2
    if size > MAX_ENTRIES:
        return f"its dense matrices have {size} entries, more than {MAX_ENTRIES}"
    if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
        return "G is not symmetric"
    return None


class ConstraintStage:
    """MuJoCo's constraint stage, filled with one problem.

    Args:
        problem: a supported problem.
        algorithm: ``"Newton"``, ``"CG"`` or ``"PGS"``.
        impedance: d, with R = (1 − d)/d α.
    """

    def __init__(self, problem: ContactProblem, algorithm: str, impedance: float) -> None:
        self._mujoco = importlib.import_module("mujoco")
        laws, directions = problem.laws, _directions(problem)
        mass = float(np.mean(problem.delassus_diagonal)) or 1.0
        self._speed = float(np.abs(problem.free_velocity).max(initial=0.0)) or 1.0
        self._impulse = self._speed / mass
        bilateral = np.flatnonzero(laws.is_bilateral)
        bounded = np.flatnonzero(laws.is_friction & (laws.partner < 0))
        normal = np.flatnonzero(laws.is_unilateral)
        follower = np.append(laws.partner, -1)[normal + 1] == normal
        friction = np.where(follower, np.append(laws.friction_coefficient, 0.0)[normal + 1], 0.0)
        n_dofs = max(directions.shape[0], len(bounded), 1)
        bounds = laws.fixed_bound[bounded] / self._impulse
        self._model = self._mujoco.MjModel.from_xml_string(
            _model_text(n_dofs, len(bilateral), len(bounded), follower.tolist(), problem.n_rows + len(normal))
        )
        self._data = self._mujoco.MjData(self._model)
        self._model.opt.solver = getattr(self._mujoco.mjtSolver, f"mjSOL_{algorithm.upper()}")
        if algorithm == "PGS":  # it would start from the forces of the accelerations, which stiffness magnifies
            self._model.opt.disableflags |= self._mujoco.mjtDisableBit.mjDSBL_WARMSTART
        self._rows = self._rows_of(laws, bilateral, bounded, normal, follower)
        self._fill(problem, directions / np.sqrt(mass), impedance, friction, bounds)

    def _rows_of(self, laws: Any, bilateral: Any, bounded: Any, normal: Any, follower: Any) -> Any:
        """Return the row of the problem for each row of MuJoCo; −1 for the second tangent of planar friction."""
        singles = laws.first_row[np.concatenate([bilateral, bounded])].tolist()
        for law, has_friction in zip(normal.tolist(), follower.tolist(), strict=True):
            first = int(laws.first_row[law])
            count = int(laws.row_count[law + 1]) if has_friction else 0
            singles += [first, *range(first + 1, first + 1 + count), *([-1] if count == 1 else [])]
        return np.array(singles, dtype=np.int64)

    def _fill(
        self,
        problem: ContactProblem,
        directions: FloatArray,
        impedance: float,
        friction: FloatArray,
        bounds: FloatArray,
    ) -> None:
        module, model, data, rows = self._mujoco, self._model, self._data, self._rows
        for stage in (module.mj_fwdPosition, module.mj_fwdVelocity, module.mj_fwdActuation, module.mj_fwdAcceleration):
            stage(model, data)
        if data.nefc != len(rows):
            raise SolverError(f"MuJoCo created {data.nefc} rows for {len(rows)} rows of {problem.name!r}.")
        columns = np.concatenate([directions, np.zeros((len(directions), 1))], axis=1)[:, rows]
        jacobian = np.zeros((len(rows), model.nv))
        jacobian[:, : len(directions)] = columns.T
        alpha = np.einsum("ij,ij->i", jacobian, jacobian)
        for index in range(data.ncon):
            contact = data.contact[index]
            first, dim = int(contact.efc_address), int(contact.dim)
            alpha[first : first + dim] = alpha[first : first + dim].max()
            if dim > 1:
                contact.mu = max(float(friction[index]), MIN_FRICTION)
                contact.friction[:2] = contact.mu
        data.efc_J[:] = jacobian.ravel()
        data.efc_R[:] = (1.0 - impedance) / impedance * np.where(alpha > 0.0, alpha, 1.0)
        data.efc_D[:] = 1.0 / data.efc_R
        data.efc_aref[:] = -np.append(problem.free_velocity, 0.0)[rows] / self._speed
        data.efc_frictionloss[data.ne : data.ne + data.nf] = bounds
        data.qacc_smooth[:] = data.qfrc_smooth[:] = 0.0
        if len(data.efc_AR):
            data.efc_AR[:] = (jacobian @ jacobian.T + np.diag(data.efc_R)).ravel()
            data.efc_b[:] = -data.efc_aref
        self._jacobian = jacobian

    def solve(self, impulses: FloatArray, tolerance: float, iterations: int) -> tuple[FloatArray, int]:
        """Return impulses [N s] and the number of iterations, from the accelerations that given impulses cause."""
        model, data, rows = self._model, self._data, self._rows
        model.opt.tolerance, model.opt.iterations = tolerance, iterations
        start = np.append(impulses / self._impulse, 0.0)[rows]
        data.qacc_warmstart[:] = self._jacobian.T @ start
        self._mujoco.mj_fwdConstraint(model, data)
        found = np.zeros(len(impulses) + 1)
        found[rows] = data.efc_force
        return found[:-1] * self._impulse, int(data.solver_niter.sum())


def _directions(problem: ContactProblem) -> FloatArray:
    """Return a dense W̃ with G = W̃ᵀ W̃, shape (n_dofs, n_rows)."""
    if problem.factors is not None:
        dense: FloatArray = problem.factors.scaled_directions.toarray()
        return dense
    values, vectors = np.linalg.eigh(problem.delassus().toarray())
    root: FloatArray = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return root


def _model_text(n_dofs: int, n_equalities: int, n_bounded: int, has_friction: list[bool], n_rows: int) -> str:
    """Return the XML text of a model with these numbers of coordinates and constraint rows."""
    megabytes = 64 + 8 * 6 * (n_dofs + n_rows) ** 2 // 2**20
    spheres = "".join(
        f'<geom size="0.1" pos="{index} 0 0.05" condim="{3 if slides else 1}" priority="1" conaffinity="0"/>'
        for index, slides in enumerate(has_friction)
    )
    bodies = "".join(
        f'<body><joint name="j{index}" type="slide" frictionloss="{int(index < n_bounded)}"/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{spheres if index == 0 else ""}</body>'
        for index in range(n_dofs)
    )
    equalities = n_equalities * '<joint joint1="j0"/>'
    return (
        f'<mujoco><size memory="{megabytes}M"/><option cone="elliptic" jacobian="dense" gravity="0 0 0">'
        '<flag island="disable"/></option><worldbody><geom type="plane" size="1 1 1" contype="0"/>'
        f"{bodies}</worldbody><equality>{equalities}</equality></mujoco>"
    )
