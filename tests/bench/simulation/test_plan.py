"""Plans are checked before anything starts, and a resumed one must not be contradicted."""

from collections.abc import Callable

import pytest
from msgspec.structs import asdict
from proxbench.bench.errors import BenchError
from proxbench.bench.simulation.plan import SimulationPlan, check_agreement, make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.problems import ProxbenchError
from proxbench.problems.motion.stepping.moreau import Moreau

Pour = Callable[..., SimulationPlan]


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"stepper": "Moreau(step=0.0)"}, "step of Moreau must be positive"),
        ({"stepper": Moreau(float("nan"))}, "step of Moreau must be positive"),
        ({"duration": -1.0}, "`duration` must be positive"),
        ({"duration": float("inf")}, "`duration` must be positive and finite, got inf"),
        ({"stepper": "Moreau(step=0.2)", "duration": 0.1}, "must not be longer than the duration"),
        ({"tolerance": 1.0}, "between 0 and 1"),
        ({"tolerance": float("nan")}, "between 0 and 1"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"solver": "SORprx"}, "'SORprox'"),
        ({"solver": "Warm(NSGS)", "start": "cold"}, "is a separate option of a simulation; use NSGS with start=warm"),
    ],
)
def test_error_names_the_invalid_parameter(numbers: dict[str, float], words: str) -> None:
    with pytest.raises(ProxbenchError, match=words):
        make_simulation_plan("pile", {"balls": 2}, **numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("duration", "step_size", "steps"),
    [
        (0.3, 0.1, 3),
        (0.7, 1e-3, 700),
        pytest.param(0.7, 1e-4, 7000, marks=pytest.mark.weekly),
        (1.0, 0.3, 4),
        (0.1, 0.1, 1),
    ],
)
def test_the_last_step_reaches_the_end_of_the_duration(duration: float, step_size: float, steps: int) -> None:
    plan = make_simulation_plan("oblique_impact(distance=2.0)", duration=duration, stepper=Moreau(step_size))
    assert simulate(plan).n_steps == steps


def test_a_plan_made_again_from_its_record_is_the_same(pour: Pour) -> None:
    record = pour(options={"friction": None, "drag": 0.1}, solver="SORprox(relaxation=1.2)").record
    assert make_simulation_plan(**asdict(record)).record == record


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"scene": "funnel"}, "scene funnel contradicts old.npz, which has scene pile"),
        ({"scene": "pile(friction=0.4)"}, "friction 0.4 contradicts old.npz, which has friction 0.3"),
        ({"scene": "pile(friction=None)"}, "friction off contradicts"),
        ({"scene": "pile(balls=31)"}, "balls 31 contradicts"),
        ({"states": 3}, "states 3 contradicts"),
        ({"stepper": "Moreau(step=2e-3)"}, "stepper Moreau(step=0.002) contradicts old.npz, which has stepper"),
        ({"stepper": "Extrapolated"}, "stepper Extrapolated contradicts"),
    ],
)
def test_options_that_contradict_the_stored_plan_are_rejected(pour: Pour, given: dict[str, object], words: str) -> None:
    with pytest.raises(BenchError) as caught:
        check_agreement(pour(), given, "old.npz")
    assert words in str(caught.value)
    assert str(caught.value).count(". ") == 0


def test_options_equal_to_the_stored_plan_are_accepted(pour: Pour) -> None:
    plan = pour()
    check_agreement(plan, {"scene": "pile(balls=30, friction=0.3)", "stepper": "Moreau(step=1e-3)"}, "old.npz")
