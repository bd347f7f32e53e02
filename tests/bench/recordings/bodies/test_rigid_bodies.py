"""A recording of rigid bodies shows the shape, position and forces of each body."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.recordings.bodies.rigid_bodies import WALL_COLOUR, RigidRecorder
from proxbench.bench.recordings.bodies.shape_meshes import shape_mesh
from proxbench.bench.recordings.replay import scene_recorder
from proxbench.problems.motion.bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from proxbench.problems.motion.bodies.rigid.shapes import Box, Shape
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.containers import STAVES
from proxbench.problems.motion.scenes.scene import RESTING_OVERLAP
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Stop, create

DT = 1e-3

GREY = int.from_bytes(bytes(WALL_COLOUR))


@pytest.fixture
def slide(tmp_path: Path, record: Callable[..., None]) -> tuple[Path, list[Step]]:
    """A box, turned about the vertical, that slides on level ground."""
    scene = make_scene("thrown_box(turn=0.3)")
    stepper = MidpointRule(scene.system, create("Robust"), Stop(1e-12, 1000), DT)
    steps = list(stepper.steps(scene.start, 20))
    recorder = scene_recorder(scene, tmp_path / "a.rrd", len(steps))
    assert isinstance(recorder, RigidRecorder)
    record(recorder, steps)
    return tmp_path / "a.rrd", steps


@pytest.mark.slow
def test_poses_are_those_of_the_states(slide: tuple[Path, list[Step]], read_back: Callable[[Path], Any]) -> None:
    content = read_back(slide[0])
    places = content.over_time("/scene/bodies/0", "InstancePoses3D:translations")
    turns = content.over_time("/scene/bodies/0", "InstancePoses3D:quaternions")
    assert list(places) == list(range(21))
    for number, step in enumerate(slide[1], 1):
        np.testing.assert_allclose(places[number][0], step.state.position[:3], rtol=0.0, atol=1e-6)
        x, y, z, w = turns[number][0]
        np.testing.assert_allclose([w, x, y, z], step.state.position[3:], rtol=0.0, atol=1e-6)
    assert ("/scene/fixed/0", "Mesh3D:vertex_positions") in content.logged


def test_a_sliding_box_is_pushed_at_its_four_corners(
    slide: tuple[Path, list[Step]], read_back: Callable[[Path], Any]
) -> None:
    content = read_back(slide[0])
    vectors = np.array(content.over_time("/scene/impulses", "Arrows3D:vectors")[20])
    origins = np.array(content.over_time("/scene/impulses", "Arrows3D:origins")[20])
    assert len(np.unique(np.round(origins, 6), axis=0)) == len(origins) > 1
    np.testing.assert_allclose(origins[:, 2], -0.5 * RESTING_OVERLAP, atol=1e-6)
    assert (vectors[:, 2] > 0.0).all()
    np.testing.assert_allclose(vectors[:, 0] / vectors[:, 2], -0.5, atol=1e-5)  # against the motion, μ = 0.5


@pytest.mark.parametrize("shape", [Box((1.0, 2.0, 3.0)), Sphere(0.5), Capsule(0.5, 2.0), Cylinder(0.5, 2.0)])
def test_a_mesh_encloses_the_volume_of_its_shape(shape: Shape) -> None:
    mesh = shape_mesh(shape, (0, 0, 0))
    volume = float(np.linalg.det(mesh.vertices[mesh.triangles]).sum()) / 6.0
    assert volume == pytest.approx(shape.volume, rel=0.03)


def test_driven_bodies_are_grey_and_others_are_not(
    tmp_path: Path, record: Callable[..., None], read_back: Callable[[Path], Any]
) -> None:
    scene = make_scene("drum(n_boxes=6, layers=1)")
    rule = MidpointRule(scene.system, create("Robust"), Stop(1e-4, 100), DT)
    recorder = scene_recorder(scene, tmp_path / "a.rrd", 1)
    record(recorder, list(rule.steps(scene.start, 1)))
    content, n_grey, n_coloured = read_back(tmp_path / "a.rrd"), 0, 0
    for entity, component in content.logged:
        if entity.startswith("/scene/bodies/") and component == "Mesh3D:vertex_colors":
            count = len(content.over_time(entity, "InstancePoses3D:translations")[0])
            colours = {colour >> 8 for colour in content.static(entity, component)}
            n_grey, n_coloured = (n_grey + count, n_coloured) if GREY in colours else (n_grey, n_coloured + count)
    assert (n_grey, n_coloured) == (STAVES, 6)


def test_a_scene_with_a_view_of_its_own_keeps_it(tmp_path: Path) -> None:
    scene = replace(make_scene("woodpecker"), view="woodpecker")
    assert not isinstance(scene_recorder(scene, tmp_path / "a.rrd", 1), RigidRecorder)
