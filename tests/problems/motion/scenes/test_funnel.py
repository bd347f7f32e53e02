"""The funnel: initial positions of balls, that balls stay inside, and rows due to friction."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.effects import Effect, Friction, Gravity, Planar, Restitution
from proxbench.problems.motion.scenes.funnel import RADIUS, TIME_STEP, Funnel
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

DISCS = (Gravity(), Friction(0.3), Restitution(0.3), Planar())


def run(scene: Funnel, steps: int, tolerance: float = 1e-4) -> tuple[State, float, int]:
    """Final state, deepest penetration in radii, and rows of the last problem."""
    system, state, deepest, rows = scene.system(), scene.start(), 0.0, 0
    stepper = MidpointRule(system, create("SORprox", relaxation=1.3), Stop(tolerance, 20_000), TIME_STEP)
    for step in stepper.steps(state, steps):
        state = step.state
        if step.contacts is not None:
            deepest = max(deepest, float(-step.contacts.gap.min()) / RADIUS)
            rows = len(step.impulses)
    return state, deepest, rows


@pytest.mark.parametrize("scene", [Funnel(1), Funnel(30), Funnel(1000), Funnel(4000), Funnel(200, DISCS)])
def test_balls_start_apart_from_each_other_and_from_the_walls(scene: Funnel) -> None:
    system, start = scene.system(), scene.start()
    assert len(start.position) == scene.n_balls * system.dimension
    assert system.assemble(start.position, start.velocity, TIME_STEP).contacts is None


def test_the_same_seed_gives_the_same_balls_and_another_seed_others() -> None:
    assert np.array_equal(Funnel(50, seed=3).start().position, Funnel(50, seed=3).start().position)
    assert not np.array_equal(Funnel(50, seed=3).start().position, Funnel(50, seed=4).start().position)


@pytest.mark.parametrize(
    "effects", [(Gravity(), Friction(0.3), Restitution(0.3)), pytest.param(DISCS, marks=pytest.mark.slow)]
)
def test_a_closed_funnel_keeps_its_balls(effects: tuple[Effect, ...]) -> None:
    scene = Funnel(40, effects, outlet_radius=0.0)
    state, deepest, _ = run(scene, 600)
    centres = scene.system().centres(state.position)
    assert centres[:, -1].min() > 0.5 * RADIUS
    assert np.abs(centres[:, :-1]).max() < scene.wall_radius
    assert deepest < 0.15


def test_open_funnel_lets_balls_through() -> None:
    scene = Funnel(30)
    state, deepest, _ = run(scene, 1200)
    assert (scene.system().centres(state.position)[:, -1] < 0.0).mean() > 0.5
    assert deepest < 0.15


def test_the_frictionless_funnel_moves_as_with_zero_friction_on_a_third_of_the_rows() -> None:
    base = (Gravity(), Restitution(0.3))
    plain, _, fewer = run(Funnel(30, base), 500, tolerance=1e-13)
    full, _, rows = run(Funnel(30, (*base, Friction(0.0))), 500, tolerance=1e-13)
    assert np.abs(plain.position - full.position).max() <= 1e-10
    assert rows == 3 * fewer > 0


@pytest.mark.parametrize("arguments", [{"n_balls": 0}, {"outlet_radius": -1.0}])
def test_error_names_the_invalid_parameter(arguments: dict[str, float]) -> None:
    with pytest.raises(ProblemError, match=next(iter(arguments))):
        Funnel(**arguments)  # type: ignore[arg-type]
