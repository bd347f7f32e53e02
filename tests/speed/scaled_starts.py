"""Compare warm and scaled starts of steps on bodies, linkages and mechanisms: iterations and drift.

``python tests/speed/scaled_starts.py`` continues each motion of ``MOTIONS`` with both starts, and prints a table in
Markdown: the mean iterations of a step warm and scaled, the mean difference with its standard error over the steps, the
numbers of steps that do not reach the tolerance, and the largest distance of the last positions from those of the same
steps solved to 1e-10. Names of motions may follow; ``--solver`` and ``--tolerance`` select some. Other programs do not
matter.
"""

import argparse
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from proxbench.bench.simulation.generation.sequence_problems import STEP_STOP, SequenceRecipe, first_state
from proxbench.bench.simulation.starts import SCALED, WARM, StepSolver
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create

MOTIONS = {
    "box_stack": (SequenceRecipe("box_stack", 0.05), 20),
    "arch": (SequenceRecipe("arch(stones=13)", 0.05), 20),
    "card_house": (SequenceRecipe("card_house", 0.05), 20),
    "dominoes": (SequenceRecipe("dominoes", 0.3), 40),
    "hopper": (SequenceRecipe("hopper", 0.3), 40),
    "chain": (SequenceRecipe("chain(n_links=20)", 0.1), 40),
    "ball_on_chain": (SequenceRecipe("ball_on_chain", 0.1), 40),
    "four_bar": (SequenceRecipe("four_bar", 0.1), 40),
    "thrown_box": (SequenceRecipe("thrown_box"), 40),
    "woodpecker": (SequenceRecipe("woodpecker", 0.0), 400),
}
"""The first step of each motion, and the number of steps."""

SOLVERS, TOLERANCES = ("MomentumFallback", "Fallback(SORprox, Robust)", "SORprox"), (1e-2, 1e-4, 1e-8)
LIMITS = {"max_iterations": 5000, "max_seconds": 60.0}


class Motion(NamedTuple):
    """A motion: the iterations of its steps with contacts, the number of unsolved ones, and the last positions."""

    iterations: np.ndarray
    unsolved: int
    position: np.ndarray


def moved(recipe: SequenceRecipe, n_steps: int, begin: State, solver: str, stop: Stop, start: str) -> Motion:
    """Return the motion of ``n_steps`` steps from ``begin``."""
    scene = make_scene(recipe.scene)
    rule = MidpointRule(scene.system, StepSolver(create(solver), start), stop, scene.step_size, depth=scene.depth)
    steps = list(rule.steps(begin, n_steps))
    solved = [step for step in steps if step.status is not None]
    unsolved = sum(step.status is not Status.SOLVED for step in solved)
    return Motion(np.array([step.iterations for step in solved]), unsolved, steps[-1].state.position)


def row(recipe: SequenceRecipe, begin: State, exact: Motion, solver: str, motions: Sequence[Motion]) -> str:
    """Return the cells of one solver and tolerance, from the warm and the scaled motion."""
    warm, scaled = motions
    both = min(len(warm.iterations), len(scaled.iterations))
    apart = scaled.iterations[:both] - warm.iterations[:both]
    error = apart.std(ddof=1) / np.sqrt(both)
    errors = [np.abs(motion.position - exact.position).max() for motion in motions]
    return (
        f"{warm.iterations.mean():.4g} | {scaled.iterations.mean():.4g} | {apart.mean():+.3g} ± {error:.2g} | "
        f"{warm.unsolved}, {scaled.unsolved} | {errors[0]:.2g}, {errors[1]:.2g}"
    )


def main() -> None:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=[*MOTIONS])
    parser.add_argument("--solver", action="append")
    parser.add_argument("--tolerance", action="append", type=float)
    given = parser.parse_args()
    print("| motion | solver | to | warm | scaled | scaled − warm | unsolved | distance [m] |\n|" + " --- |" * 8)
    for name in given.names:
        recipe, n_steps = MOTIONS[name]
        begin = first_state(recipe)
        exact = moved(recipe, n_steps, begin, "Robust", STEP_STOP, WARM)
        for solver in given.solver or SOLVERS:
            for tolerance in given.tolerance or TOLERANCES:
                stop = Stop(tolerance, **LIMITS)
                motions = [moved(recipe, n_steps, begin, solver, stop, start) for start in (WARM, SCALED)]
                print(
                    f"| `{name}` | {solver} | {tolerance:.0e} | {row(recipe, begin, exact, solver, motions)} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
