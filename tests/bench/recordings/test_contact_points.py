"""Positions of contacts are reconstructed from the force directions alone."""

import numpy as np
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.recordings.contact_points import ContactPoints, find_contact_points, grid_contact_points
from proxbench.problems import ContactProblem, load
from proxbench.problems.arrays import FloatArray
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.stepping.midpoint import step_problem


def heap(dimension: int, friction: float | None) -> tuple[ContactProblem, FloatArray]:
    """Balls of two sizes that barely overlap: a chain on the ground; the problem and its contact points."""
    radii = np.array([0.01, 0.02, 0.01, 0.02, 0.01])
    turns = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.6, 0.8, 0.0]])
    if dimension == 2:
        turns = np.array([[0.0, 1.0], [0.6, 0.8], [-0.6, 0.8], [1.0, 0.0]])
    centres = [np.append(np.zeros(dimension - 1), radii[0] - 1e-12)]
    points = []
    for k, turn in enumerate(turns):
        centres.append(centres[-1] + (radii[k] + radii[k + 1] - 1e-12) * turn)
        points.append(centres[k] + radii[k] * turn)
    ground = Plane((0.0,) * dimension, (*[0.0] * (dimension - 1), 1.0))
    system = BallSystem(radii, np.ones(5), [ground], dimension, friction=friction)
    velocity = system.without_spin(np.zeros((5, dimension)))
    assembly = system.assemble(np.concatenate(centres), velocity, 1e-3)
    assert assembly.contacts is not None
    # keys are ordered by the first ball: its contact with the next one, then that with the ground
    points.insert(1, np.zeros(dimension))
    spatial = np.array(points) if dimension == 3 else np.insert(np.array(points), 1, 0.0, axis=1)
    return step_problem(assembly, assembly.contacts, velocity), spatial


@pytest.mark.parametrize("dimension", [2, 3])
def test_contact_points_of_a_heap_are_recovered_up_to_translation(dimension: int) -> None:
    problem, points = heap(dimension, 0.3)
    found = find_contact_points(problem).positions
    np.testing.assert_allclose(found - found[0], points - points[0], atol=1e-10)


@pytest.mark.parametrize("dimension", [2, 3])
def test_balls_of_a_heap_are_recovered_with_their_radii(dimension: int) -> None:
    contact_points = find_contact_points(heap(dimension, 0.3)[0])
    assert contact_points.bodies is not None
    np.testing.assert_allclose(contact_points.bodies.radii, [0.01, 0.02, 0.01, 0.02, 0.01], rtol=1e-9)
    first = contact_points.bodies.centres[0] - contact_points.positions[1]  # its contact with the ground
    np.testing.assert_allclose(first, [0.0, 0.0, 0.01], atol=1e-10)
    assert len(contact_points.bodies.arms) == 0
    assert "5 balls" in contact_points.origin


def test_balls_in_contact_touch() -> None:
    contact_points = find_contact_points(load("pile-100"))
    assert contact_points.bodies is not None
    depth = (
        np.linalg.norm(contact_points.positions[:, None] - contact_points.bodies.centres[None], axis=2)
        - contact_points.bodies.radii
    )
    assert np.abs(depth).min(axis=1).max() < 1e-9  # every contact lies on a ball


def with_inertia(problem: ContactProblem, factor: float) -> ContactProblem:
    """The same contacts, of bodies with ``factor`` times the moments of inertia."""
    assert problem.factors is not None
    inverse = problem.factors.inverse_mass.matrix.diagonal().reshape(-1, 6)
    inverse[:, 3:] /= factor
    factors = problem.factors.force_directions
    return ContactProblem.from_factors(factors, inverse.ravel(), problem.free_velocity, 0.3)


@pytest.mark.parametrize(("factor", "balls"), [(1.0, 5), (0.5, 5), (1.1, 0)])
def test_body_of_larger_inertia_than_a_uniform_ball_is_not_drawn_as_a_ball(factor: float, balls: int) -> None:
    bodies = find_contact_points(with_inertia(heap(3, 0.3)[0], factor)).bodies
    assert bodies is not None
    assert bodies.is_ball.sum() == balls


def test_bodies_of_unknown_shape_are_joined_to_their_contacts() -> None:
    contact_points = find_contact_points(load("hard-sticking-box"))
    assert contact_points.bodies is not None
    assert not contact_points.bodies.is_ball.any()
    np.testing.assert_allclose(
        contact_points.bodies.arms[:, 0], np.tile(contact_points.bodies.centres, (4, 1)), atol=1e-12
    )
    np.testing.assert_allclose(contact_points.bodies.arms[:, 1], contact_points.positions, atol=1e-12)
    assert "1 body of unknown shape" in contact_points.origin


def test_balls_that_cannot_turn_do_not_show_their_radius() -> None:
    contact_points = find_contact_points(load("funnel-frictionless-30"))
    assert contact_points.bodies is not None
    assert not contact_points.bodies.is_ball.any()


@pytest.mark.parametrize("name", ["funnel-100", "funnel-planar-30", "funnel-frictionless-30"])
def test_impulses_in_space_add_up_to_the_momentum_of_the_bodies(name: str) -> None:
    problem = load(name)
    assert problem.factors is not None
    rng = np.random.default_rng(0)
    only = int(rng.integers(problem.n_contacts))
    lanes = np.zeros((problem.n_contacts, problem.layout.width))
    lanes[only] = rng.uniform(1.0, 2.0, problem.layout.width)
    vector = find_contact_points(problem).vectors(lanes)[only]
    momentum = problem.factors.force_directions @ problem.layout.unpad(lanes)
    length = {"funnel-100": 6, "funnel-planar-30": 3, "funnel-frictionless-30": 3}[name]
    bodies = momentum.reshape(-1, length)[:, : 2 if "planar" in name else 3]
    pushed = bodies[np.flatnonzero(np.abs(bodies).max(axis=1) > 0)]
    drawn = vector[[0, 2]] if "planar" in name else vector
    assert min(np.abs(body - drawn).max() for body in pushed) < 1e-12


def test_corners_of_a_box_are_recovered() -> None:
    found = find_contact_points(load("hard-sticking-box")).positions
    corners = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.5, 0.5, 0.0]])
    np.testing.assert_allclose(found, corners, atol=1e-12)


@pytest.mark.parametrize("name", ["hard-counterexample", "woodpecker-beak-impact", "hard-mixed-laws", "hard-stack-10"])
def test_contacts_without_bodies_are_placed_on_a_grid(name: str) -> None:
    problem = load(name)
    contact_points = find_contact_points(problem)
    assert contact_points.positions.shape == (problem.n_contacts, 3)
    assert "grid" in contact_points.origin
    assert contact_points.bodies is None
    assert "not drawn" in contact_points.origin
    np.testing.assert_array_equal(contact_points.frames[0], [[0, 0, 1], [1, 0, 0], [0, 1, 0]])


def test_grid_positions_are_distinct() -> None:
    positions = grid_contact_points(10).positions
    assert len({tuple(position) for position in positions}) == 10


@pytest.mark.slow
def test_separate_heaps_are_placed_apart() -> None:
    contact_points = find_contact_points(load("funnel-1000"))
    distances = np.linalg.norm(contact_points.positions[:, None] - contact_points.positions[None], axis=2)
    np.fill_diagonal(distances, 1.0)
    assert distances.min() > 0.1 * contact_points.size


def test_inconsistent_contact_points_are_rejected() -> None:
    with pytest.raises(BenchError, match="frames of shape"):
        ContactPoints(np.zeros((2, 3)), np.zeros((3, 3, 3)), 1.0, "")
