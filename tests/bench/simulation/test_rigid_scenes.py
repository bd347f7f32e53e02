"""Every scene of rigid bodies can be simulated, recorded and studied."""

import os
from pathlib import Path

import numpy as np
import pytest
from proxbench.bench import study
from proxbench.bench.recordings.replay import record_stored
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.registry import RIGID_SCENES
from proxbench.solvers import Status
from rerun.chunk import RrdReader

pytestmark = pytest.mark.slow

STEPS = 3

STUDIED = ("tipping_box", "rolling_sphere", "spinning_top", "four_bar", "ball_on_chain", "drum", "dominoes")
"""One scene of each kind: sliding and rolling friction, no contacts, joints, both, a driven body, several bodies.

PROXBENCH_PROFILE=full studies all scenes.
"""


@pytest.mark.parametrize("name", RIGID_SCENES)
def test_steps_are_solved_stored_and_recorded(name: str, tmp_path: Path) -> None:
    scene = make_scene(name)
    system = scene.system
    assert isinstance(system, RigidBodies)
    plan = make_simulation_plan(name, duration=STEPS * scene.step_size, solver="Robust", tolerance=1e-6)
    simulate(plan, tmp_path / "a.npz")
    stored = read_simulation(tmp_path / "a.npz")
    steps, states = stored.steps, list(stored.states)
    assert len(steps) == STEPS
    assert not stored.unsolved.any()
    for column in ("residual", "kinetic_energy", *(one.name for one in scene.observables)):
        assert np.isfinite(steps[column]).all(), column
    assert np.isfinite(steps["potential_energy"]).all() == (scene.potential_energy is not None)
    assert np.isfinite(stored.trajectory).all()
    turns = stored.state.position.reshape(-1, 7)[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0, atol=1e-9)
    record_stored(scene, steps, states, tmp_path / "a.rrd")
    paths = {chunk.entity_path for chunk in RrdReader(tmp_path / "a.rrd").stream()}
    assert {"/scene/bodies/0", "/scene/outlines/0", "/scene/impulses"} <= paths
    assert any(path.startswith("/scene/joints/") for path in paths) is (system.joints is not None)
    assert any(path.startswith("/scene/fixed/") for path in paths) is bool(system.fixed)


@pytest.mark.weekly
@pytest.mark.parametrize("name", RIGID_SCENES if os.environ.get("PROXBENCH_PROFILE") == "full" else STUDIED)
def test_the_error_of_a_study_of_a_point_is_below_the_distance_that_bodies_move(name: str, tmp_path: Path) -> None:
    """An impact is found up to one of the three steps late."""
    step = make_scene(name).step_size
    run = study(
        name,
        results=tmp_path,
        duration=STEPS * step,
        members=(1.0,),
        methods={"Moreau with Robust": (step,)},
        tolerance=1e-6,
    )
    [status], [error] = run.points["status"], run.points["residual"]
    assert status == Status.SOLVED
    assert 0.0 <= error < 1.0 / STEPS
