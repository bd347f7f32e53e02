"""Linked bodies with solutions in closed form: hanging and towed chains, loops with redundant joints, pendulums.

Joints are rows of bilateral laws, two for each pin in the plane. Every solution has ξ = 0 in these rows. If the
motion u is known, so is the momentum that the joints transfer, W Λ = M (u − u_f), even if Λ is not unique.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.laws import Laws
from ..contact.problem import ContactProblem
from .bodies import WEIGHT, body_problem, box_friction_impulses


def chain(masses: FloatArray, pull: float = 0.0) -> ContactProblem:
    """Return a hanging chain of slender links of 1 m with ``masses`` [kg], listed from the top.

    The tension at the top of link k is g Δt Σ_{j≥k} m_j + ``pull`` [N s], where ``pull`` acts on the last link. The
    chain is straight, without transverse forces. q = (x, y, φ) of each link; rows (x, y) of each pin.
    """
    n = len(masses)
    directions = sp.lil_array((3 * n, 2 * n))
    for link in range(n):
        for pin, sign in ((link, 1.0), (link + 1, -1.0)):
            if pin < n:  # the upper end of a link has the velocity ẋ − φ̇/2, the lower ẋ + φ̇/2
                directions[3 * link, 2 * pin], directions[3 * link + 2, 2 * pin] = sign, -0.5
                directions[3 * link + 1, 2 * pin + 1] = sign
    inverse_mass = np.column_stack([1.0 / masses, 1.0 / masses, 12.0 / masses]).ravel()
    motion = np.tile([0.0, -WEIGHT, 0.0], n)
    motion[-2] -= pull / masses[-1]
    impulses = np.zeros((n, 2))
    impulses[:, 1] = WEIGHT * np.cumsum(masses[::-1])[::-1] + pull
    answer = Answer(impulses=(impulses.ravel(),), velocity=np.zeros(2 * n), sensitivity=10.0 * n * n)
    return _joint_problem(directions, inverse_mass, motion, answer)


def parallelogram(cranks: int, angle: float = 0.7) -> ContactProblem:
    """Return parallel cranks between the ground and a coupler, all of 1 kg and 1 m, that fall from rest.

    Two cranks form a four-bar loop. Each further crank adds four rows and three degrees of freedom but does not
    restrict the motion, so one more row is redundant. The cranks make ``angle`` [rad] with the horizontal. With
    the velocities J of all bodies at a unit angular velocity of the cranks, their angular velocity is
    ω = JᵀM u_f/JᵀMJ.
    """
    tangent = np.array([-np.sin(angle), np.cos(angle)])
    n_dofs, coupler = 3 * (cranks + 1), 3 * cranks
    directions, motion = np.zeros((n_dofs, 4 * cranks)), np.tile([0.0, -WEIGHT, 0.0], cranks + 1)
    unit_motion = np.zeros(n_dofs)
    pin_offsets = np.linspace(-0.5, 0.5, cranks)  # along the coupler from its centre of mass
    for crank in range(cranks):
        dof, pins = 3 * crank, 4 * crank
        for axis in (0, 1):
            directions[dof + axis, pins + axis] = 1.0
            directions[dof + 2, pins + axis] = -0.5 * tangent[axis]
            directions[dof + axis, pins + 2 + axis] = 1.0
            directions[dof + 2, pins + 2 + axis] = 0.5 * tangent[axis]
            directions[coupler + axis, pins + 2 + axis] = -1.0
        directions[coupler + 2, pins + 3] = -pin_offsets[crank]
        unit_motion[dof : dof + 3] = 0.5 * tangent[0], 0.5 * tangent[1], 1.0
    unit_motion[coupler : coupler + 2] = tangent
    mass = np.tile([1.0, 1.0, 1.0 / 12.0], cranks + 1)
    velocity = unit_motion * (unit_motion @ (mass * motion) / (unit_motion @ (mass * unit_motion)))
    return _joint_problem(directions, 1.0 / mass, motion, _momentum_answer(directions, mass * (velocity - motion)))


def pendulum(copies: int) -> ContactProblem:
    """Return a horizontal rod of 1 kg and 1 m, released from rest, with ``copies`` equal pins at one end.

    The rod rotates at ω = −3/2 g Δt / 1 m, and the pins bear a quarter of its weight.
    """
    pin = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -0.5]])
    directions, mass = np.tile(pin, copies), np.array([1.0, 1.0, 1.0 / 12.0])
    motion, velocity = np.array([0.0, -WEIGHT, 0.0]), WEIGHT * np.array([0.0, -0.75, -1.5])
    return _joint_problem(directions, 1.0 / mass, motion, _momentum_answer(directions, mass * (velocity - motion)))


def towed_wheel(n: int, pull: float, friction: float = 0.5, rolling_friction: float = 0.02) -> ContactProblem:
    """Return a wheel of 1 kg on the ground, towed from rest by a line of ``n`` bodies of 1/n kg at its axle.

    The first body is pulled with ``pull`` [N s]. The wheel is a disc of radius 0.1 m with rows N, T, R. It slides,
    rolls, does both or rests. Λ_N is m g Δt of the wheel, so |Λ_T| ≤ μ Λ_N and |Λ_R| ≤ μ_r Λ_N form a box. A joint
    transmits the momentum of all bodies behind it. q = positions of the bodies, then (x, y, φ) of the wheel.
    """
    radius, inertia, mass = 0.1, 0.005, 1.0 / n
    directions = np.zeros((n + 3, n + 3))
    for joint in range(n):
        directions[joint, joint], directions[joint + 1, joint] = 1.0, -1.0
    directions[n + 1, n] = 1.0  # N
    directions[n, n + 1], directions[n + 2, n + 1], directions[n + 2, n + 2] = 1.0, -radius, 1.0  # T, R
    motion = np.zeros(n + 3)
    motion[0], motion[n + 1] = pull / mass, -WEIGHT
    total_mass = 2.0  # line and wheel move as one body
    delassus = np.array(
        [[1.0 / total_mass + radius**2 / inertia, -radius / inertia], [-radius / inertia, 1.0 / inertia]]
    )
    bounds = WEIGHT * np.array([friction, rolling_friction])
    friction_impulses = box_friction_impulses(delassus, np.array([pull / total_mass, 0.0]), bounds)
    speed = (pull + friction_impulses[0]) / total_mass
    mass_behind = 1.0 - mass * np.arange(1, n + 1) + 1.0  # of each joint: the rest of the line, and the wheel
    impulses = np.concatenate([friction_impulses[0] - mass_behind * speed, [WEIGHT], friction_impulses])
    laws = Laws.concatenate(
        [Laws.joints(n), Laws.contacts(np.array([friction]), 2, 1).with_rolling(rolling_friction, 1)]
    )
    inverse_mass = np.append(np.full(n, 1.0 / mass), [1.0, 1.0, 1.0 / inertia])
    velocity = directions.T @ (inverse_mass * (directions @ impulses) + motion)
    velocity[: n + 1] = 0.0
    answer = Answer(impulses=(impulses,), velocity=velocity, sensitivity=100.0 * n * n)
    return body_problem(directions, inverse_mass, motion, laws=laws, answer=answer)


def immovable_joint() -> ContactProblem:
    """Return a joint that a body can close, and one without a solution: its walls separate at 1 m/s, and G_ii = 0."""
    laws = Laws.joints(2)
    return ContactProblem.from_delassus(np.diag([1.0, 0.0]), np.ones(2), laws=laws, answer=Answer(solvable=False))


def _momentum_answer(directions: FloatArray, momentum: FloatArray) -> Answer:
    """Return the answer of joints with W Λ = ``momentum`` [N s], shape (n_dofs,)."""
    return Answer(velocity=np.zeros(directions.shape[1]), functionals=directions, values=momentum)


def _joint_problem(matrix: Any, inverse_mass: FloatArray, motion: FloatArray, answer: Answer) -> ContactProblem:
    """Return a problem with joints only, W dense or scipy sparse."""
    directions = sp.csc_array(matrix)
    return body_problem(directions, inverse_mass, motion, laws=Laws.joints(directions.shape[1]), answer=answer)
