"""A mechanism names the moving parts: pairs of bodies in contact, and bodies without contacts."""

import numpy as np
from proxbench.problems.motion.equilibrium import find_equilibrium, problem_at_rest
from proxbench.problems.motion.mechanism import contact_motions, free_bodies, mechanism_text
from proxbench.problems.motion.scenes.resting import Stack
from proxbench.problems.motion.scenes.rigid.walls import BrickWall


def test_a_ball_in_the_air_is_named_and_the_wall_below_it_stands() -> None:
    """The bricks move only as far as the accuracy of the cone program allows."""
    wall = BrickWall()
    problem = problem_at_rest(wall.system(), wall.start())
    found = find_equilibrium(problem)
    ball = wall.system().n_bodies - 1
    assert free_bodies(problem, found.mechanism) == [ball]
    assert mechanism_text(problem, found.mechanism) == f"without contacts: {ball}"


def test_motion_is_relative_to_the_fall_not_to_the_residue_of_the_cone_program() -> None:
    """A contact counts if it opens with at least a millionth of the free velocity c."""
    scene = Stack((1.0, 1.0), None)
    problem = problem_at_rest(scene.system(), scene.start())
    fall = np.abs(problem.free_velocity).max()
    for share, opens in ((1e-7, False), (1e-5, True)):
        velocity = scene.system().translation(np.array([0.0, 0.0, share * fall]))
        assert contact_motions(problem, velocity)[1].any() == opens
