"""Steps begin from the impulses of the last one and again from zero; what treats them is named in the plan."""

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.step_solver import StepSolver
from proxbench.problems import load
from proxbench.solvers import Solver, create
from proxbench.solvers.composite.fallback import ITERATIONS


def test_many_contacts_have_a_composite_that_the_plan_names() -> None:
    assert make_simulation_plan("pile").solver.name == "MomentumFallback"
    assert make_simulation_plan("pile", solver="SORprox").solver.name == "SORprox"


def test_a_step_that_the_solver_cannot_treat_says_why() -> None:
    with pytest.raises(BenchError, match="it cannot treat this step: it has Coulomb friction"):
        StepSolver(create("CvxpyQP")).prepare(load("funnel-30"))


@pytest.mark.slow
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
