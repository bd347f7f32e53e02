"""A scene of rigid bodies starts without errors and ends when a body leaves the world."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.scenes.registry import SCENES, make_scene
from proxbench.problems.motion.scenes.rigid.boxes import BoxStack
from proxbench.problems.motion.scenes.scene import WORLD_RADIUS, EndingRule, SceneEnding, bare_scene, bounded, completed
from proxbench.problems.motion.state import State


def rows(times: list[float], distances: list[float]) -> np.ndarray:
    return np.array(list(zip(times, distances, strict=True)), dtype=[("time", "<f8"), ("farthest", "<f8")])


def stack() -> tuple[RigidBodies, State]:
    return BoxStack(3).system(), BoxStack(3).start()


def test_a_body_beyond_the_world_ends_the_scene_with_one_sentence() -> None:
    system, start = stack()
    rule = bounded(bare_scene("stack", {}, system, start), system, 50.0).ending
    assert rule is not None
    assert rule.find(rows([0.1, 0.2], [1.0, 50.0])) is None
    ending = rule.find(rows([0.1, 0.2], [1.0, 50.5]))
    assert ending is not None
    assert (ending.name, ending.is_success) == ("left-world", False)
    assert ending.sentence == (
        "ended at 0.2 s: a body is 50.5 m from the origin, beyond the limit of 50 m; earlier steps are kept"
    )


def test_the_farthest_body_is_observed() -> None:
    system, start = stack()
    scene = bare_scene("stack", {}, system, start)
    position = start.position.copy()
    position[7:10] = 3.0, -4.0, 12.0
    assert scene.observables[-1].name == "farthest"
    assert scene.observables[-1].compute(State(0.0, position, start.velocity)) == pytest.approx(13.0)


def test_a_scene_keeps_its_own_ending_in_the_world() -> None:
    system, start = stack()
    own = SceneEnding("over", "it is over", True)
    scene = bare_scene("stack", {}, system, start)
    object.__setattr__(scene, "ending", EndingRule(0.3, lambda steps: own))
    rule = bounded(scene, system).ending
    assert rule is not None
    assert rule.seconds == 0.3
    assert rule.find(rows([0.2], [1.0])) is own
    left = rule.find(rows([0.2], [1.1 * WORLD_RADIUS]))
    assert left is not None
    assert left.name == "left-world"


def test_a_completed_scene_ends_if_a_body_leaves_the_world_whatever_was_replaced_in_it() -> None:
    system, start = stack()
    scene = bare_scene("stack", {}, system, start)
    for changed in (replace(scene, ending=None), replace(scene, observables=()), scene):
        made = completed(changed)
        assert [one.name for one in made.observables] == ["farthest"]
        assert made.ending is not None
        ending = made.ending.find(rows([0.1], [1.1 * WORLD_RADIUS]))
        assert ending is not None
        assert ending.name == "left-world"


def test_a_completed_scene_has_a_start_that_is_checked() -> None:
    system, start = stack()
    scene = bare_scene("stack", {}, system, start)
    sunk = replace(start, position=start.position - np.tile([0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.0], 3))
    with pytest.raises(ProblemError, match=r"penetrate by 0\.05 m at the start"):
        completed(replace(scene, start=sunk))
    with pytest.raises(ProblemError, match=r"penetrate by 0\.05 m at the start"):
        bare_scene("stack", {}, system, sunk)


def test_a_scene_without_rigid_bodies_is_complete() -> None:
    scene = make_scene("bouncing_ball")
    assert completed(scene) is scene


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_of_rigid_bodies_is_bounded_and_no_other(name: str) -> None:
    scene = make_scene(name)
    names = [one.name for one in scene.observables]
    assert names.count("farthest") == isinstance(scene.system, RigidBodies)


def test_a_start_beyond_the_world_is_refused() -> None:
    system, start = stack()
    position = start.position.copy()
    position[7] = 1.1 * WORLD_RADIUS
    with pytest.raises(
        ProblemError, match="body 1 is 11000 m from the origin at the start, beyond the limit of 10000 m"
    ):
        bare_scene("stack", {}, system, replace(start, position=position))
