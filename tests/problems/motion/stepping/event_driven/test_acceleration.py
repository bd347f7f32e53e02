"""The contact laws on acceleration level against forces computed by hand."""

from math import cos, sin

import numpy as np
import pytest
from proxbench.problems.motion.scenes.inclines import BlockOnIncline
from proxbench.problems.motion.scenes.woodpecker import FRICTION, section_start, woodpecker
from proxbench.problems.motion.stepping.event_driven.acceleration import AccelerationLaws, Modes
from proxbench.solvers import solve

WEIGHT_NORMAL, WEIGHT_ALONG = 9.81 * cos(0.3), 9.81 * sin(0.3)


@pytest.mark.parametrize(
    ("closed", "slip", "acceleration", "forces"),
    [
        (True, 0.0, (0.0, 0.0), (WEIGHT_NORMAL, -WEIGHT_ALONG)),
        (True, 1.0, (WEIGHT_ALONG - 0.5 * WEIGHT_NORMAL, 0.0), (WEIGHT_NORMAL, -0.5 * WEIGHT_NORMAL)),
        (True, -1.0, (WEIGHT_ALONG + 0.5 * WEIGHT_NORMAL, 0.0), (WEIGHT_NORMAL, 0.5 * WEIGHT_NORMAL)),
        (False, 0.0, (WEIGHT_ALONG, -WEIGHT_NORMAL), (0.0, 0.0)),
    ],
)
def test_each_mode_of_a_block_has_its_forces(
    closed: bool, slip: float, acceleration: tuple[float, float], forces: tuple[float, float]
) -> None:
    block = BlockOnIncline(0.3, 0.5, 0.0)
    laws, start = AccelerationLaws(block.system()), block.start()
    found, acting = laws.motion(start.position, start.velocity, Modes(np.array([closed]), np.array([slip])))
    assert found == pytest.approx(acceleration, abs=1e-13)
    assert acting[0] == pytest.approx(forces, abs=1e-13)


@pytest.mark.parametrize(("friction", "slides"), [(0.2, True), (0.5, False)])
def test_the_inclusion_decides_between_stick_and_slip(friction: float, slides: bool) -> None:
    block = BlockOnIncline(0.3, friction, 0.0)
    laws, start = AccelerationLaws(block.system()), block.start()
    problem = laws.problem(start.position, start.velocity, Modes(np.array([True]), np.array([0.0])))
    accelerations = problem.relative_velocity(solve(problem, "Enumeration", tolerance=1e-12).impulses)
    assert accelerations == pytest.approx([0.0, block.acceleration(1.0) if slides else 0.0], abs=1e-12)


def test_a_slipping_contact_has_one_law_whose_force_leans_with_its_friction() -> None:
    """G_NN = w_N · M⁻¹ (w_N − μ sign(γ_T) w_T)."""
    laws, start = AccelerationLaws(woodpecker()), section_start()
    for slip in (1.0, -1.0):
        modes = Modes(np.array([False, True, False]), np.array([0.0, slip, 0.0]))
        problem = laws.problem(start.position, start.velocity, modes)
        directions, mass = woodpecker().directions(start.position), woodpecker().mass(start.position)
        normal, tangential = directions[:, 2], directions[:, 3]
        expected = normal @ np.linalg.solve(mass, normal - FRICTION * slip * tangential)
        assert problem.n_rows == 1
        assert problem.delassus().toarray()[0, 0] == pytest.approx(expected, rel=1e-12)


def test_redundant_contacts_share_a_force_and_the_motion_is_unique() -> None:
    """The closed upper and lower edges of the sleeve both constrain one angle."""
    laws, start = AccelerationLaws(woodpecker()), section_start()
    both = Modes(np.array([False, True, True]), np.array([0.0, 1.0, 1.0]))
    acceleration, _ = laws.motion(start.position, start.velocity, both)
    assert acceleration[1] == pytest.approx(0.0, abs=1e-9)
