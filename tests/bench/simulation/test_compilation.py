"""What happens once, as compiling does, is charged to no step: shown on clocks that only solvers and steps move on."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from proxbench.bench.simulation import step_clock
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.problems import ContactProblem, Model
from proxbench.problems.motion.stepping import variable_stepper
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import create

Pour = Callable[..., SimulationPlan]


class Compiled:
    """SORprox whose first problem takes a thousand seconds, and any later one a second."""

    name, model, has_iterates = "SORprox", Model.COULOMB, False

    def __init__(self) -> None:
        self._solver, self.now, self.calls = create("SORprox"), 0.0, 0

    def supports(self, problem: ContactProblem) -> str | None:
        return self._solver.supports(problem)

    def prepare(self, problem: ContactProblem) -> Any:
        self.now += 1.0 if self.calls else 1000.0
        self.calls += 1
        return self._solver.prepare(problem)


def test_no_fixed_step_is_charged_with_what_happens_once(pour: Pour, monkeypatch: pytest.MonkeyPatch) -> None:
    solver = Compiled()
    monkeypatch.setattr(step_clock, "perf_counter", lambda: solver.now)
    steps = simulate(pour(solver=solver)).steps
    np.testing.assert_array_equal(steps["seconds"], steps["contacts"] > 0)
    assert steps["seconds"].sum() > 10


def test_a_first_step_that_is_free_is_not_charged_either(pour: Pour, monkeypatch: pytest.MonkeyPatch) -> None:
    now, step = [0.0], MidpointRule.step
    seen: list[bool] = []

    def timed(*arguments: Any) -> Step:
        now[0] += 1.0 if seen else 1000.0
        seen.append(True)
        return step(*arguments)

    monkeypatch.setattr(MidpointRule, "step", timed)
    monkeypatch.setattr(step_clock, "perf_counter", lambda: now[0])
    assert set(simulate(pour(5)).steps["seconds"]) == {1.0}


@pytest.mark.parametrize("start", ["cycle", "published"])
def test_no_variable_step_is_charged_with_what_happens_once(start: str, monkeypatch: pytest.MonkeyPatch) -> None:
    solver = Compiled()
    monkeypatch.setattr(variable_stepper, "perf_counter", lambda: solver.now)
    steps = simulate(make_simulation_plan("woodpecker", {"start": start}, duration=0.01, solver=solver)).steps
    assert 0.0 < steps["seconds"].max() < 1000.0
