"""Ball systems: W is the derivative of the gap, and bodies have the degrees of freedom that their effects require."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.rigid.materials import MaterialPairs
from proxbench.problems.motion.bodies.surfaces import Plane, Rim, Segment, Surface

SURFACES_3D = [
    Plane((0.0, 0.0, 0.0), (0.2, 0.1, 1.0)),
    Segment((0.3, 0.0), (1.3, 1.0)),
    Rim((0.3, 0.0), (0.7, 0.7)),
]


def heap(dimension: int, friction: float | None, seed: int = 0) -> tuple[BallSystem, np.ndarray]:
    rng = np.random.default_rng(seed)
    n = 40
    surfaces = SURFACES_3D if dimension == 3 else [Segment((0.3, 0.0), (1.3, 1.0), 1), Plane((0.0, 0.0), (0.0, 1.0))]
    system = BallSystem(rng.uniform(0.1, 0.2, n), rng.uniform(0.5, 2.0, n), surfaces, dimension, friction=friction)
    return system, rng.uniform(-0.5, 0.7, (n, dimension)).ravel()


@pytest.mark.parametrize(
    ("dimension", "friction", "dofs", "rows"), [(3, 0.3, 6, 3), (2, 0.3, 3, 2), (3, None, 3, 1), (2, None, 2, 1)]
)
def test_degrees_of_freedom_and_rows_are_what_the_effects_ask_for(
    dimension: int, friction: float | None, dofs: int, rows: int
) -> None:
    system, position = heap(dimension, friction)
    contacts = system.assemble(position, np.zeros(system.n_balls * dofs), 1e-3).contacts
    assert contacts is not None
    assert system.dofs_per_ball == dofs
    assert contacts.directions.to_csc().shape == (dofs * system.n_balls, rows * len(contacts.keys))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("friction", [None, 0.3])
def test_balls_fall_and_move_as_free_bodies(dimension: int, friction: float | None) -> None:
    """An acceleration may be one vector for all balls; ω and other velocities change no position."""
    system, position = heap(dimension, friction)
    gravity = np.append(np.zeros(dimension - 1), -9.81)
    falling = replace(system, accelerations=(lambda *_: gravity, lambda centres, *_: np.ones_like(centres)))
    velocity = np.random.default_rng(1).normal(size=system.n_balls * system.dofs_per_ball)
    free, moved = falling.assemble(position, velocity, 0.1).free_motion, falling.move(position, velocity, 0.1)
    change = (free - velocity).reshape(system.n_balls, -1)
    assert change[:, :dimension] == pytest.approx(np.tile(0.1 * (gravity + 1.0), (system.n_balls, 1)))
    assert not change[:, dimension:].any()
    translations = velocity.reshape(system.n_balls, -1)[:, :dimension]
    assert moved == pytest.approx(position + 0.1 * translations.ravel())


@pytest.mark.parametrize("accelerations", [None, "1.5", np.array(1.0j), np.ma.masked_array([1.0], [True])])
def test_accelerations_that_are_no_real_numbers_are_refused(accelerations: Any) -> None:
    system, position = heap(3, None)
    system = replace(system, accelerations=(lambda *_: accelerations,))
    with pytest.raises(ProblemError, match="accelerations"):
        system.assemble(position, np.zeros(120), 0.1)


def test_balls_with_velocities_in_whole_numbers_are_accelerated() -> None:
    system, position = heap(3, None)
    system = replace(system, accelerations=(lambda centres, *_: np.full_like(centres, -9.81),))
    step = system.assemble(position, np.ones(120, dtype=np.int64), 0.1)
    assert step.free_motion == pytest.approx(np.full(120, 0.019))


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_normal_rows_are_the_derivative_of_the_gap(dimension: int) -> None:
    """γ_N = ġ: a central difference of g along a motion equals W_Nᵀ u."""
    system, position = heap(dimension, None)
    velocity = np.random.default_rng(2).normal(size=position.size)
    contacts = system.assemble(position, velocity, 1e-3).contacts
    assert contacts is not None
    width = 1e-6
    gaps = []
    for sign in (-1.0, 1.0):
        moved = system.assemble(position + sign * width * velocity, velocity, 1e-3).contacts
        assert moved is not None
        assert np.array_equal(moved.keys, contacts.keys)
        gaps.append(moved.gap)
    rate = (gaps[1] - gaps[0]) / (2.0 * width)
    assert contacts.directions.to_csc().T @ velocity == pytest.approx(rate, abs=1e-7)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rigid_motion_of_touching_balls_moves_no_contact(dimension: int) -> None:
    """Two balls in contact that translate and turn together as one body have no relative velocity at the contact."""
    radii = np.array([0.6, 0.5])
    system = BallSystem(radii, np.ones(2), [], dimension, friction=0.5)
    normal = np.array([0.6, 0.0, 0.8])[-dimension:] if dimension == 3 else np.array([0.6, 0.8])
    centres = np.array([np.zeros(dimension), -(radii.sum() - 1e-12) * normal])
    if dimension == 3:
        spin = np.array([0.3, -0.7, 0.4])
        twists = [np.concatenate([np.cross(spin, centre), spin]) for centre in centres]
    else:
        twists = [np.array([-0.7 * centre[1], 0.7 * centre[0], 0.7]) for centre in centres]
    contacts = system.assemble(centres.ravel(), np.concatenate(twists), 1e-3).contacts
    assert contacts is not None
    assert np.abs(contacts.directions.to_csc().T @ np.concatenate(twists)).max() <= 1e-11


def test_tangents_and_normal_are_an_orthonormal_frame() -> None:
    system, position = heap(3, 0.3)
    contacts = system.assemble(position, np.zeros(240), 1e-3).contacts
    assert contacts is not None
    translation = contacts.directions.to_csc().toarray().reshape(40, 6, -1)[:, :3]
    for contact in range(len(contacts.keys)):
        columns = translation[:, :, 3 * contact : 3 * contact + 3]
        body = columns[np.abs(columns).sum(axis=(1, 2)) > 0][0]
        assert body.T @ body == pytest.approx(np.eye(3), abs=1e-12)


def test_contacts_come_ordered_by_key() -> None:
    system, position = heap(3, 0.3)
    contacts = system.assemble(position, np.zeros(240), 1e-3).contacts
    assert contacts is not None
    assert (np.diff(contacts.keys) > 0).all()
    assert (contacts.gap < 0).all()


@pytest.mark.parametrize(("dimension", "friction"), [(2, None), (2, 0.3), (3, None), (3, 0.3)])
def test_overlaps_are_the_gaps_and_normal_columns_of_a_step_at_the_same_place(
    dimension: int, friction: float | None
) -> None:
    system, position = heap(dimension, friction)
    contacts = system.assemble(position, np.zeros(system.n_balls * system.dofs_per_ball), 1e-3).contacts
    overlaps = system.overlaps(position, 0.0)
    assert contacts is not None
    assert overlaps is not None
    assert np.array_equal(overlaps.gap, contacts.gap)
    columns = contacts.directions.to_csc().toarray()[:, :: contacts.width]
    assert np.array_equal(overlaps.normals.to_csc().toarray(), columns)


@pytest.mark.parametrize("surfaces", [[], SURFACES_3D])
def test_overlaps_are_reported_down_to_the_deepest_gap_exactly(surfaces: list[Surface]) -> None:
    """With and without surfaces, the deepest gap itself is tolerated, and the next smaller number is not."""
    rng = np.random.default_rng(8)
    for _ in range(20):
        system = BallSystem(rng.uniform(0.1, 0.2, 12), np.ones(12), surfaces, 3, friction=0.3)
        position = rng.uniform(-0.5, 0.7, 36)
        found = system.overlaps(position, 0.0)
        if found is not None:
            depth = -found.gap.min()
            assert system.overlaps(position, depth) is None
            assert system.overlaps(position, np.nextafter(depth, 0.0)) is not None


def test_overlaps_of_nearly_concentric_balls_are_reported_down_to_the_deepest_gap_exactly() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        system = BallSystem(rng.uniform(0.1, 0.2, 2), np.ones(2), [], 3)
        position = np.array([0.0, 0.0, 0.0, 10.0 ** rng.uniform(-13.0, -8.0), 0.0, 0.0])
        found = system.overlaps(position, 0.0)
        assert found is not None
        depth = -found.gap.min()
        assert system.overlaps(position, depth) is None
        assert system.overlaps(position, np.nextafter(depth, 0.0)) is not None


def test_balls_that_touch_within_rounding_have_overlaps_or_none() -> None:
    """Where the squared distance says that balls do not overlap, a rounded root must not say that they do."""
    rng, n_touching = np.random.default_rng(0), 0
    for radii in rng.uniform(0.1, 1.0, (2000, 2)):
        distance = radii.sum()
        n_touching += bool(np.sqrt(distance * distance) - radii[0] - radii[1] < 0.0)
        found = BallSystem(radii, np.ones(2), [], 3).overlaps(np.array([0.0, 0.0, 0.0, distance, 0.0, 0.0]), 0.0)
        assert found is None or len(found.gap) > 0
    assert n_touching > 20


def test_there_are_no_overlaps_where_none_is_deeper_than_tolerated() -> None:
    system, position = heap(3, 0.3)
    depth = -system.gaps_below(position, 0.0)[1].min()
    assert system.overlaps(position, 1.001 * depth) is None
    assert system.overlaps(position, 0.999 * depth) is not None


@pytest.mark.parametrize(
    ("name", "value"),
    [("friction", -0.1), ("restitution_normal", 1.5), ("dimension", 4), ("masses", np.array([0.0])), ("radii", [-1.0])],
)
def test_error_names_the_invalid_parameter(name: str, value: object) -> None:
    arguments = {"radii": np.ones(1), "masses": np.ones(1), "surfaces": [], "dimension": 3, name: value}
    with pytest.raises(ProblemError, match=name):
        BallSystem(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [0.0, 0.05, 0.3])
def test_gaps_below_a_limit_are_those_of_all_pairs_and_of_the_plane(limit: float) -> None:
    """Gaps are distances of pairs minus both radii, and heights of balls minus their radius."""
    rng = np.random.default_rng(4)
    radii, centres = rng.uniform(0.1, 0.2, 12), rng.uniform(0.0, 0.8, (12, 3))
    system = BallSystem(radii, np.ones(12), [Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))], 3)
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2) - radii[:, None] - radii[None]
    every = np.append(apart[np.triu_indices(12, 1)], centres[:, 2] - radii)
    keys, gaps = system.gaps_below(centres.ravel(), limit)
    assert np.array_equal(keys, np.unique(keys))
    assert np.sort(gaps) == pytest.approx(np.sort(every[every < limit]), abs=1e-12)


def test_overlaps_within_the_tolerance_are_not_reported() -> None:
    system = BallSystem(np.array([0.5]), np.ones(1), [Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))], 3)
    sunk = np.array([0.0, 0.0, 0.49])
    assert system.overlaps(sunk, 0.02) is None
    found = system.overlaps(sunk, 0.005)
    assert found is not None
    assert found.gap == pytest.approx([-0.01])


@pytest.mark.parametrize(
    ("radii", "masses", "words"),
    [
        ([0.1, 0.1, 0.1], [1.0, 1.0], "3 radii and 2 masses"),
        ([0.1, 0.1, 0.1], [1.0], "3 radii and 1 masses"),
        ([0.1, np.inf], [1.0, 1.0], "radii must be positive, finite"),
        ([0.1, 0.1], [1.0, np.inf], "masses must be positive, finite"),
    ],
)
def test_each_ball_has_a_finite_radius_and_a_finite_mass(radii: list[float], masses: list[float], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        BallSystem(np.array(radii), np.array(masses), (), 3, friction=0.5)


def test_restitution_by_materials_is_at_most_one_as_for_rigid_bodies() -> None:
    pairs = MaterialPairs(("steel", "steel"), {("steel", "steel"): 3.0})
    with pytest.raises(ProblemError, match="restitution_normal must be between 0 and 1"):
        BallSystem(np.ones(2), np.ones(2), (), 3, restitution_normal=pairs)
