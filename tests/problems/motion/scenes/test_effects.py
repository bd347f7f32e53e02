"""Omitting an effect gives the same motion as including it at zero strength, with fewer rows or coordinates."""

from collections.abc import Callable

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.balls import SPHERE_INERTIA, BallSystem
from proxbench.problems.motion.bodies.rigid.round_shapes import Sphere
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.scenes.effects import (
    Drag,
    Effect,
    Friction,
    Gravity,
    Planar,
    Restitution,
    Spring,
    ball_system,
)
from proxbench.problems.motion.scenes.rigid.effects import rigid_bodies
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

N = 12
FLOOR = Plane((0.0, 0.0, 0.0), (0.1, 0.2, 1.0))


def motion(effects: list[Effect], steps: int = 150) -> tuple[np.ndarray, BallSystem, int]:
    """Return the centres over time, the system, and the total number of rows of all problems."""
    system = ball_system(np.full(N, 0.1), np.ones(N), [FLOOR], effects)
    grid = np.stack(np.meshgrid(np.arange(3), np.arange(2), np.arange(2), indexing="ij"), -1).reshape(-1, 3)
    centres = 0.195 * grid + np.array([0.0, 0.0, 0.3]) + 0.003 * np.random.default_rng(0).normal(size=(N, 3))
    start = State(0.0, centres.ravel(), system.without_spin(np.tile([0.3, 0.0, -1.0], (N, 1))))
    centres_over_time, rows = [], 0
    for step in MidpointRule(system, create("SORprox"), Stop(1e-13, 20_000), 2e-3).steps(start, steps):
        centres_over_time.append(step.state.position)
        rows += 0 if step.problem is None else step.problem.n_rows
    return np.array(centres_over_time), system, rows


@pytest.mark.parametrize(
    ("present", "absent"),
    [
        ([Gravity(0.0), Restitution(0.2)], [Restitution(0.2)]),
        ([Gravity(), Drag(0.0)], [Gravity()]),
        ([Gravity(), Spring(0.0, (0.0, 0.0, 0.0))], [Gravity()]),
        ([Gravity(), Restitution(0.0, 0.0)], [Gravity()]),
    ],
)
def test_effect_of_zero_strength_does_not_change_the_motion(present: list[Effect], absent: list[Effect]) -> None:
    with_effect, _, rows = motion(present)
    without, _, fewer = motion(absent)
    assert rows == fewer > 0
    assert np.abs(with_effect - without).max() <= 1e-10


def test_removing_friction_equals_zero_friction_with_fewer_rows_and_coordinates() -> None:
    with_effect, spinning, rows = motion([Gravity(), Friction(0.0)])
    without, plain, fewer = motion([Gravity()])
    assert np.abs(with_effect - without).max() <= 1e-10
    assert rows == 3 * fewer > 0
    assert (spinning.dofs_per_ball, plain.dofs_per_ball) == (6, 3)


def test_planar_motion_equals_spatial_motion_in_a_plane() -> None:
    """The centres of the balls lie in the plane y = 0, and their inertia is that of balls; x and z agree."""
    centres = np.array([[0.0, 0.35], [0.15, 0.5], [0.05, 0.7]])
    ends, rows = [], []
    for dimension in (2, 3):
        effects: list[Effect] = [Gravity(), Friction(0.4), Restitution(0.3)]
        if dimension == 2:
            effects.append(Planar(inertia_factor=SPHERE_INERTIA))
        floor = Plane((0.0,) * dimension, (0.2, *[0.0] * (dimension - 2), 1.0))
        system = ball_system(np.full(3, 0.1), np.ones(3), [floor], effects)
        position = centres if dimension == 2 else np.insert(centres, 1, 0.0, axis=1)
        state = State(0.0, position.ravel(), system.without_spin(np.zeros((3, dimension))))
        count = 0
        for step in MidpointRule(system, create("SORprox"), Stop(1e-13, 20_000), 1e-3).steps(state, 400):
            state = step.state
            count += 0 if step.problem is None else step.problem.n_rows
        ends.append(system.centres(state.position)[:, [0, -1]])
        rows.append(count)
    assert np.abs(ends[0] - ends[1]).max() <= 1e-9
    assert 3 * rows[0] == 2 * rows[1] > 0


def test_each_effect_of_nonzero_strength_changes_the_motion() -> None:
    still, _, _ = motion([Gravity()])
    for effect in (Drag(1.0), Spring(5.0, (0.0, 0.0, 0.0)), Friction(0.3), Restitution(0.5)):
        moved, _, _ = motion([Gravity(), effect])
        assert np.abs(moved - still).max() > 1e-4


def test_duplicate_effect_is_refused() -> None:
    with pytest.raises(ProblemError, match="Gravity"):
        ball_system(np.ones(1), np.ones(1), [], [Gravity(), Gravity(1.0)])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Gravity(float("nan")), "acceleration of gravity must be a finite number, got nan"),
        (lambda: Drag(float("nan")), "coefficient of drag must be a finite number that is not negative, got nan"),
        (lambda: Drag(-100.0), "coefficient of drag must be a finite number that is not negative, got -100.0"),
        (lambda: Spring(1.0, (0.0, float("inf"))), "stiffness and anchor of a spring must be finite"),
    ],
)
def test_a_force_that_is_no_number_or_drives_bodies_is_refused(make: Callable[[], Effect], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make()


def test_a_plane_is_only_for_balls() -> None:
    with pytest.raises(ProblemError, match="only balls can move in a plane; omit Planar"):
        rigid_bodies([Sphere(0.1)], np.ones(1), [], [Planar()])  # type: ignore[list-item]
