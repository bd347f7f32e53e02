"""Each method has a unique name, from which it can be created again, and which states what its ladder varies."""

import pytest
from proxbench.bench.measure.trajectories.methods import make_method, scaled_stepper, stored_method
from proxbench.problems import ProxbenchError
from proxbench.problems.motion.stepping.event_driven.event_driven import EventDriven
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.moreau import Moreau
from proxbench.problems.motion.stepping.step_doubling import StepDoubling

NAMES = (
    "Moreau with SORprox(relaxation=1.5)",
    "Extrapolated(search='nested') with Fallback(SORprox, NSGS)",
    "NSGS in StepDoubling(tolerance=0.001, search='last')",
    "Fallback(SORprox, NSGS) in Moreau(step=0.001)",
)


@pytest.mark.parametrize("name", NAMES)
def test_method_can_be_recreated_from_its_name(name: str) -> None:
    method = make_method(name, (1e-2, 1e-3), 1e-8)
    assert method.record.name == name
    assert stored_method(method.record) == method


def test_a_stepper_varies_by_its_step_or_its_tolerance_and_the_solver_stays() -> None:
    assert make_method("Moreau with NSGS", [1e-3], 1e-5).setting(1e-3) == (Moreau(step=1e-3), 1e-5)
    stepper, tolerance = make_method("Extrapolated(levels=2) with NSGS", [1e-4], 1e-9).setting(1e-4)
    assert (stepper, tolerance) == (Extrapolated(tolerance=1e-4, min_step=1e-6, levels=2), 1e-9)
    for least in (1e-5, StepDoubling.min_step):
        fixed = make_method(f"StepDoubling(min_step={least}) with NSGS", [1e-2], 1e-9).setting(1e-2)[0]
        assert fixed == StepDoubling(tolerance=1e-2, min_step=least)
    assert make_method("EventDriven with Enumeration", [1e-10]).setting(1e-10)[0] == EventDriven(tolerance=1e-10)


def test_a_solver_varies_by_its_tolerance_and_the_stepper_stays() -> None:
    assert make_method("NSGS in Moreau(step=1e-3)", [1e-5]).setting(1e-5) == (Moreau(step=1e-3), 1e-5)


def test_ladder_is_sorted_from_coarse_to_fine_without_duplicates() -> None:
    assert make_method("Moreau with NSGS", (1e-4, 1e-2, 1e-4)).record.values == [1e-2, 1e-4]


@pytest.mark.parametrize(("factor", "steps"), [(0.98, 98), (1.0, 100), (1.017, 102)])
def test_neighbours_of_a_fixed_step_have_whole_numbers_of_steps(factor: float, steps: int) -> None:
    assert scaled_stepper(Moreau(step=5e-3), factor, 0.5) == Moreau(step=0.5 / steps)


def test_neighbours_of_a_variable_step_have_neighbouring_tolerances() -> None:
    assert scaled_stepper(Extrapolated(tolerance=1e-5), 1.02, 0.5) == Extrapolated(tolerance=1.02e-5)


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("Moreau", [1e-3], "write a stepper with a solver"),
        ("Moro with SORprox", [1e-3], "write a stepper with a solver"),
        ("SORprox in Moro", [1e-3], "'Moreau'"),
        ("Moreau with SORprx", [1e-3], "'SORprox'"),
        ("Moreau(stp=1) with SORprox", [1e-3], "'step'"),
        ("Moreau with SORprox", [], "values between 0 and 1, got none"),
        ("Moreau with SORprox", [2.0], r"values between 0 and 1, got 2\.0"),
        ("Moreau with SORprox", [float("nan")], "values between 0 and 1, got nan"),
    ],
)
def test_unknown_method_is_rejected(name: str, values: list[float], words: str) -> None:
    with pytest.raises(ProxbenchError, match=words):
        make_method(name, values)
