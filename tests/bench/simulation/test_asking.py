"""A step is tried again, from zero and by others, where the last step's impulses lead nowhere."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from proxbench.bench.simulation.asking import TRY_ITERATIONS, WARM_ITERATIONS, Tries
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.problems import ContactProblem
from proxbench.solvers import Solution, Status, Stop

ONE = ContactProblem.from_delassus([[1.0]], [-1.0], dim=1)


@dataclass
class Scripted:
    """Answers 1 − error: solved from zero if it can, else stalled."""

    error: float = 0.0
    asked: list[tuple[int, bool]] = field(default_factory=list)

    def prepare(self, problem: ContactProblem) -> "Scripted":
        return self

    def solve(self, stop: Stop, start: np.ndarray | None = None, observe: object = None) -> Solution:
        self.asked.append((stop.max_iterations, start is not None))
        solved = start is None and self.error == 0.0
        wrong = 0.0 if solved else max(self.error, 0.5 * (start is not None))
        return Solution(
            np.array([1.0 - wrong]), Status.SOLVED if solved else Status.STALLED, min(stop.max_iterations, 700)
        )


def tries(first: Scripted, *others: Any) -> Tries:
    return Tries(ONE, first, others)


def test_a_start_that_falls_short_is_left_for_zero_and_both_are_counted() -> None:
    first = Scripted()
    solution = tries(first).solve(Stop(1e-4, 20_000), np.ones(1))
    assert first.asked == [(WARM_ITERATIONS, True), (20_000 - WARM_ITERATIONS, False)]
    assert solution.status is Status.SOLVED
    assert solution.iterations == WARM_ITERATIONS + 700
    assert solution.impulses == [1.0]


def test_others_are_asked_in_turn_and_the_last_gets_what_is_left() -> None:
    first, second, third = Scripted(0.3), Scripted(0.2), Scripted()
    solution = tries(first, second, third).solve(Stop(1e-4, 20_000), np.ones(1))
    assert [first.asked[1], second.asked[0]] == [(TRY_ITERATIONS, False)] * 2
    assert third.asked == [(20_000 - WARM_ITERATIONS - 2 * 700, False)]
    assert solution.status is Status.SOLVED


def test_without_any_success_the_best_answer_is_kept() -> None:
    solution = tries(Scripted(0.3), Scripted(0.1), Scripted(0.2)).solve(Stop(1e-4, 20_000), np.ones(1))
    assert solution.status is Status.STALLED
    assert solution.impulses == [0.9]


def test_the_limit_of_iterations_holds_for_all_together() -> None:
    first, second = Scripted(0.3), Scripted()
    solution = tries(first, second).solve(Stop(1e-4, WARM_ITERATIONS), np.ones(1))
    assert first.asked == [(WARM_ITERATIONS, True)]
    assert second.asked == []
    assert solution.status is Status.STALLED


def test_zero_is_asked_once() -> None:
    first = Scripted()
    tries(first).solve(Stop(1e-4, 2000), np.zeros(1))
    assert len(first.asked) == 1


def test_a_solver_that_somebody_chose_is_asked_alone() -> None:
    assert make_simulation_plan("pile").others
    assert make_simulation_plan("pile", solver="SORprox").others == ()


def test_every_step_of_a_settling_pile_is_solved_and_a_single_try_does_not_do() -> None:
    plan = make_simulation_plan("pile", {"balls": 60, "seed": 1}, duration=0.8)
    assert not simulate(plan).unsolved.any()
    single = make_simulation_plan(
        "pile", {"balls": 60, "seed": 1}, duration=0.8, solver=_tuned(plan), max_iterations=TRY_ITERATIONS
    )
    alone = simulate(single)
    assert alone.unsolved.any()


def _tuned(plan: SimulationPlan) -> str:
    """The plan's solver with another momentum: one that somebody has chosen is asked alone."""
    return plan.solver.name.replace("momentum=0.8", "momentum=0.79")
