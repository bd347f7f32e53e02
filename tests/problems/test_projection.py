"""Projection of positions: to the depth that is allowed, the nearest way, and without touching velocities."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.balls import BallSystem
from proxbench.problems.moreau import Moreau, State
from proxbench.problems.scenes.effects import Gravity, Restitution, ball_system
from proxbench.problems.surfaces import Plane
from proxbench.solvers import Stop, create

RADIUS, DEPTH = 0.01, 1e-4


def floor(n_balls: int, masses: np.ndarray | None = None, gravity: float = 9.81) -> BallSystem:
    weights = np.full(n_balls, 0.01) if masses is None else masses
    plane = [Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
    return ball_system(np.full(n_balls, RADIUS), weights, plane, (Gravity(gravity), Restitution(0.0)))


def stepper(system: BallSystem, depth: float | None) -> Moreau:
    return Moreau(system, create("SORprox"), Stop(1e-10, 10_000, np.inf), 5e-4, depth=depth)


def test_a_ball_that_stays_deep_without_projection_is_lifted_to_the_allowed_depth_with_it() -> None:
    system = floor(1)
    start = State(0.0, np.array([0.0, 0.0, 0.9 * RADIUS]), system.at_rest(np.zeros((1, 3))))
    deep, lifted = (list(stepper(system, depth).steps(start, 10))[-1].state for depth in (None, DEPTH))
    assert deep.position[2] == pytest.approx(0.9 * RADIUS, abs=1e-5)
    assert lifted.position[2] == pytest.approx(RADIUS - DEPTH, abs=0.11 * DEPTH)
    assert np.array_equal(deep.velocity, lifted.velocity)


def test_bodies_part_in_inverse_proportion_to_their_masses() -> None:
    masses = np.array([0.01, 0.03])
    system = floor(2, masses, gravity=0.0)
    centres = np.array([[0.0, 0.0, 1.0], [1.8 * RADIUS, 0.0, 1.0]])
    end = stepper(system, DEPTH).step(State(0.0, centres.ravel(), system.at_rest(np.zeros((2, 3))))).state
    moved = end.position.reshape(2, 3) - centres
    assert moved[0, 0] < 0.0 < moved[1, 0]
    assert masses @ moved == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.linalg.norm(np.diff(end.position.reshape(2, 3), axis=0)) == pytest.approx(2 * RADIUS - DEPTH, abs=2e-5)


def test_a_stack_that_overlaps_everywhere_comes_apart() -> None:
    system = floor(5)
    heights = 0.9 * RADIUS + 1.8 * RADIUS * np.arange(5)
    centres = np.column_stack([np.zeros((5, 2)), heights])
    start = State(0.0, centres.ravel(), system.at_rest(np.zeros((5, 3))))
    last = list(stepper(system, DEPTH).steps(start, 30))[-1]
    assert last.contacts is not None
    assert len(last.contacts.keys) == 5
    assert -last.contacts.gap.min() <= 1.2 * DEPTH
    # at rest but for what the solver leaves
    assert np.abs(last.state.velocity).max() <= 1e-6


def test_what_is_not_too_deep_is_left_in_the_same_bits() -> None:
    system = floor(1)
    start = State(0.0, np.array([0.0, 0.0, RADIUS - 0.5 * DEPTH]), system.at_rest(np.zeros((1, 3))))
    plain, projected = (stepper(system, depth).step(start).state for depth in (None, DEPTH))
    assert plain.position.tobytes() == projected.position.tobytes()


@pytest.mark.parametrize("depth", [0.0, -1.0, float("nan")])
def test_a_depth_out_of_range_is_named(depth: float) -> None:
    with pytest.raises(ProblemError, match="depth"):
        stepper(floor(1), depth)
