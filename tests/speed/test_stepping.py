"""Time of one step of the funnel in its densest flow: find contacts, assemble, solve and move."""

from functools import cache
from typing import Any

import pytest
from contestants import SIZES, TOLERANCE
from proxbench.bench.simulation.generation.generate import FunnelRecipe, recipes
from proxbench.problems import judge
from proxbench.problems.motion.scenes.funnel import TIME_STEP
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create


@cache
def flowing(size: int) -> tuple[MidpointRule, State]:
    """The stepper, and the state at the instant of the library's problem ``funnel-SIZE``."""
    recipe = recipes()[f"funnel-{size}"]
    assert isinstance(recipe, FunnelRecipe)
    stepper = MidpointRule(recipe.scene.system(), create("SORprox", relaxation=1.5), Stop(TOLERANCE), TIME_STEP)
    state = recipe.scene.start()
    for step in stepper.steps(state, round(recipe.time / TIME_STEP)):
        state = step.state
    return stepper, state


@pytest.mark.parametrize("size", SIZES)
def test_one_step(benchmark: Any, size: int) -> None:
    stepper, state = flowing(size)
    step = stepper.step(state)
    assert step.problem is not None
    benchmark.extra_info.update(
        contacts=step.problem.n_contacts,
        iterations=step.iterations,
        judged_residual=judge(step.problem, step.impulses).residual,
    )
    benchmark.pedantic(stepper.step, args=(state,), rounds=100, warmup_rounds=3)


@pytest.mark.parametrize("size", SIZES)
def test_assembling_a_step(benchmark: Any, size: int) -> None:
    stepper, state = flowing(size)
    midpoint = stepper.system.move(state.position, state.velocity, 0.5 * TIME_STEP)
    benchmark.pedantic(stepper.system.assemble, args=(midpoint, state.velocity, TIME_STEP), rounds=100, warmup_rounds=3)
