"""Compilation during a step does not count as time of the step."""

from collections.abc import Callable, Iterator
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core import event
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.step_times import without_compilation
from proxbench.problems import ContactProblem, Model
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping import moreau, variable_stepper
from proxbench.problems.motion.stepping.step import AcceptedStep
from proxbench.solvers import create

Pour = Callable[..., SimulationPlan]


def compile_kernel() -> None:
    """Compile a kernel that is new each time."""
    njit(lambda x: x + 1.0)(1.0)


class Compiling:
    """SORprox on a clock that advances by a thousand seconds per compilation, and by one second per problem.

    Attributes:
        now: the clock.
        n_compiled: problems whose preparation compiles a kernel.
    """

    name, model, has_iterates = "Compiling", Model.COULOMB, False

    def __init__(self, n_compiled: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self._solver, self.now, self.n_compiled, self.n_prepared = create("SORprox"), 0.0, n_compiled, 0
        monkeypatch.setattr(event, "timer", lambda: self.now)
        for module in (moreau, variable_stepper):
            monkeypatch.setattr(module, "perf_counter", lambda: self.now)
        self.compiler = _MovingOn(self)

    def supports(self, problem: ContactProblem) -> str | None:
        return self._solver.supports(problem)

    def prepare(self, problem: ContactProblem) -> Any:
        self.now += 1.0
        self.n_prepared += 1
        if self.n_prepared <= self.n_compiled:
            with event.install_listener("numba:compiler_lock", self.compiler):
                compile_kernel()
        return self._solver.prepare(problem)


class _MovingOn(event.Listener):  # type: ignore[misc]
    """Advances the clock while the compiler runs."""

    def __init__(self, solver: Compiling) -> None:
        self.solver = solver

    def on_start(self, event: Any) -> None:
        self.solver.now += 1000.0

    def on_end(self, event: Any) -> None:
        """Do nothing: the end of a compilation takes no time."""


def test_fixed_steps_take_as_long_as_they_would_with_compiled_kernels(
    pour: Pour, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = Compiling(3, monkeypatch)
    steps = simulate(pour(solver=solver)).steps
    assert solver.now > 1000.0
    np.testing.assert_allclose(steps["seconds"], steps["contacts"] > 0)
    assert steps["seconds"].sum() > 10


@pytest.mark.parametrize("start", ["cycle", "published"])
def test_variable_steps_take_as_long_as_they_would_with_compiled_kernels(
    start: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = Compiling(5, monkeypatch)
    steps = simulate(make_simulation_plan("woodpecker", {"start": start}, duration=0.01, solver=solver)).steps
    assert solver.now > 1000.0
    assert steps["seconds"].sum() == pytest.approx(solver.n_prepared)


def test_a_compilation_in_the_attempt_after_a_step_is_taken_off_the_next_one() -> None:
    state = State(0.0, np.zeros(1), np.zeros(1))

    def steps() -> Iterator[AcceptedStep]:
        began = perf_counter()
        compile_kernel()
        yield AcceptedStep(state, state, (), seconds=1e-9)
        yield AcceptedStep(state, state, (), seconds=perf_counter() - began)

    first, second = without_compilation(steps())
    assert first.seconds == 0.0
    assert 0.0 <= second.seconds < 0.1
