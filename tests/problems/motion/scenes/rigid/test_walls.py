"""A wall of bricks stands, and falls if a ball hits it."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.equilibrium import find_equilibrium, problem_at_rest
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.walls import BrickWall
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create


@pytest.mark.parametrize("friction", [0.0, 0.6])
@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 3), (5, 4)])
def test_the_equilibrium_of_a_wall_exists_whatever_its_friction(rows: int, columns: int, friction: float) -> None:
    wall = BrickWall(rows, columns, speed=0.0, friction=friction)
    problem = problem_at_rest(wall.system(), wall.start())
    assert find_equilibrium(problem).can_stand
    long, short = columns * ((rows + 1) // 2), rows // 2
    assert wall.system().n_bodies == long + short * (columns + 1)
    on_ground = 4 * columns
    halves_and_bricks = 4 * 2 * columns * (rows - 1)  # each upper brick rests on two, a half brick on one
    assert problem.n_contacts == on_ground + halves_and_bricks


@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_a_wall_stands_unstruck_whatever_its_friction(friction: float) -> None:
    wall = BrickWall(speed=0.0, friction=friction)
    rule = MidpointRule(wall.system(), create("Robust"), Stop(1e-10, 20_000), 1e-3)
    for step in rule.steps(wall.start(), 100):
        assert step.status is Status.SOLVED
        assert wall.largest_displacement(step.state) <= 1e-9


@pytest.mark.slow
def test_a_struck_wall_loses_bricks_and_its_energy_never_grows() -> None:
    wall = BrickWall(rows=4, columns=3)
    system, start = wall.system(), wall.start()
    assert system.potential_energy is not None
    rule = MidpointRule(system, create("Robust"), Stop(1e-6, 20_000), 1e-3)
    energies, momenta = [], []
    for step in rule.steps(start, 150):
        energies.append(system.kinetic_energy(step.state.velocity) + system.potential_energy(step.state.position))
        momenta.append(float(system.masses @ system.twists(step.state.velocity)[:, 1]))
    assert np.diff(energies).max() <= 0.0
    assert energies[-1] < 0.9 * energies[0]
    assert wall.largest_displacement(step.state) > 0.1
    given = system.masses[-1] * wall.speed
    assert 0.0 < momenta[-1] < given  # friction of the ground removes momentum


def test_a_ball_whose_weight_moves_nothing_leaves_the_wall_its_momentum_at_the_impact() -> None:
    """In the step of the impact, momentum along y is conserved except for the friction of the lowest bricks."""
    wall = BrickWall(friction=0.0)
    system = wall.system()
    rule = MidpointRule(system, create("Robust"), Stop(1e-10, 50_000), 1e-3)
    for step in rule.steps(wall.start(), 2):
        momentum = float(system.masses @ system.twists(step.state.velocity)[:, 1])
        assert momentum == pytest.approx(system.masses[-1] * wall.speed, rel=1e-9)
    assert step.state.velocity[-5] < 0.9 * wall.speed


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("rows=0", "rows of a wall"),
        ("size=(0.1, 0.2, -0.1)", r"size\[2\] of a box must be"),
        ("speed=-1.0", "0 omits the ball"),
        ("overlap=0.05", "tenth of the height"),
        ("rows=1", "reduce its radius"),
    ],
)
def test_a_wall_out_of_range_is_refused(options: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make_scene(f"brick_wall({options})")


def test_the_scene_observes_the_largest_displacement_of_a_brick_not_of_the_ball() -> None:
    scene = make_scene("brick_wall")
    moved = scene.observables[0]
    position = scene.start.position.copy()
    position[-6] += 5.0
    assert moved.compute(type(scene.start)(0.0, position, scene.start.velocity)) == 0.0
    position[0] += 0.25
    assert moved.compute(type(scene.start)(0.0, position, scene.start.velocity)) == pytest.approx(0.25)
