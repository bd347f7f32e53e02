"""A bouncing ball given by functions, with the height of its centre as the only coordinate."""

import numpy as np
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.state import State


def general_system(ball: BouncingBall) -> MechanicalSystem:
    mass, weight = np.array([[ball.mass]]), np.array([-ball.mass * ball.gravity])
    return MechanicalSystem(
        mass=lambda position: mass,
        force=lambda position, velocity: weight,
        gap=lambda position: position - ball.radius,
        directions=lambda position: np.ones((1, 1)),
        friction=[0.0],
        restitution_normal=[ball.restitution],
        restitution_tangential=[0.0],
        rows_per_contact=1,
    )


def general_start(ball: BouncingBall) -> State:
    return State(0.0, np.array([ball.radius + ball.height]), np.zeros(1))
