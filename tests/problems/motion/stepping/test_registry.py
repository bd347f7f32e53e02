"""Steppers by name: each has one spelling, and all follow the same motion in consecutive steps."""

from itertools import pairwise

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.woodpecker import PERIOD, section_error
from proxbench.problems.motion.stepping.event_driven.event_driven import EventDriven
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.moreau import Moreau
from proxbench.problems.motion.stepping.registry import STEPPERS, make_stepper
from proxbench.problems.motion.stepping.step import AcceptedStep
from proxbench.problems.motion.stepping.step_doubling import StepDoubling
from proxbench.problems.motion.stepping.stepper import Stepper
from proxbench.solvers import Stop, create

STOP = Stop(1e-12, 100_000)


def followed(stepper: str, scene: str, duration: float, solver: str = "SORprox") -> list[AcceptedStep]:
    """Follow a scene from its start."""
    made = make_scene(scene)
    return list(make_stepper(stepper).steps(made, create(solver), STOP, made.start, duration))


@pytest.mark.parametrize(
    "stepper",
    [
        Moreau(),
        Moreau(5e-4),
        Extrapolated(),
        Extrapolated(tolerance=1e-4, levels=6, search="nested"),
        StepDoubling(max_step=0.01),
        EventDriven(flight=1e-6),
    ],
    ids=lambda stepper: stepper.name,
)
def test_a_stepper_is_made_again_from_its_name(stepper: Stepper) -> None:
    assert make_stepper(stepper.name) == stepper


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("Extrapolatd", r"there is no stepper 'Extrapolatd'.*Extrapolated"),
        ("nonsense", "there is no stepper 'nonsense'; known are EventDriven, Extrapolated, Moreau, StepDoubling"),
        ("moreau", r"there is no stepper 'moreau'; did you mean 'Moreau'\?"),
        ("Moreau(step_size=1e-3)", r"Moreau has no option 'step_size'; did you mean 'step'\?"),
        ("Moreau(step='x')", "step of Moreau must be a number"),
        ("Moreau(Extrapolated)", "as a stepper; name its options"),
        ("Extrapolated(tolerence=1e-3)", r"Extrapolated has no option 'tolerence'.*tolerance"),
        ("Extrapolated(levels=2.5)", "levels of Extrapolated must be a whole number"),
        ("Extrapolated(levels=None)", "levels of Extrapolated must be a whole number"),
        ("Extrapolated(search='nestet')", r"there is no search 'nestet'.*nested"),
        ("StepDoubling(tolerance='x')", "tolerance of StepDoubling must be a number"),
        ("Extrapolated(", "as a stepper; write a name"),
    ],
)
def test_an_unknown_stepper_or_option_is_reported_by_name(text: str, what: str) -> None:
    with pytest.raises(ProblemError, match=what):
        make_stepper(text)


@pytest.mark.parametrize(
    ("stepper", "what"),
    [
        ("Extrapolated(min_step=1e-2, max_step=1e-3)", "max_step must be finite and at least min_step"),
        ("Extrapolated(tolerance=-1.0)", "tolerance must be between 0 and 1"),
        ("Extrapolated(levels=1)", "levels must be at least 2"),
        ("Extrapolated(min_step=1e-30)", "too short to separate times"),
        ("StepDoubling(min_step=-1.0)", "min_step must be positive"),
        ("Moreau(step=-1.0)", "step of Moreau must be positive"),
        ("Moreau(step=2.0)", "must not be longer than the duration"),
        ("EventDriven(flight=0.0)", "flight must be positive"),
    ],
)
def test_numbers_out_of_range_are_named_before_anything_starts(stepper: str, what: str) -> None:
    with pytest.raises(ProblemError, match=what):
        make_stepper(stepper).check(make_scene("woodpecker"), 0.0, 1.0)


def test_a_scene_that_a_stepper_cannot_follow_is_refused_before_anything_starts() -> None:
    with pytest.raises(ProblemError, match="EventDriven supports scenes given by functions"):
        EventDriven().check(make_scene("pile(balls=2)"), 0.0, 1.0)


@pytest.mark.parametrize("name", STEPPERS)
def test_steps_join_without_gap_from_the_start_to_the_end(name: str) -> None:
    solver = "Enumeration" if name == "EventDriven" else "SORprox"
    scene = make_scene("woodpecker(start='cycle')")
    steps = followed(f"{name}()", "woodpecker(start='cycle')", 0.03, solver)
    np.testing.assert_array_equal(steps[0].begin.position, scene.start.position)
    assert all(after.begin is before.end for before, after in pairwise(steps))
    assert steps[-1].end.time == pytest.approx(0.03, abs=1e-9)
    assert all(step.seconds >= 0.0 and step.rejected >= 0 for step in steps)


@pytest.mark.parametrize(
    ("name", "step"), [("Moreau", 1e-3), ("Extrapolated", 0.02), ("StepDoubling", 0.02), ("EventDriven", 0.02)]
)
def test_every_stepper_takes_the_longest_step_of_the_scene_through_smooth_motion(name: str, step: float) -> None:
    """A block that slides up without stopping has no switches; errors are rounding, or of first order."""
    scene = make_scene("block_on_incline(speed=1.0, friction=0.1)")
    assert scene.exact is not None
    solver = "Enumeration" if name == "EventDriven" else "SORprox"
    steps = followed(name, "block_on_incline(speed=1.0, friction=0.1)", 0.5, solver)
    lengths = [one.end.time - one.begin.time for one in steps]
    assert max(lengths) == pytest.approx(step, rel=0.05)
    assert not any(one.switches for one in steps)
    assert steps[-1].end.position == pytest.approx(scene.exact(steps[-1].end.time).position, abs=1e-8)


def test_a_fixed_step_is_one_solve_and_has_no_switching_points() -> None:
    for step in followed("Moreau(step=1e-3)", "bouncing_ball(height=0.05)", 0.2):
        ((solve, length),) = step.substeps
        assert (solve.state, length, step.solves, step.rejected) == (step.end, 1e-3, 1, 0)
        assert not step.switches


@pytest.mark.slow
def test_the_event_driven_reference_returns_to_the_section_more_accurately_than_time_stepping() -> None:
    """Its error is the rounding of the 45-digit limit cycle to doubles; time stepping is limited by its tolerance."""
    reference = followed("EventDriven", "woodpecker(start='cycle')", PERIOD, "Enumeration")
    stepped = followed("Extrapolated", "woodpecker(start='cycle')", PERIOD)
    assert section_error(reference[-1].end) < 1e-9
    assert section_error(reference[-1].end) < section_error(stepped[-1].end) < 1e-5
    found = [
        [
            (switch.law, switch.contact, switch.after)
            for step in steps
            for switch in step.switches
            if 1e-6 < switch.begin < PERIOD - 1e-6  # the section is an event of one motion, and the start of the other
        ]
        for steps in (reference, stepped)
    ]
    assert len(found[0]) == 11
    assert found[0] == found[1]
