"""Scenes with a closed form are registered with the fields of their classes as options, and their exact motion."""

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.scenes.known_motions import KNOWN_MOTIONS
from proxbench.problems.motion.scenes.registry import SCENES, make_scene
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.solvers import Stop, create


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "bouncing_ball" else ()) for name in KNOWN_MOTIONS]
)
def test_a_variable_step_follows_the_exact_motion(name: str) -> None:
    """Accelerations are constant between switches, so only the minimal step around each switch has an error."""
    scene = make_scene(name)
    steps = Extrapolated().steps(scene, create("SORprox"), Stop(1e-12, 100_000), scene.start, scene.duration)
    *_, last = steps
    assert scene.exact is not None
    exact = scene.exact(last.end.time)
    assert last.end.position == pytest.approx(exact.position, abs=1e-6)
    assert last.end.velocity == pytest.approx(exact.velocity, abs=1e-6)


@pytest.mark.parametrize("name", KNOWN_MOTIONS)
def test_the_exact_motion_begins_at_the_start_and_conserves_or_loses_energy(name: str) -> None:
    scene = make_scene(name)
    assert scene.exact is not None
    np.testing.assert_allclose(scene.exact(0.0).position, scene.start.position, atol=1e-15)
    states = [scene.exact(time) for time in np.linspace(0.0, scene.duration, 200)]
    energies = [scene.kinetic_energy(one.velocity) + scene.potential_energy(one.position) for one in states]
    assert np.diff(energies).max() <= 1e-8


def test_options_are_the_fields_of_the_class_with_what_its_docstring_says() -> None:
    options = SCENES["bouncing_ball"].options
    assert list(options) == [field.name for field in fields(BouncingBall)]
    assert options["restitution"].meaning == "e of the impacts, below 1"
    assert all(option.meaning for kind in SCENES.values() for option in kind.options.values())


@pytest.mark.parametrize("name", KNOWN_MOTIONS)
@pytest.mark.parametrize("wrong", [math.nan, math.inf, "x", True])
def test_nonfinite_and_nonnumeric_options_are_refused(name: str, wrong: Any) -> None:
    for option in KNOWN_MOTIONS[name].options:
        with pytest.raises(ProblemError):
            make_scene(name, {option: wrong})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("bouncing_ball(restitution=1.0)", "restitution of a bouncing ball must be in"),
        ("bouncing_ball(restitution=None)", "restitution must be a number"),
        ("newtons_cradle(n_balls=2.5)", "n_balls must be a whole number"),
        ("newtons_cradle(n_balls=1)", "at least 2"),
        ("stack(masses=1.0)", "masses must be a tuple of numbers"),
        ("stack(masses=(1.0, 'x'))", "masses must be a number"),
        ("stack(masses=())", "at least one ball"),
        ("sphere_on_incline(slope=2.0)", "between 0 and"),
    ],
)
def test_error_names_the_invalid_parameter(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words.replace("(", r"\(")):
        make_scene(text)


def test_a_scene_is_the_same_by_its_name_alone_and_with_options_beside_it() -> None:
    one, other = (
        make_scene("stack(masses=(1.0, 2.0), friction=0.3)"),
        make_scene("stack", {"masses": [1, 2], "friction": 0.3}),
    )
    assert one.options == other.options
    np.testing.assert_array_equal(one.start.position, other.start.position)
    block = make_scene("block_on_incline(speed=-1.0)")
    assert block.start.velocity[0] == -1.0


@pytest.mark.parametrize("name", sorted(set(KNOWN_MOTIONS) - {"stack"}))
def test_every_scene_but_a_stack_moves_by_default(name: str) -> None:
    scene = make_scene(name)
    assert scene.exact is not None
    way = scene.exact(scene.duration).position - scene.start.position
    assert np.abs(way).max() > 0.5 * scene.length
