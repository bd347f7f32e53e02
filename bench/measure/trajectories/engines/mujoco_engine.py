"""MuJoCo: a scene as a model, stepped by ``mj_step``; judged steps are also judged under MuJoCo's own model."""

import copy
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from .....problems.capture.step import captured_step
from .....problems.engine_model import judge_own_model
from .description import BodyStates, Description
from .solved_problem import SolvedProblem, solved_problem

STIFF_IMPEDANCE = "0.99 0.9999 0.0001"
"""Value of ``solimp`` of stiff contacts: smallest and largest impedance, and the width of the transition [m]."""


class MuJoCoEngine:
    """A scene in MuJoCo; options: ``cone``, ``impratio``, ``solver``, ``iterations``, ``tolerance``, ``stiff``."""

    def __init__(self, description: Description, time_step: float, options: dict[str, Any]) -> None:
        self.library = import_module("mujoco")
        self.description = description
        self.model = self.library.MjModel.from_xml_string(model_xml(description, time_step, options))
        self.data = self.library.MjData(self.model)
        velocities = self.data.qvel.reshape(-1, 6)
        velocities[:, :3] = description.start().velocities

    def step(self) -> None:
        """Advance by one step."""
        self.library.mj_step(self.model, self.data)

    def states(self) -> BodyStates:
        """Return the states of all bodies; MuJoCo's angular velocities are in the axes of the body."""
        positions = self.data.qpos.reshape(-1, 7)
        velocities = self.data.qvel.reshape(-1, 6)
        rotations = np.array([self._rotation(quaternion) for quaternion in positions[:, 3:]])
        spins = np.einsum("bij,bj->bi", rotations, velocities[:, 3:])
        return BodyStates(positions[:, :3].copy(), velocities[:, :3].copy(), spins)

    def store_state(self) -> None:
        """Store the state before a step."""
        self._before, self._data_before = self.states(), copy.copy(self.data)

    def solved_problem(self) -> SolvedProblem | None:
        """Return the problem of the last step; its contacts are those of the previous state."""
        data, step = self.data, self.model.opt.timestep
        force, impulses = np.zeros(6), np.zeros((self.data.ncon, 3))
        for k in range(data.ncon):
            self.library.mj_contactForce(self.model, data, k, force)
            impulses[k] = step * force[:3]
        owners = self.model.geom_bodyid[data.contact.geom].reshape(-1, 2) - 1  # the world is body 0 of MuJoCo
        frames = data.contact.frame.reshape(-1, 3, 3)
        contacts = {
            "body_1": owners[:, 0],
            "body_2": owners[:, 1],
            "point": data.contact.pos,
            "normal": frames[:, 0],
            "tangent": frames[:, 1],
            "distance": data.contact.dist,
        }
        solved = solved_problem(self.description, self._before, step, contacts, impulses)
        return None if solved is None else replace(solved, own_residual=self._own_residual())

    def _own_residual(self) -> float:
        """Return the residual of the last forces under MuJoCo's own model, captured from a copy of the data."""
        step = captured_step(self.model, self._data_before)
        return judge_own_model(step.engine, self.data.efc_force)

    def _rotation(self, quaternion: Any) -> Any:
        matrix = np.zeros(9)
        self.library.mju_quat2Mat(matrix, quaternion)
        return matrix.reshape(3, 3)


build = MuJoCoEngine
"""Builds a scene."""


def model_xml(description: Description, time_step: float, options: dict[str, Any]) -> str:
    """Return the model in MJCF. MuJoCo takes the larger of two friction coefficients, so all are μ."""
    names = ("cone", "impratio", "solver", "iterations", "tolerance")
    solver = {name: options[name] for name in names if name in options}
    contact = f'friction="{description.friction} 0 0" condim="3"'
    if options.get("stiff"):
        contact += f' solref="{2.0 * time_step} 1" solimp="{STIFF_IMPEDANCE}"'
    geoms = ['<geom type="plane" size="0 0 1"/>'] if description.has_floor else []
    for panel in description.panels:
        x, y, z, w = panel.quaternion
        pose = f'pos="{_vector_text(panel.centre)}" quat="{_vector_text((w, x, y, z))}"'
        geoms.append(f'<geom type="box" size="{_vector_text(panel.half_sizes)}" {pose}/>')
    for body in description.bodies:
        shape = (
            f'type="box" size="{_vector_text(3 * [body.half_size])}"' if body.is_cube else f'size="{body.half_size!r}"'
        )
        geom = f'<geom {shape} mass="{body.mass!r}"/>'
        geoms.append(f'<body pos="{_vector_text(body.position)}"><freejoint/>{geom}</body>')
    attributes = " ".join(f'{name}="{value}"' for name, value in solver.items())
    return (
        f'<mujoco><size memory="200M"/><option timestep="{time_step}" gravity="{_vector_text(description.gravity)}" '
        f"{attributes}/><default><geom {contact}/></default><worldbody>{''.join(geoms)}</worldbody></mujoco>"
    )


def _vector_text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
