"""Engines build the described scenes, and the problems of their steps contain the computed impulses."""

from typing import Any

import numpy as np
import pytest
from proxbench.bench.measure.trajectories.engines import measurement
from proxbench.bench.measure.trajectories.engines.description import Description, Setting
from proxbench.bench.measure.trajectories.engines.engine import ENGINES, Engine, build
from proxbench.bench.measure.trajectories.engines.measurement import measure, measure_setting
from proxbench.bench.measure.trajectories.engines.own_engine import OwnEngine
from proxbench.bench.measure.trajectories.engines.scenes import SCENES, describe
from proxbench.problems import judge

WHEELS = ("mujoco", "pybullet", "rapier", "dart")
DART_SWEEPS = [setting.name for setting in ENGINES["dart"].settings].index("ODE contacts, sweeps")


def engine_of(name: str, scene: str, number: int = 0) -> Engine:
    pytest.importorskip(ENGINES[name].distribution, reason="the extra engines is not installed")
    return build(name, describe(scene), ENGINES[name].settings[number])


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", WHEELS)
def test_bodies_start_as_described(name: str, scene: str) -> None:
    check_start(engine_of(name, scene), describe(scene), 1e-6)  # Rapier has single precision


@pytest.mark.parametrize("scene", SCENES)
def test_bodies_of_proxbench_start_as_described(scene: str) -> None:
    """Cubes start with a penetration of 1e-9 m, so that the first step finds their contacts."""
    description = describe(scene)
    check_start(OwnEngine(description, description.step, 1e-2), description, 1e-8)


def check_start(engine: Engine, description: Description, tolerance: float) -> None:
    states, start = engine.states(), description.start()
    assert states.positions == pytest.approx(start.positions, abs=tolerance)
    assert states.velocities == pytest.approx(start.velocities, abs=tolerance)
    assert not states.spins.any()


@pytest.mark.parametrize("name", ["mujoco", "pybullet", "dart"])
@pytest.mark.parametrize("scene", ["thrown-cube", "stack", "pile"])
def test_free_motion_and_impulses_give_the_velocity_after_the_step(name: str, scene: str) -> None:
    engine = engine_of(name, scene, DART_SWEEPS if name == "dart" else 0)
    for _ in range(300 if scene == "pile" else 1):
        engine.step()
    engine.store_state()
    engine.step()
    solved: Any = engine.solved_problem()
    after = engine.states()
    factors = solved.problem.factors
    found = factors.free_motion + factors.inverse_mass.times(factors.force_directions @ solved.impulses)
    velocities = np.hstack([after.velocities, after.spins]).ravel()
    assert np.abs(solved.impulses).max() > 0.0
    assert found == pytest.approx(velocities, abs=1e-10 * np.abs(velocities).max())


@pytest.mark.parametrize("scene", ["thrown-cube", "stack", "pile"])
def test_mujoco_solves_its_own_model_and_not_coulombs_law(scene: str) -> None:
    engine = engine_of("mujoco", scene)
    for _ in range(300 if scene == "pile" else 1):
        engine.step()
    engine.store_state()
    engine.step()
    solved = engine.solved_problem()
    assert solved is not None
    assert solved.own_residual is not None
    assert solved.own_residual < 1e-6
    assert judge(solved.problem, solved.impulses).residual > 1e-3


def test_the_own_model_is_judged_by_the_forces_of_the_step_itself() -> None:
    engine: Any = engine_of("mujoco", "stack")
    engine.step()
    engine.store_state()
    engine.step()
    assert engine.solved_problem().own_residual < 1e-6
    engine.data.efc_force[:] *= 1.01
    assert engine.solved_problem().own_residual > 1e-4


@pytest.mark.parametrize("name", ["pybullet", "dart"])
def test_other_engines_publish_no_model(name: str) -> None:
    engine = engine_of(name, "stack", DART_SWEEPS if name == "dart" else 0)
    engine.store_state()
    engine.step()
    solved = engine.solved_problem()
    assert solved is not None
    assert solved.own_residual is None


def test_a_stiff_cone_program_lifts_the_thrown_cube_by_its_closed_form() -> None:
    """The velocity v is in the dual cone: v_N = μ ‖v_T‖ with v_T = 6 m/s − μ v_N, so that v_N = 6 μ/(1 + μ²)."""
    description = describe("thrown-cube")
    names = [setting.name for setting in ENGINES["mujoco"].settings]
    engine = engine_of("mujoco", "thrown-cube", names.index("stiff"))
    lift, _ = description.measure(description, measure(description, engine, description.step)[0])
    normal = 6.0 * 0.5 / (1.0 + 0.5**2)
    assert lift == pytest.approx(1e3 * normal**2 / (2.0 * 9.81), rel=0.01)


@pytest.mark.parametrize("name", ["pybullet", "rapier"])
def test_a_thrown_cube_stays_on_the_floor_where_friction_is_that_of_coulomb(name: str) -> None:
    pytest.importorskip(ENGINES[name].distribution, reason="the extra engines is not installed")
    found = measure_setting("thrown-cube", name, ENGINES[name].settings[0].name)
    assert found.errors["lift [mm]"] < 0.01
    assert found.errors["speed [%]"] < 0.5


@pytest.mark.parametrize("name", WHEELS)
@pytest.mark.parametrize("scene", ["incline-slide", "stack"])
def test_reading_the_problems_of_steps_does_not_change_a_bit_of_the_motion(name: str, scene: str) -> None:
    number = [setting.name for setting in ENGINES[name].settings].index("Coulomb") if name == "rapier" else 0
    read, plain = (engine_of(name, scene, number) for _ in range(2))
    for step in range(100):
        plain.step()
        if step > 0:  # MuJoCo finds no contact at the start
            read.store_state()
        read.step()
        if step > 0:
            read.solved_problem()
    one, other = read.states(), plain.states()
    assert one.positions.tobytes() == other.positions.tobytes()
    assert one.velocities.tobytes() == other.velocities.tobytes()


@pytest.mark.parametrize("scene", ["thrown-cube", "incline-slide", "incline-rest"])
def test_impulses_of_rapier_give_its_velocities_where_it_reports_friction(scene: str) -> None:
    pytest.importorskip(ENGINES["rapier"].distribution, reason="the extra engines is not installed")
    names = [setting.name for setting in ENGINES["rapier"].settings]
    engine = engine_of("rapier", scene, names.index("Coulomb"))
    for _ in range(50):
        engine.store_state()
        engine.step()
    solved, after = engine.solved_problem(), engine.states()
    assert solved is not None
    factors = solved.problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    found = factors.free_motion + factors.inverse_mass.times(factors.force_directions @ solved.impulses)
    wanted = np.hstack([after.velocities, after.spins]).ravel()
    assert np.abs(found - wanted).max() <= 1e-6 * max(1.0, np.abs(wanted).max())
    assert np.abs(factors.free_motion - wanted).max() > 1e-3
    default = engine_of("rapier", scene, names.index("default"))
    default.store_state()
    default.step()
    assert default.solved_problem() is None


def test_steps_that_the_impulses_of_rapier_do_not_explain_are_not_judged() -> None:
    """The cubes of the stack turn, and their impulses act at other points than those that Rapier reports."""
    names = [setting.name for setting in ENGINES["rapier"].settings]
    engine = engine_of("rapier", "stack", names.index("Coulomb"))
    for _ in range(50):
        engine.store_state()
        engine.step()
    assert engine.solved_problem() is None


@pytest.mark.parametrize("scene", ["thrown-cube", "incline-slide", "incline-rest", "stack"])
def test_cubes_of_proxbench_move_as_the_closed_form_says(scene: str) -> None:
    """Errors, of micrometres and 1e-6 of the speed or the distance, are due to the tolerance."""
    description = describe(scene)
    engine = OwnEngine(description, 2.5 * description.step, 1e-8)
    motion, _, _, solved = measure(description, engine, 2.5 * description.step)
    assert description.measure(description, motion) == pytest.approx(0.0 * np.ones(len(description.errors)), abs=1e-4)
    assert max(judge(one.problem, one.impulses).residual for one in solved) <= 1e-8


def test_a_cube_of_dart_slides_as_coulomb_says_only_with_a_contact_at_each_corner() -> None:
    """FCL, the default of DART, gives one point of a cube on a plane, so that the cube turns."""
    description = describe("thrown-cube")
    speed_errors = {}
    for number, contacts in ((0, 1), (1, 4)):
        engine = engine_of("dart", "thrown-cube", number)
        motion, _, _, solved = measure(description, engine, description.step)
        assert {one.problem.n_contacts for one in solved} == {contacts}
        speed_errors[contacts] = description.measure(description, motion)[1]
    assert speed_errors[1] > 1.0
    assert speed_errors[4] < 1e-4


def test_problems_of_few_bodies_are_solved_again(monkeypatch: pytest.MonkeyPatch) -> None:
    found = measure_setting("incline-rest", "proxbench", "1e-2, long step")
    assert found.residual is not None
    assert found.solved_residual is not None
    assert found.solved_residual <= 1e-8 < found.residual <= 1e-2
    monkeypatch.setattr(measurement, "MAX_BODIES_SOLVED_AGAIN", 0)
    assert measure_setting("incline-rest", "proxbench", "1e-2, long step").solved_residual is None


@pytest.mark.slow
def test_proxbench_solves_each_step_to_its_tolerance() -> None:
    description = describe("pile")
    engine = build("proxbench", description, Setting("1e-3", 1.0, {"tolerance": 1e-3}))
    motion, _, _, solved = measure(description, engine, description.step)
    assert len(motion.times) == 151
    assert description.measure(description, motion)[1] < 1e-4
    assert len(solved) >= 8
