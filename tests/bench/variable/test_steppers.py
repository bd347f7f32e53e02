"""Steppers by name."""

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.variable.plan import make_variable_plan
from proxbench.bench.variable.steppers import Extrapolated, StepDoubling, make_stepper
from proxbench.problems import ProblemError


@pytest.mark.parametrize(
    "stepper", [Extrapolated(), Extrapolated(tolerance=1e-4, levels=6, search="nested"), StepDoubling(max_step=0.01)]
)
def test_a_stepper_is_made_again_from_its_name(stepper: Extrapolated | StepDoubling) -> None:
    assert make_stepper(stepper.name) == stepper


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("Extrapolatd", r"there is no stepper 'Extrapolatd'.*Extrapolated"),
        ("nonsense", "there is no stepper 'nonsense'; known are Extrapolated, Moreau, StepDoubling"),
        ("moreau", r"there is no stepper 'moreau'; did you mean 'Moreau'\?"),
        ("Moreau(step_size=1e-3)", r"Moreau\(step_size=1e-3\) is no variable stepper; .* --step-size"),
        ("Extrapolated(tolerence=1e-3)", r"Extrapolated has no option 'tolerence'.*tolerance"),
        ("Extrapolated(levels=2.5)", "levels of Extrapolated must be a whole number"),
        ("StepDoubling(tolerance='x')", "tolerance of StepDoubling must be a number"),
        ("Extrapolated(", "as a stepper; write a name"),
    ],
)
def test_what_is_no_stepper_is_named(text: str, what: str) -> None:
    with pytest.raises(BenchError, match=what):
        make_stepper(text)


def test_an_unknown_search_is_named() -> None:
    with pytest.raises(ProblemError, match=r"there is no search 'nestet'.*nested"):
        make_stepper("Extrapolated(search='nestet')")


@pytest.mark.parametrize(
    ("stepper", "what"),
    [
        ("Extrapolated(min_step=1e-2, max_step=1e-3)", "max_step must be finite and at least min_step"),
        ("Extrapolated(tolerance=-1.0)", "tolerance must be between 0 and 1"),
        ("Extrapolated(levels=1)", "levels must be at least 2"),
        ("StepDoubling(min_step=-1.0)", "min_step must be positive"),
    ],
)
def test_numbers_out_of_range_are_named_before_anything_starts(stepper: str, what: str) -> None:
    with pytest.raises(ProblemError, match=what):
        make_variable_plan("woodpecker", stepper=stepper)


def test_a_negative_duration_is_named() -> None:
    with pytest.raises(BenchError, match="duration must be positive"):
        make_variable_plan("woodpecker", duration=-1.0)
