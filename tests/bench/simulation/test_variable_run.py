"""Simulations with variable steps: stored data, resumption, and failed steps."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.errors import BenchError, FailedSimulationError
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import advance, resumable_simulation, simulate
from proxbench.problems import ContactProblem, Model
from proxbench.problems.contact.solver import Prepared, Solution
from proxbench.problems.motion.scenes.woodpecker import PERIOD, potential_energy
from proxbench.problems.motion.stepping import variable_stepper
from proxbench.problems.motion.stepping.sequences import StepCounter
from proxbench.problems.motion.stepping.step import AcceptedStep, Step
from proxbench.solvers import create

QUICK = "Extrapolated(tolerance=1e-4, min_step=1e-7)"


class Counting:
    """NSGS, which adds up the iterations of all its solves."""

    name, model, has_iterates = "Counting", Model.COULOMB, False

    def __init__(self) -> None:
        self._solver, self.iterations = create("NSGS"), 0

    def supports(self, problem: ContactProblem) -> str | None:
        return self._solver.supports(problem)

    def prepare(self, problem: ContactProblem) -> Any:
        return CountingPrepared(self, self._solver.prepare(problem))


@dataclass
class CountingPrepared:
    """A prepared solver whose iterations are added up."""

    counter: Counting
    inner: Prepared

    def solve(self, *arguments: Any) -> Solution:
        solution = self.inner.solve(*arguments)
        self.counter.iterations += solution.iterations
        return solution


def plan(duration: float = 0.03, **options: object) -> SimulationPlan:
    return make_simulation_plan("woodpecker", {"start": "cycle"}, duration=duration, stepper=QUICK, **options)  # type: ignore[arg-type]


def test_rows_describe_the_accepted_steps() -> None:
    taken: list[AcceptedStep] = []
    simulation = simulate(plan(), on_step=[lambda number, step: taken.append(step)])
    steps = simulation.steps
    assert len(steps) == len(taken) == simulation.n_steps
    assert steps["time"] == pytest.approx([step.end.time for step in taken])
    assert np.cumsum(steps["length"])[-1] == pytest.approx(0.03, abs=1e-9)
    assert steps["solves"].tolist() == [step.solves for step in taken]
    assert steps["rejected"].tolist() == [step.rejected for step in taken]
    assert (steps["residual"] <= 1.001e-12).all()
    assert len(simulation.switches) == sum(len(step.switches) for step in taken)
    last = simulation.trajectory[-1]
    assert steps["potential_energy"][-1] == pytest.approx(potential_energy(last[:3]), rel=1e-12)


def test_each_row_has_the_time_of_its_own_attempts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock advances by one second in each one-step solve, so seconds are numbers of solves.

    A step is accepted only after the next one was tried, and rejected attempts of a search take time as well.
    """
    now, take = [0.0], StepCounter.take

    def timed(*arguments: Any, **options: Any) -> Step:
        now[0] += 1.0
        return take(*arguments, **options)

    monkeypatch.setattr(StepCounter, "take", timed)
    monkeypatch.setattr(variable_stepper, "perf_counter", lambda: now[0])
    steps = simulate(plan()).steps
    assert len(set(steps["solves"])) > 3  # if rows were equal, exchanged times would not be noticed
    assert (steps["rejected"] > 0).any()
    np.testing.assert_array_equal(steps["seconds"], steps["solves"])


@pytest.mark.parametrize("stepper", [QUICK, "StepDoubling(tolerance=1e-3)", "Moreau(step=1e-3)"])
def test_iterations_are_those_of_all_attempts_as_are_the_times(stepper: str) -> None:
    solver = Counting()
    simulation = simulate(
        make_simulation_plan("woodpecker", {"start": "cycle"}, duration=0.01, stepper=stepper, solver=solver)
    )
    assert simulation.steps["iterations"].sum() == solver.iterations > 0


def test_energy_does_not_grow(tmp_path: Path) -> None:
    steps = simulate(plan(PERIOD)).steps
    energy = steps["kinetic_energy"] + steps["potential_energy"]
    assert np.diff(energy).max() <= 1e-4 * np.abs(energy).max()
    assert energy[-1] < energy[0]


def test_stored_simulation_equals_the_original(tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    simulation = simulate(plan(), file)
    stored = read_simulation(file)
    assert stored.is_finished
    assert stored.plan.record == simulation.plan.record
    for name in ("steps", "switches", "trajectory"):
        np.testing.assert_array_equal(getattr(stored, name), getattr(simulation, name))


def test_a_stopped_simulation_goes_on_to_the_same_end_within_its_tolerance(tmp_path: Path) -> None:
    whole = simulate(plan())
    file = tmp_path / "toy.npz"
    part = simulate(plan(), file, should_stop=iter([False] * 30 + [True]).__next__)
    assert part.n_steps == 30
    again = resumable_simulation(file)
    advance(again)
    assert again.is_finished
    assert again.trajectory[-1] == pytest.approx(whole.trajectory[-1], rel=2e-3, abs=2e-3)
    assert [tuple(row)[2:] for row in again.switches] == [tuple(row)[2:] for row in whole.switches]


class Tiring:
    """SORprox that gives up after thirty steps with contacts."""

    name, model, has_iterates = "SORprox", Model.COULOMB, False

    def __init__(self, failure: BaseException) -> None:
        self._solver, self._left, self._failure = create("SORprox"), 30, failure

    def supports(self, problem: ContactProblem) -> str | None:
        return self._solver.supports(problem)

    def prepare(self, problem: ContactProblem) -> Prepared:
        self._left -= 1
        if self._left < 0:
            raise self._failure
        return self._solver.prepare(problem)


@pytest.mark.parametrize("failure", [RuntimeError("no\nmore"), SystemExit(7)], ids=["raises", "exits"])
def test_a_simulation_whose_solver_fails_keeps_its_steps_and_goes_on_with_another(
    failure: BaseException, tmp_path: Path
) -> None:
    file = tmp_path / "toy.npz"
    with pytest.raises(
        FailedSimulationError, match=r"step \d+, from t = .*, failed with SORprox: .* --resume .*toy\.npz --solver"
    ):
        simulate(replace(plan(), solver=Tiring(failure)), file)
    kept = read_simulation(file)
    assert kept.n_steps > 0
    assert kept.failure is not None
    assert kept.failure.time == kept.state.time
    again = resumable_simulation(file, {"solver": "SORprox(relaxation=0.9)", "max_iterations": 100_000})
    advance(again)
    assert again.is_finished
    assert again.steps["time"][kept.n_steps - 1] == kept.state.time


def test_a_longer_duration_goes_on_and_another_scene_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    simulate(plan(0.01), file)
    longer = resumable_simulation(file, duration=0.02)
    advance(longer)
    assert longer.steps["time"][-1] == pytest.approx(0.02)
    with pytest.raises(BenchError, match="scene funnel contradicts"):
        resumable_simulation(file, {"scene": "funnel"})
    with pytest.raises(BenchError, match="has already reached"):
        resumable_simulation(file, duration=0.005)


def test_damaged_foreign_and_missing_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    simulate(plan(0.01), file)
    cut = tmp_path / "cut.npz"
    cut.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(BenchError, match=r"cut\.npz is damaged"):
        read_simulation(cut)
    other = tmp_path / "other.npz"
    np.savez(other, about=np.zeros(3, dtype=np.uint8))
    with pytest.raises(BenchError, match="is not a result file of a simulation"):
        read_simulation(other)
    with pytest.raises(BenchError, match="there is no result file"):
        read_simulation(tmp_path / "none.npz")
