"""A study has methods that suit its scene, and errors in its plan are reported before it starts."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene_plugin
from proxbench.bench.measure.trajectories.methods import stored_method
from proxbench.bench.measure.trajectories.plan import make_study_plan
from proxbench.bench.measure.trajectories.problems import trajectory_of
from proxbench.bench.measure.trajectories.task import TrajectoryTask
from proxbench.bench.plugins.files import use_plugin_files
from proxbench.problems import ProxbenchError
from proxbench.problems.exchange.plugins.offers import forget, registered
from proxbench.problems.motion.scenes.known_motions import KNOWN_MOTIONS
from proxbench.problems.motion.scenes.registry import make_scene, parse_scene
from proxbench.problems.motion.scenes.woodpecker import PERIOD


@pytest.fixture
def scenes() -> Iterator[None]:
    """Register the scenes of a plugin for one test."""
    use_plugin_files([Path(scene_plugin.__file__)])
    yield
    for file, _ in registered():
        forget(file)


def test_the_woodpecker_is_measured_over_its_limit_cycle() -> None:
    plan = make_study_plan("woodpecker")
    (trajectory,) = plan.record.trajectories
    assert (trajectory.name, trajectory.error) == ("woodpecker(start='cycle')", "limit cycle")
    assert trajectory.duration == PERIOD
    ladders = {method.record.name: method.record.values for method in plan.solvers}
    assert ladders["Moreau with SORprox"] == [PERIOD / n for n in (500, 1000, 2000, 5000, 10_000, 50_000)]
    assert set(ladders) >= {"Extrapolated(search='nested') with SORprox", "StepDoubling with SORprox"}


def test_a_pour_is_measured_over_seeds_against_a_finer_step() -> None:
    (trajectory,) = make_study_plan("funnel(balls=3, seed=7, friction=None)").record.trajectories
    assert (trajectory.name, trajectory.error) == ("funnel(balls=3, friction=None)", "aggregates")
    assert trajectory.members == [7, 8, 9, 10, 11, 12]
    plan = make_study_plan("pile", members=(0, 1))
    finest = min(value for method in plan.solvers for value in method.record.values if " with " in method.record.name)
    reference = plan.record.trajectories[0].reference
    assert reference is not None
    assert reference.values == [0.5 * finest]


@pytest.mark.parametrize("scene", KNOWN_MOTIONS)
def test_every_closed_form_is_compared_with_its_exact_end_by_fixed_and_variable_steps(scene: str) -> None:
    plan = make_study_plan(scene)
    (trajectory,) = plan.record.trajectories
    assert (trajectory.error, trajectory.reference) == ("end position", None)
    assert {method.stepper.partition("(")[0] for method in plan.solvers} == {"Moreau", "Extrapolated", "StepDoubling"}


@pytest.mark.parametrize("scene", KNOWN_MOTIONS)
def test_default_studies_move_except_those_of_stacks(scene: str) -> None:
    (trajectory,) = make_study_plan(scene).record.trajectories
    made = make_scene(*parse_scene(trajectory.name))
    assert made.exact is not None
    end = made.exact(made.start.time + trajectory.duration)
    way = float(np.abs(end.position - made.start.position).max())
    assert (way > made.length) is not scene.endswith("stack")


@pytest.mark.parametrize(
    ("scene", "error", "has_reference"),
    [("tower", "end position", True), ("bouncing", "end position", False), ("twin(balls=5)", "end position", True)],
)
@pytest.mark.usefixtures("scenes")
def test_scenes_of_plugins_are_measured_too(scene: str, error: str, has_reference: bool) -> None:
    (trajectory,) = make_study_plan(scene).record.trajectories
    assert (trajectory.error, trajectory.reference is not None) == (error, has_reference)


def test_another_motion_of_the_woodpecker_is_compared_with_a_finer_one() -> None:
    (trajectory,) = make_study_plan("woodpecker(gravity=9.0)", duration=0.01).record.trajectories
    assert trajectory.error == "end position"
    assert trajectory.reference is not None


def test_a_solver_that_is_named_is_compared_too() -> None:
    names = [method.record.name for method in make_study_plan("pile(balls=3)", ["Jprox", "NSGS"]).solvers]
    assert "Jprox in Moreau(step=0.001)" in names
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("scene", "options", "words"),
    [
        ("funel", {}, "there is no scene 'funel'; did you mean 'funnel'"),
        ("funnel", {"members": [1]}, "at least 2"),
        ("funnel", {"members": [1, -2]}, r"members must be seeds, got -2\.0"),
        ("funnel", {"members": [1.2, 1.7]}, r"members must be seeds, got 1\.2"),
        ("bouncing_ball", {"members": [0.0]}, "positive factors, got 0"),
        ("bouncing_ball", {"members": []}, "positive factors, got none"),
        ("funnel(balls=0)", {}, "balls"),
        ("funnel", {"duration": -1.0}, "duration"),
        ("funnel", {"duration": 1e-9}, "step of Moreau"),
        ("funnel", {"solvers": ["SORprx"]}, "SORprox"),
        ("funnel", {"methods": {"EventDriven with Enumeration": [1e-9]}}, "EventDriven supports"),
        ("woodpecker", {"methods": {"Extrapolated(min_step=1e-30) with NSGS": [1e-3]}}, "too short to separate"),
    ],
)
def test_impossible_study_is_rejected(scene: str, options: dict[str, Any], words: str) -> None:
    with pytest.raises(ProxbenchError, match=words):
        make_study_plan(scene, **options)


def test_the_members_of_a_study_may_be_given_by_an_iterator() -> None:
    (trajectory,) = make_study_plan("pile(balls=3)", members=iter([3, 1, 2])).record.trajectories
    assert trajectory.members == [3, 1, 2]


@pytest.mark.parametrize("members", [[True, False], {0: 1, 1: 2}, "12", 1.0, np.array(1.0), [1j, 2j], ["1", "2"]])
def test_members_that_are_not_a_list_of_numbers_are_refused(members: Any) -> None:
    with pytest.raises(ProxbenchError, match="`members` must be a list of numbers"):
        make_study_plan("pile(balls=3)", members=members)


@pytest.mark.parametrize("start", ["warm", "cold", "warm-then-cold", "scaled"])
def test_all_methods_and_the_reference_of_a_study_have_its_start(start: str) -> None:
    plan = make_study_plan("pile(balls=3)", ["Jprox"], start=start)
    reference = plan.record.trajectories[0].reference
    assert reference is not None
    assert {method.record.start for method in plan.solvers} == {reference.start} == {start}
    assert {stored_method(method.record).record.start for method in plan.solvers} == {start}
    task = TrajectoryTask(trajectory_of(plan.record.trajectories[0]), plan.solvers[0], 1.0)
    assert task._plan(plan.solvers[0].record.values[0], 0.0).start == start


def test_a_study_with_an_unknown_start_is_refused() -> None:
    with pytest.raises(ProxbenchError, match="there is no start 'hot'"):
        make_study_plan("pile(balls=3)", start="hot")
