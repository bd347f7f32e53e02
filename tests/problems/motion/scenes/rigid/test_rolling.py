"""A sphere and a cylinder roll to rest under rolling resistance as their closed forms predict."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.rolling import RollingCylinder, RollingSphere
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create


@pytest.mark.parametrize(("kind", "factor"), [(RollingSphere, 5.0 / 7.0), (RollingCylinder, 2.0 / 3.0)])
def test_a_round_body_rolls_to_rest_as_in_closed_form(
    kind: type[RollingSphere | RollingCylinder], factor: float
) -> None:
    """Velocities are exact; a stop at the fraction s of a step, with the deceleration a, shortens the distance by
    a (s − s²) Δt²/2.
    """
    scene = kind()
    assert scene.deceleration == pytest.approx(factor * 0.01 * 9.81 / 0.1, rel=1e-14)
    time_step = scene.stop_time / 100.5
    moreau = MidpointRule(scene.system(), create("Robust"), Stop(1e-12, 100_000), time_step)
    for step in moreau.steps(scene.start(), 150):
        assert step.status is Status.SOLVED
        exact = scene.exact(step.state.time)
        np.testing.assert_allclose(step.state.velocity, exact.velocity, atol=1e-7)
        np.testing.assert_allclose(
            step.state.position[:3], exact.position[:3], atol=1.1 * scene.deceleration * time_step**2 / 8
        )
    assert step.state.position[0] == pytest.approx(scene.speed**2 / (2.0 * scene.deceleration), abs=2e-5)
    assert np.abs(step.state.velocity).max() <= 1e-8


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rolling_sphere(resistance=0.0)", "resistance of a rolling body must be positive"),
        ("rolling_cylinder(friction=0.01)", "friction of a rolling body must be at least 0.06667"),
        ("rolling_cylinder(length=0.0)", "length of a cylinder must be positive"),
    ],
)
def test_error_names_the_invalid_parameter(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make_scene(text)
