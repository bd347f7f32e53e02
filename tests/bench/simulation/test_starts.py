"""The named solver runs alone, with the start of the plan."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.trajectories.methods import make_method
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.starts import STARTS, StepSolver, scaled_start
from proxbench.problems import load
from proxbench.problems.contact.model import Model
from proxbench.problems.contact.problem import ContactProblem
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Solution, Solver, Status, Stop, create, solve
from proxbench.solvers.composite.fallback import ITERATIONS

Pour = Callable[..., SimulationPlan]


@dataclass
class Scripted:
    """A solver that records its solves and never converges."""

    name: str = "Scripted"
    model: Model = Model.COULOMB
    has_iterates: bool = False
    solves: list[tuple[bool, float]] = field(default_factory=list)

    def supports(self, problem: ContactProblem) -> None:
        return None

    def prepare(self, problem: ContactProblem) -> "Scripted":
        self.zero = np.zeros(problem.n_rows)
        return self

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        self.solves.append((start is not None and bool(np.any(start)), stop.max_iterations))
        return Solution(self.zero, Status.ITERATION_LIMIT, int(stop.max_iterations))


@pytest.mark.parametrize(
    ("start", "solves"),
    [
        ("warm", [(True, 800)]),
        ("cold", [(False, 800)]),
        ("warm-then-cold", [(True, 500), (False, 300)]),
        ("scaled", [(True, 800)]),
    ],
)
def test_the_named_solver_runs_alone_from_the_named_start(start: str, solves: list[tuple[bool, float]]) -> None:
    problem, solver = load("funnel-30"), Scripted()
    StepSolver(solver, start).prepare(problem).solve(Stop(1e-6, 800), np.ones(problem.n_rows))
    assert solver.solves == solves


def energy(problem: ContactProblem, impulses: np.ndarray) -> float:
    return float(0.5 * impulses @ (problem.relative_velocity(impulses) + problem.free_velocity))


@pytest.mark.parametrize("seed", range(5))
def test_a_scaled_start_has_the_least_energy_of_all_parts_of_the_impulses(seed: int) -> None:
    """The impulses are a third of a solution, the solution, and three times the solution."""
    problem = load("funnel-frictionless-30")
    solved = solve(problem, tolerance=1e-10).impulses
    noise = np.random.default_rng(seed).uniform(size=problem.n_rows) * solved.mean()
    for size in (1.0 / 3.0, 1.0, 3.0):
        given = size * (solved + noise)
        found = energy(problem, scaled_start(problem, given))
        assert found <= min(energy(problem, part * given) for part in np.linspace(0.0, 1.0, 101))


def test_a_scaled_start_is_the_solution_itself_and_zero_where_bodies_separate() -> None:
    """At a solution without friction Λᵀ(GΛ + c) = 0, so that s = 1."""
    problem = load("funnel-frictionless-30")
    solved = solve(problem, tolerance=1e-10).impulses
    assert scaled_start(problem, solved) == pytest.approx(solved, rel=1e-8)
    apart = ContactProblem(np.abs(problem.free_velocity), problem.laws, problem.matrix, problem.factors)
    assert not scaled_start(apart, solved).any()
    assert not scaled_start(problem, np.zeros(problem.n_rows)).any()


def test_each_start_has_its_name_in_the_plan_and_in_the_registry() -> None:
    assert list(STARTS) == ["warm", "cold", "warm-then-cold", "scaled"]
    for name in STARTS:
        assert make_simulation_plan("pile", start=name).record.start == name


@pytest.mark.parametrize("start", ["warm", pytest.param("cold", marks=pytest.mark.slow)])
def test_a_simulation_takes_the_steps_of_the_bare_solver(start: str, pour: Pour) -> None:
    plan = pour(125, solver="NSGS", tolerance=1e-30, start=start, max_iterations=700)
    length = plan.stepper.shortest_step(plan.scene)
    stepper = MidpointRule(
        plan.scene.system, create("NSGS"), plan.stop, length, warm_start=start == "warm", depth=plan.scene.depth
    )
    *_, last = stepper.steps(plan.scene.start, 125)
    assert last.iterations > 500
    np.testing.assert_array_equal(simulate(plan).state.velocity, last.state.velocity)


def test_many_contacts_have_a_composite_that_the_plan_names() -> None:
    assert make_simulation_plan("pile").solver.name == "MomentumFallback"
    assert make_simulation_plan("pile", solver="SORprox").solver.name == "SORprox"


def test_a_step_that_the_solver_cannot_treat_says_why() -> None:
    with pytest.raises(BenchError, match="its solver does not support this step: it has spatial friction"):
        StepSolver(create("Enumeration"), "warm").prepare(load("funnel-30"))


@pytest.mark.weekly
def test_every_step_of_a_settling_pile_is_solved_and_a_single_attempt_is_not_enough() -> None:
    plan = make_simulation_plan("pile", {"balls": 60, "seed": 1}, duration=0.8)
    assert not simulate(plan).unsolved.any()
    single = make_simulation_plan(
        "pile", {"balls": 60, "seed": 1}, duration=0.8, solver=_first(plan), max_iterations=ITERATIONS
    )
    alone = simulate(single)
    assert alone.unsolved.any()


def _first(plan: SimulationPlan) -> str:
    """The first part of the plan's solver."""
    parts: tuple[Solver, ...] = getattr(plan.solver, "parts", ())
    return parts[0].name


def test_a_stepper_that_offers_no_impulses_starts_cold_and_refuses_another_start() -> None:
    assert make_simulation_plan("woodpecker", stepper="EventDriven").start == "cold"
    with pytest.raises(BenchError, match="EventDriven starts each solve from zero and does not support start=warm"):
        make_simulation_plan("woodpecker", stepper="EventDriven", start="warm")
    method = make_method("EventDriven with Enumeration", [1e-9])
    assert method.with_start("warm").record.start == method.record.start == "cold"
