"""A semicircular arch stands if and only if it is thick enough, and collapses by the known mechanisms."""

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.motion.equilibrium import (
    bisect,
    find_equilibrium,
    largest_push,
    least_friction,
    problem_at_rest,
)
from proxbench.problems.motion.mechanism import FIXED, Motion, mechanism_text, pair_motions
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.arch import Arch
from proxbench.problems.motion.scenes.rigid.prisms import prism
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

from ...exact_contacts import Point, bodies_at_rest

ROUND_STONES = {7: 0.0962, 9: 0.1021, 13: 0.1028, 27: 0.1068, 51: 0.1074}
"""Least t/R by the number of stones with round faces, for μ = 0.8: the minima of a separate linear program.

The value for 27 stones is also published (Gilbert, Casapulla & Ahmed 2006).
"""

Stone = Callable[[Arch], tuple[float, float]]


def round_stone(arch: Arch) -> tuple[float, float]:
    """Return the mass [kg] of a stone with round faces, and the distance of its centre from that of the arch [m]."""
    inner, outer = (arch.radius * (1.0 + sign * 0.5 * arch.thickness) for sign in (-1.0, 1.0))
    half = 0.5 * pi / arch.stones
    distance = 2.0 / 3.0 * sin(half) / half * (outer**3 - inner**3) / (outer**2 - inner**2)
    return arch.density * arch.width * half * (outer**2 - inner**2), distance


def straight_stone(arch: Arch) -> tuple[float, float]:
    """Return the same values for a stone with straight faces between its joints."""
    inner, outer = (arch.radius * (1.0 + sign * 0.5 * arch.thickness) for sign in (-1.0, 1.0))
    half, thickness = 0.5 * pi / arch.stones, arch.radius * arch.thickness
    area = (inner + outer) * sin(half) * thickness * cos(half)
    distance = cos(half) * (inner + thickness * (inner + 2.0 * outer) / (3.0 * (inner + outer)))
    return arch.density * arch.width * area, distance


def at_rest(arch: Arch, stone: Stone = round_stone) -> ContactProblem:
    """Return the arch with contacts at exactly the corners of its joints."""
    mass, distance = stone(arch)
    angles = pi * (np.arange(arch.stones) + 0.5) / arch.stones
    centres = distance * np.column_stack([np.cos(angles), np.zeros(arch.stones), np.sin(angles)])
    inertia = mass * (arch.thickness * arch.radius) ** 2 / 6.0
    points = []
    for joint in range(arch.stones + 1):
        is_last = joint == arch.stones
        first, second = (joint - 1, FIXED) if is_last else (joint, joint - 1)
        x, z = -arch.normal(joint) if is_last else arch.normal(joint)
        corners = prism(arch.joint(joint), arch.width)
        points += [Point(first, second, corner, np.array([x, 0.0, z])) for corner in corners]
    return bodies_at_rest(centres, [mass] * arch.stones, np.full((arch.stones, 3), inertia), points, arch.friction)


def least_thickness(stones: int, friction: float, stone: Stone = round_stone) -> float:
    def stands(thickness: float) -> bool:
        return find_equilibrium(at_rest(Arch(stones, thickness, friction), stone)).can_stand

    return bisect(stands, 0.05, 0.4, 1e-6)


@pytest.mark.parametrize(
    "stones",
    [7, 9, pytest.param(13, marks=pytest.mark.slow), *(pytest.param(n, marks=pytest.mark.weekly) for n in (27, 51))],
)
def test_the_least_thickness_of_round_stones_is_that_of_a_linear_program(stones: int) -> None:
    assert round(least_thickness(stones, 0.8), 4) == ROUND_STONES[stones]


@pytest.mark.parametrize(
    ("stones", "limit"), [(7, 0.09570), (13, 0.10253), pytest.param(51, 0.10736, marks=pytest.mark.weekly)]
)
def test_straight_stones_have_a_slightly_lower_limit(stones: int, limit: float) -> None:
    found = least_thickness(stones, 0.8, straight_stone)
    assert found == pytest.approx(limit, abs=1e-5)
    assert 0.99 * ROUND_STONES[stones] < found < ROUND_STONES[stones]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("thickness", "friction"),
    [
        (0.107426, 0.395832),
        pytest.param(0.200637, 0.309215, marks=pytest.mark.weekly),
        pytest.param(0.3, 0.309215, marks=pytest.mark.weekly),
    ],
)
def test_the_least_friction_of_many_stones_is_that_of_the_continuous_arch(thickness: float, friction: float) -> None:
    """At 0.1 % above the least thickness, the limits are within 0.3 % of those of Cocchetti and Rizzi."""
    found = least_friction(at_rest(Arch(151, 1.001 * thickness)))
    assert found == pytest.approx(friction, rel=3e-3)


@pytest.mark.parametrize(
    ("stones", "thickness", "friction", "motions"),
    [
        (7, 0.09, 0.8, {Motion.HINGES}),
        (27, 0.15, 0.33, {Motion.HINGES, Motion.SLIDES}),
        (27, 0.30, 0.30, {Motion.SLIDES}),
    ],
)
def test_the_collapse_is_by_hinges_then_mixed_then_by_sliding(
    stones: int, thickness: float, friction: float, motions: set[Motion]
) -> None:
    problem = at_rest(Arch(stones, thickness, friction))
    found = find_equilibrium(problem)
    assert not found.can_stand
    assert {pair.motion for pair in pair_motions(problem, found.mechanism)} == motions


def test_a_thin_arch_has_hinges_at_springings_haunches_and_crown() -> None:
    problem = at_rest(Arch(7, 0.09))
    pairs = [pair.bodies for pair in pair_motions(problem, find_equilibrium(problem).mechanism)]
    assert pairs == [(FIXED, 0), (FIXED, 6), (0, 1), (2, 3), (3, 4), (5, 6)]


def test_a_sideways_push_makes_four_hinges() -> None:
    problem = at_rest(Arch(7, 0.12))
    along = np.tile([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 7)
    collapse, mirrored = largest_push(problem, along), largest_push(problem, -along)
    assert collapse.factor == pytest.approx(mirrored.factor, rel=1e-6)
    assert 0.05 < collapse.factor < 0.15
    assert mechanism_text(problem, collapse.mechanism).count("-") == 4
    assert largest_push(at_rest(Arch(7, 0.0962)), along).factor < 1e-3


def test_the_answer_depends_on_neither_size_nor_weight() -> None:
    for thickness, stands in ((0.0960, False), (0.0965, True)):
        for arch in (Arch(7, thickness, radius=1e3, width=0.01), Arch(7, thickness, radius=1e-3, density=1.0)):
            assert find_equilibrium(at_rest(arch)).can_stand is stands


@pytest.mark.parametrize("stones", [2, 7, 20])
def test_the_scene_has_the_contacts_of_its_joints(stones: int) -> None:
    arch = Arch(stones, 0.3)
    problem = problem_at_rest(arch.system(), arch.start())
    assert problem.n_contacts == 4 * (stones + 1)
    found, exact = find_equilibrium(problem), find_equilibrium(at_rest(arch, straight_stone))
    assert found.can_stand is exact.can_stand


def test_the_scene_has_the_limit_of_straight_stones() -> None:
    def stands(thickness: float) -> bool:
        arch = Arch(7, thickness)
        return find_equilibrium(problem_at_rest(arch.system(), arch.start())).can_stand

    assert bisect(stands, 0.09, 0.1, 1e-6) == pytest.approx(0.09570, abs=1e-5)


def largest_displacement(arch: Arch, time_step: float, tolerance: float, solver: str = "NSGS") -> float:
    """Return the largest displacement of a stone after a second, or when it exceeds a millimetre [m]."""
    rule = MidpointRule(arch.system(), create(solver), Stop(tolerance, 20_000), time_step)
    moved = 0.0
    for step in rule.steps(arch.start(), round(1.0 / time_step)):
        moved = arch.largest_displacement(step.state)
        if moved > 1e-3:
            break
    return moved


@pytest.mark.parametrize(("thickness", "stands"), [(0.0948, False), (0.0966, True)])
def test_in_motion_an_arch_falls_or_stands_one_per_cent_beside_the_limit(thickness: float, stands: bool) -> None:
    assert (largest_displacement(Arch(7, thickness), 5e-3, 1e-4) < 1e-4) is stands


@pytest.mark.slow
@pytest.mark.parametrize(
    "stones", [7, pytest.param(13, marks=pytest.mark.weekly), pytest.param(27, marks=pytest.mark.weekly)]
)
def test_the_limit_in_motion_is_that_of_equilibrium(stones: int) -> None:
    """The arch falls at a thickness 0.2 % below the limit of equilibrium, and stands at 0.2 % above it."""
    exact = least_thickness(stones, 0.8, straight_stone)
    assert exact == pytest.approx(ROUND_STONES[stones], rel=8e-3)
    assert largest_displacement(Arch(stones, 0.998 * exact), 5e-3, 1e-4) > 1e-3
    assert largest_displacement(Arch(stones, 1.002 * exact), 5e-3, 1e-4) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "stands"), [(0.95, False), (1.05, True)])
def test_in_motion_an_arch_that_hinges_and_slides_has_the_limit_of_equilibrium(factor: float, stands: bool) -> None:
    thickness = factor * least_thickness(27, 0.33, straight_stone)
    moved = largest_displacement(Arch(27, thickness, 0.33), 5e-3, 1e-6, "Robust")
    assert moved < 1e-5 if stands else moved > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [0.2, 0.3])
def test_in_motion_no_arch_stands_with_less_friction_than_a_continuous_arch_needs(thickness: float) -> None:
    arch = Arch(27, thickness, 0.30)
    assert not find_equilibrium(at_rest(arch, straight_stone)).can_stand
    assert largest_displacement(arch, 5e-3, 1e-6, "Robust") > 1e-3


def test_the_scene_is_registered_with_its_displacement() -> None:
    scene = make_scene("arch(stones=9, thickness=0.15)")
    assert scene.observables[0].compute(scene.start) == 0.0


def test_invalid_arch_is_refused() -> None:
    with pytest.raises(ProblemError, match="stones"):
        Arch(1)
    with pytest.raises(ProblemError, match="thickness"):
        Arch(7, 1.0)
    with pytest.raises(ProblemError, match="overlap"):
        Arch(overlap=0.1)
    with pytest.raises(ProblemError, match="radius"):
        Arch(radius=0.0)
