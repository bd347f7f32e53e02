"""A recording of the woodpecker shows sleeve and bird at their positions, and impulses where they touch the pole."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.recordings.bodies.woodpecker import WoodpeckerRecorder
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.woodpecker import (
    BEAK_ARM,
    BEAK_HEIGHT,
    PERIOD,
    POLE_RADIUS,
    section_start,
    woodpecker,
)
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Stop, create
from scipy.spatial.transform import Rotation


@pytest.fixture(scope="module")
def period(tmp_path_factory: pytest.TempPathFactory, record: Callable[..., None]) -> tuple[Path, list[Step]]:
    """One period of the limit cycle."""
    file = tmp_path_factory.mktemp("woodpecker") / "a.rrd"
    scene = replace(make_scene("woodpecker"), start=section_start())
    stepper = MidpointRule(woodpecker(), create("SORprox"), Stop(1e-12, 10_000), PERIOD / 1000)
    steps = list(stepper.steps(section_start(), 1000))
    record(WoodpeckerRecorder(scene, file), steps)
    return file, steps


@pytest.mark.slow
def test_sleeve_and_bird_move_as_computed(period: tuple[Path, list[Step]], read_back: Callable[[Path], Any]) -> None:
    content, last = read_back(period[0]), period[1][-1].state.position
    heights = content.over_time("/scene/bodies/sleeve", "Transform3D:translation")
    assert heights[1000][0][2] == pytest.approx(last[0], abs=1e-7)
    turn = content.over_time("/scene/bodies/bird", "Transform3D:quaternion")[1000][0]
    assert Rotation.from_quat(turn).as_rotvec()[1] == pytest.approx(-last[2], abs=1e-6)
    (length,) = content.static("/scene/pole", "Cylinders3D:lengths")
    assert length[0] if isinstance(length, list) else length > abs(last[0])


@pytest.mark.slow
def test_the_beak_meets_the_pole_when_it_pecks(
    period: tuple[Path, list[Step]], read_back: Callable[[Path], Any]
) -> None:
    content = read_back(period[0])
    pecks = [k for k, step in enumerate(period[1], 1) if step.contacts is not None and 0 in step.contacts.keys]
    assert pecks
    at = pecks[0]
    centre = np.array(content.over_time("/scene/bodies/bird", "Transform3D:translation")[at][0])
    turn = Rotation.from_quat(content.over_time("/scene/bodies/bird", "Transform3D:quaternion")[at][0])
    tip = centre + turn.apply([-BEAK_ARM, 0.0, BEAK_HEIGHT])
    assert tip[0] == pytest.approx(POLE_RADIUS, abs=5e-4)  # the gap is linear in the angle, the picture is not
    arrows = content.over_time("/scene/impulses", "Arrows3D:vectors")[at]
    origins = content.over_time("/scene/impulses", "Arrows3D:origins")[at]
    assert origins[0][0] == pytest.approx(POLE_RADIUS)
    assert abs(origins[0][2] - tip[2]) < 1e-3
    assert arrows[0][0] > 0.0


@pytest.mark.slow
def test_energy_is_conserved_in_flight_and_lost_at_contacts(
    period: tuple[Path, list[Step]], read_back: Callable[[Path], Any]
) -> None:
    energy = np.array(list(read_back(period[0]).curve("/curves/energy/total").values()))
    lost = energy[0] - energy[-1]
    assert lost == pytest.approx(0.0048 * 9.81 * 0.01945, rel=0.06)
    flight = [step.contacts is None for step in period[1]]
    assert 100 < sum(flight) < 900
    assert np.abs(np.diff(energy)[flight]).max() < 1e-4 * lost


@pytest.mark.slow
def test_without_friction_impulses_are_normal_to_the_pole(
    tmp_path: Path, read_back: Callable[[Path], Any], record: Callable[..., None]
) -> None:
    stepper = MidpointRule(woodpecker(friction=None), create("SORprox"), Stop(1e-12, 10_000), PERIOD / 1000)
    steps = list(stepper.steps(section_start(), 200))
    scene = replace(make_scene("woodpecker", {"friction": None}), start=section_start())
    record(WoodpeckerRecorder(scene, tmp_path / "a.rrd"), steps)
    drawn = read_back(tmp_path / "a.rrd").over_time("/scene/impulses", "Arrows3D:vectors")
    assert [len(drawn[k]) for k in range(1, 201)] == [len(step.impulses) for step in steps]
    arrows = np.array([arrow for each in drawn.values() for arrow in each])
    assert arrows[:, 0].max() > 0.0
    np.testing.assert_array_equal(arrows[:, 1:], 0.0)


@pytest.mark.slow
def test_every_angle_has_a_curve(period: tuple[Path, list[Step]], read_back: Callable[[Path], Any]) -> None:
    content = read_back(period[0])
    assert content.curve("/curves/angles/sleeve")[1000] == period[1][-1].state.position[1]
    assert content.curve("/curves/angles/bird")[1000] == period[1][-1].state.position[2]
