"""A plugin's scene moves in its own process as it would here, and its faults affect one step."""

import runpy
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from elsewhere_solver import Elsewhere
from proxbench.bench.cli.listing import listing_rows
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError, FailedSimulationError
from proxbench.bench.isolation.worker import RenewedWorker
from proxbench.bench.plugins.files import use_plugin_files
from proxbench.bench.plugins.remote_scene import FailedSceneError, RemoteSystem, local_or_remote_scene
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import resume_simulation, simulate
from proxbench.bench.simulation.step_row import step_columns
from proxbench.problems import ProblemError
from proxbench.problems.exchange.plugins.files import PluginFile
from proxbench.problems.exchange.plugins.offers import forget
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule

PLUGIN = Path(__file__).resolve().parents[1] / "plugins" / "scene_plugin.py"


@pytest.fixture(autouse=True)
def in_use() -> Iterator[None]:
    """Register the plugin for one test."""
    use_plugin_files([PLUGIN])
    yield
    forget(PluginFile.read(PLUGIN))


@pytest.mark.slow
@pytest.mark.parametrize("stepper", ["Moreau(step=1e-3)", "Extrapolated(tolerance=1e-4, min_step=1e-6)"])
def test_a_plugin_scene_moves_bit_by_bit_like_the_local_scene(stepper: str) -> None:
    def state(scene: str) -> bytes:
        reached = simulate(make_simulation_plan(scene, stepper=stepper, duration=0.13)).state
        return reached.position.tobytes() + reached.velocity.tobytes() + reached.impulses.tobytes()

    assert state("twin(balls=5)") == state("funnel(balls=5)")


def test_plugin_scene_has_the_properties_of_the_local_scene() -> None:
    remote, here = local_or_remote_scene("twin(balls=5)"), make_scene("funnel(balls=5)")
    for name in ("length", "step_size", "duration", "longest_step", "n_balls", "depth", "has_few_contacts"):
        assert getattr(remote, name) == getattr(here, name)
    q, u = here.start.position, here.start.velocity
    assert (remote.kinetic_energy(u), remote.potential_energy(q)) == (here.kinetic_energy(u), here.potential_energy(q))
    for there, own in zip(remote.observables, here.observables, strict=True):
        assert (there.name, there.is_count, there.label, there.rate) == (own.name, own.is_count, own.label, own.rate)
        fallen = State(0.0, -q, u)
        assert there.compute(fallen) == own.compute(fallen)
    assert remote.observables[0].compute(State(0.0, -q, u)) == 5


def test_a_scene_of_a_plugin_ends_as_the_same_scene_does_here() -> None:
    remote, here = local_or_remote_scene("twin(balls=5)"), make_scene("funnel(balls=5)")
    steps = np.zeros(2, dtype=step_columns(here))
    for through, name in ((5, "emptied"), (3, "jammed")):
        steps["balls_through"], steps["time"] = through, (0.0, 1.0)
        endings = [scene.ending.find(steps) for scene in (remote, here) if scene.ending is not None]
        assert endings[0] == endings[1]
        assert endings[0] is not None
        assert endings[0].name == name
    steps["agitation"] = 1.0
    assert remote.ending is not None
    assert remote.ending.find(steps) is None


def test_an_exact_motion_is_not_offered_by_a_scene_without_one() -> None:
    remote = local_or_remote_scene("twin(balls=5)")
    assert remote.exact is None


def test_exact_motion_of_a_plugin_equals_that_of_the_built_in_scene() -> None:
    remote, here = local_or_remote_scene("bouncing"), make_scene("bouncing_ball")
    assert remote.exact is not None
    assert here.exact is not None
    np.testing.assert_array_equal(remote.exact(0.7).position, here.exact(0.7).position)


@pytest.mark.slow
def test_a_block_given_by_functions_falls_bounces_and_is_stopped_by_friction() -> None:
    """v_T is lost to friction 0.5 · 1.5 · v_N in the first impact, v_N = √(2 g h)."""
    stepper = "Extrapolated(tolerance=1e-5, min_step=1e-6)"
    reached = simulate(make_simulation_plan("block(mass=2.0)", stepper=stepper, duration=0.12))
    fall = np.sqrt(2.0 * 9.81 * 0.05)
    assert reached.state.velocity[0] == pytest.approx(1.0 - 0.5 * 1.5 * fall, abs=1e-4)
    assert reached.steps["kinetic_energy"][0] == pytest.approx(1.0, abs=1e-4)


@pytest.mark.slow
def test_joints_and_contacts_of_different_rows_move_in_the_same_bits_and_are_stored(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    plan = make_simulation_plan("coupled", stepper="Moreau(step=1e-3)", duration=0.02, tolerance=1e-8)
    simulate(plan, file, should_stop=iter([False] * 10 + [True]).__next__)
    reached = resume_simulation(file)
    system, state = runpy.run_path(str(PLUGIN))["coupled"]()
    for step in MidpointRule(system, plan.step_solver, plan.stop, 1e-3).steps(state, 20):
        state = step.state
    for name in ("position", "velocity", "keys", "impulses"):
        assert getattr(reached.state, name).tobytes() == getattr(state, name).tobytes(), name
    assert set(reached.steps["contacts"]) == {2}
    assert not reached.unsolved.any()


@pytest.mark.weekly
def test_a_motor_of_a_plugin_turns_its_body_in_the_same_bits_and_its_hinge_stays_closed() -> None:
    """The judge here receives the target speed; otherwise it would find the friction of the motor unsolved."""
    plan = make_simulation_plan("wiper(speed=1.5)", stepper="Moreau(step=2e-3)", duration=0.24, tolerance=1e-10)
    reached = simulate(plan)
    scene = runpy.run_path(str(PLUGIN))["wiper"](1.5)
    rule = MidpointRule(scene.system, plan.step_solver, plan.stop, 2e-3, depth=scene.depth)
    *steps, step = rule.steps(scene.start, 120)
    speeds = [one.state.velocity[4] for one in (*steps, step)]
    for name in ("position", "velocity", "keys", "impulses"):
        assert getattr(reached.state, name).tobytes() == getattr(step.state, name).tobytes(), name
    assert speeds[60] == pytest.approx(1.5, abs=1e-5)  # the hinge takes the third order of the step out of u
    assert speeds[-1] == pytest.approx(0.0, abs=1e-6)
    assert not reached.unsolved.any()
    overlaps = scene.system.overlaps(reached.state.position, 1e-6)
    assert overlaps is not None
    assert overlaps.joints is not None
    assert overlaps.joints.are_closed
    poses = scene.system.poses(reached.state.position)
    assert scene.system.joints.limits_below(poses, 1.0)[1].min() >= -1e-2
    there = local_or_remote_scene("wiper(speed=1.5)").system.assemble(scene.start.position, scene.start.velocity, 2e-3)
    assert there.contacts is not None
    assert there.contacts.drive is not None
    assert there.contacts.drive.tolist() == [0.0] * 5 + [1.5]


def test_a_simulation_asks_its_process_once_a_step_whatever_the_step_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    ask = RenewedWorker.ask

    def counted(worker: RenewedWorker, request: str, *arguments: Any, **options: Any) -> Any:
        asked.append(request)
        return ask(worker, request, *arguments, **options)

    plan = make_simulation_plan("block", stepper="Extrapolated(tolerance=1e-4, min_step=1e-6)", duration=0.12)
    monkeypatch.setattr(RenewedWorker, "ask", counted)
    reached = simulate(plan)
    assert len(reached.switches) == 2  # it hits the ground, and leaves it
    assert asked == ["begin", *["step"] * reached.n_steps]


def test_a_solver_object_solves_in_the_process_of_the_scene() -> None:
    reached = simulate(make_simulation_plan("block", stepper="Moreau(step=1e-3)", duration=0.11, solver=Elsewhere()))
    assert reached.steps["contacts"].any()
    assert not reached.unsolved.any()


def test_plugin_module_is_not_imported_in_the_main_process() -> None:
    simulate(make_simulation_plan("tower(balls=2)", duration=0.01))
    assert PluginFile.read(PLUGIN).module_name not in sys.modules


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "seconds", "words"),
    [
        ("raise", 60.0, "RuntimeError: oh no (line 49 of scene_plugin.py)"),
        ("exit", 60.0, "exit code 3"),
        pytest.param("hang", 2.0, "it took longer than 2 s", marks=pytest.mark.weekly),
        pytest.param("eat", 60.0, "MiB of memory", marks=pytest.mark.weekly),
    ],
)
def test_a_fault_of_the_scene_ends_the_simulation_at_its_step_and_keeps_all_before(
    fault: str, seconds: float, words: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.npz"
    plan = make_simulation_plan(f"faulty(fault={fault!r})", duration=1.0, step_seconds=seconds)
    with pytest.raises(FailedSimulationError) as caught:
        simulate(plan, file)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    kept = read_simulation(file)
    assert kept.failure is not None
    assert kept.n_steps > 50
    with pytest.raises(FailedSimulationError):
        resume_simulation(file)  # a fresh process is at fault later
    assert read_simulation(file).n_steps > kept.n_steps


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("towr", "did you mean 'tower'?"),
        ("tower(bals=3)", "the scene 'tower' has no option 'bals'; did you mean 'balls'?"),
        ("tower(balls='x')", "cannot be built"),
        ("needy", "takes 'balls' without a default"),
        ("driven", "scene driven: "),
        ("nothing", "must return a Scene, or a system and its first State, got str"),
    ],
)
def test_a_scene_that_cannot_be_built_is_named(name: str, words: str) -> None:
    with pytest.raises((ProblemError, BenchError)) as caught:
        make_simulation_plan(name)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_the_listing_has_the_scenes_of_plugins_with_their_options_or_what_is_wrong() -> None:
    rows = {row["name"]: row for row in listing_rows("scenes")["scenes"]}
    assert rows["tower"]["options"] == ["balls=4", "friction=0.3"]
    assert rows["tower"]["source"] == f"plugin file {PLUGIN}"
    assert "without a default" in rows["needy"]["error"]


def test_a_plugin_that_offers_scenes_only_has_nothing_to_check(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", str(PLUGIN)]) == 2
    assert "provides only scenes" in capsys.readouterr().err


def test_the_process_of_a_scene_ends_with_it() -> None:
    system = RemoteSystem("tower", {}, 60.0)
    system.scene()
    running = system._workers
    assert running
    del system
    assert not running


@pytest.mark.parametrize(
    ("name", "request_answer"),
    [
        ("bouncing", lambda system, scene: system.scene()),
        ("bouncing", lambda system, scene: scene.kinetic_energy(scene.start.velocity)),
        ("bouncing", lambda system, scene: scene.exact(0.1)),
        ("bouncing", lambda system, scene: system.move(scene.start.position, scene.start.velocity, 0.1)),
        ("twin(balls=5)", lambda system, scene: scene.ending.find(np.zeros(1))),
    ],
)
def test_the_process_of_a_scene_ends_after_an_invalid_answer(
    name: str, request_answer: Callable[[RemoteSystem, Any], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    system = RemoteSystem(name, {}, 60.0)
    scene = system.scene()
    (worker,) = system._workers
    monkeypatch.setattr(worker, "ask", lambda *request: ({}, b""))
    with pytest.raises(FailedSceneError, match="its process sent an invalid answer"):
        request_answer(system, scene)
    assert worker.process == 0
    system.scene()  # a new process answers


@pytest.mark.slow
def test_the_command_simulates_reports_and_resumes_scenes_of_plugins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forget(PluginFile.read(PLUGIN))
    file, plugin = tmp_path / "a.npz", ["--plugin", str(PLUGIN)]
    line = ["simulate", "tower(balls=2)", "--duration", "0.01", "--no-progress", "--output", str(file)]
    assert run_command([*line, *plugin]) == 0
    printed = capsys.readouterr().out
    assert run_command(["report", str(file), *plugin]) == 0
    assert capsys.readouterr().out == printed
    assert run_command(["simulate", "--resume", str(file), "--duration", "0.02", "--no-progress", *plugin]) == 0
    assert read_simulation(file).state.time == pytest.approx(0.02)
    forget(PluginFile.read(PLUGIN))
    capsys.readouterr()
    assert run_command(["report", str(file)]) == 2
    assert f"plugin file {PLUGIN}; name it with --plugin" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("flat", "size[2] of a box must be positive and finite, got 0.0."),
        ("open", "joint 0 does not close at the start: its error is 0.1 m or rad; correct its points and axes"),
    ],
)
def test_bodies_that_cannot_move_are_wrong_usage(what: str, sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["simulate", f"broken(what={what!r})", "--plugin", str(PLUGIN)]) == 2
    assert capsys.readouterr().err.startswith(f"proxbench: {sentence}")
