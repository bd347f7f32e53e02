"""MuJoCo's constraint stage, filled with a convex program.

The model has the required numbers of coordinates and constraint rows: a slide joint of mass 1 for each coordinate, an
equality for each bilateral law, a friction loss for each friction law with a fixed bound, and a sphere on a plane for
each contact. Its kinematics are not used.
"""

import importlib
from time import perf_counter

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import SolverError
from .mujoco_program import ConeProgram

TESTED_VERSION = "4.0"
"""Prefix of the tested versions of MuJoCo."""


class ConstraintStage:
    """MuJoCo's constraint stage, filled with one program.

    Args:
        program: the program.
        algorithm: ``"Newton"``, ``"CG"`` or ``"PGS"``.
    """

    def __init__(self, program: ConeProgram, algorithm: str) -> None:
        self._mujoco, self._program = importlib.import_module("mujoco"), program
        self._model = self._mujoco.MjModel.from_xml_string(_model_text(program))
        self._data = self._mujoco.MjData(self._model)
        self._model.opt.solver = getattr(self._mujoco.mjtSolver, f"mjSOL_{algorithm.upper()}")
        if algorithm == "PGS":
            # PGS would start from forces computed from accelerations, and stiffness amplifies their errors
            self._model.opt.disableflags |= self._mujoco.mjtDisableBit.mjDSBL_WARMSTART
        self._fill()

    def _fill(self) -> None:
        module, model, data, program = self._mujoco, self._model, self._data, self._program
        for stage in (module.mj_fwdPosition, module.mj_fwdVelocity, module.mj_fwdActuation, module.mj_fwdAcceleration):
            stage(model, data)
        n_rows = len(program.reference)
        if data.nefc != n_rows:
            raise SolverError(f"MuJoCo created {data.nefc} rows for a program of {n_rows} rows.")
        jacobian = np.zeros((n_rows, model.nv))
        jacobian[:, : program.jacobian.shape[1]] = program.jacobian
        data.efc_R[:] = program.regularisation
        for index, dim in enumerate(program.dims):
            contact = data.contact[index]
            first = int(contact.efc_address)
            if dim > 1:
                contact.friction[: dim - 1] = program.coefficient[first + 1 : first + dim]
                contact.mu = contact.friction[0] * np.sqrt(data.efc_R[first + 1] / data.efc_R[first])
        data.efc_J[:] = jacobian.ravel()
        data.efc_D[:] = 1.0 / data.efc_R
        data.efc_aref[:] = program.reference
        data.efc_frictionloss[data.ne : data.ne + data.nf] = program.bounds
        data.qacc_smooth[:] = data.qfrc_smooth[:] = 0.0
        if len(data.efc_AR):
            data.efc_AR[:] = (jacobian @ jacobian.T + np.diag(data.efc_R)).ravel()
            data.efc_b[:] = -data.efc_aref
        self._jacobian = jacobian

    def start(self, impulses: FloatArray) -> None:
        """Make the next solve start from the accelerations that ``impulses`` [N s] cause."""
        self._data.qacc_warmstart[:] = self._jacobian.T @ self._program.forces(impulses)

    def run(self, tolerance: float, iterations: int) -> float:
        """Solve the program, and return the wall time of ``mj_fwdConstraint`` alone [s]."""
        solve, model, data = self._mujoco.mj_fwdConstraint, self._model, self._data
        model.opt.tolerance, model.opt.iterations = tolerance, iterations
        start_time = perf_counter()
        solve(model, data)
        return perf_counter() - start_time

    @property
    def impulses(self) -> FloatArray:
        """The impulses that the last solve found [N s]."""
        return self._program.impulses(self._data.efc_force)

    @property
    def iterations(self) -> int:
        """Number of iterations of the last solve."""
        return int(self._data.solver_niter.sum())


def _model_text(program: ConeProgram) -> str:
    """Return the XML text of a model with the numbers of coordinates and constraint rows of a program."""
    n_bounded, n_rows = len(program.bounds), len(program.reference)
    n_dofs = max(program.jacobian.shape[1], n_bounded, 1)
    megabytes = 64 + 8 * 6 * (n_dofs + n_rows) ** 2 // 2**20
    spheres = "".join(
        f'<geom size="0.1" pos="{index} 0 0.05" condim="{dim}" priority="1" conaffinity="0"/>'
        for index, dim in enumerate(program.dims)
    )
    bodies = "".join(
        f'<body><joint name="j{index}" type="slide" frictionloss="{int(index < n_bounded)}"/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{spheres if index == 0 else ""}</body>'
        for index in range(n_dofs)
    )
    equalities = program.n_equalities * '<joint joint1="j0"/>'
    return (
        f'<mujoco><size memory="{megabytes}M"/><option cone="elliptic" jacobian="dense" gravity="0 0 0">'
        '<flag island="disable"/></option><worldbody><geom type="plane" size="1 1 1" contype="0"/>'
        f"{bodies}</worldbody><equality>{equalities}</equality></mujoco>"
    )
