"""What a warm start is worth and what it costs: iterations, the residual of the start, and the drift of the motion.

``python tests/speed/warm_starts.py iterations`` solves the steps of the suite ``sequences`` from zero and from the
solver's own answers, and prints the mean iterations, and for each step that takes more of them warm what distinguishes
it. ``python tests/speed/warm_starts.py drift`` continues the motion of each sequence with each solver, and prints the
distance to the same motion with steps solved to 1e-10. Names of sequences may follow. Times are those of
``proxbench run --suite sequences``; this script counts, so that other programs do not matter.
"""

import sys
from collections.abc import Sequence

import numpy as np
from proxbench.bench.simulation.generation.sequence_problems import (
    SEQUENCE_RECIPES,
    STEP_STOP,
    SequenceRecipe,
    first_state,
)
from proxbench.bench.simulation.starts import COLD, WARM, StepSolver
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.exchange.catalog import SEQUENCE_MEMBERS
from proxbench.problems.exchange.sequences import warm_start_impulses
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create

SOLVERS = ("Robust", "SORprox", "NSGS", "InteriorPoint", "HybridNewton")
TOLERANCES = (1e-2, 1e-4, 1e-8)
LIMITS = {"max_iterations": 100_000, "max_seconds": 10.0}

DRIFT_STEPS = 20
"""Steps after which motions are compared."""


def iterations(name: str) -> None:
    """Print the iterations of the steps of one sequence from zero and warm."""
    steps = [load(member) for member in SEQUENCE_MEMBERS[name]]
    exact = [create("Robust").prepare(step).solve(STEP_STOP).impulses for step in steps]
    for solver in SOLVERS:
        for tolerance in TOLERANCES:
            counts = []
            start = None
            for index, step in enumerate(steps):
                prepared = create(solver).prepare(step)
                cold, warm = (prepared.solve(Stop(tolerance, **LIMITS), first) for first in (None, start))
                if start is not None:
                    counts.append((cold.iterations, warm.iterations, cold.status, warm.status))
                    if warm.iterations > cold.iterations:
                        print(f"    slower: {step.name} {solver} {tolerance:g} {counts[-1][:2]}", end=" ")
                        print(why(steps[index - 1], step, exact[index - 1], exact[index], start))
                if index + 1 < len(steps):
                    start = warm_start_impulses(step, warm.impulses, steps[index + 1])
            solved = [sum(row[column] is Status.SOLVED for row in counts) for column in (2, 3)]
            means = [float(np.mean([row[column] for row in counts])) for column in (0, 1)]
            slower = sum(warm > cold for cold, warm, *_ in counts)
            cells = (
                name,
                solver,
                f"{tolerance:g}",
                f"{solved[0]}/{solved[1]}",
                *(f"{mean:.4g}" for mean in means),
                slower,
            )
            print(f"| {' | '.join(map(str, cells))} |", flush=True)


def why(before: ContactProblem, step: ContactProblem, old: np.ndarray, new: np.ndarray, start: np.ndarray) -> str:
    """Return the residuals of the start and of zero, the change of the impulses, and how many contacts change state."""
    carried, states = warm_start_impulses(before, old, step), [state_names(before, old), state_names(step, new)]
    common = states[0].keys() & states[1].keys()
    changed = sum(states[0][key] != states[1][key] for key in common)
    residuals = [judge(step, impulses).residual for impulses in (start, np.zeros(step.n_rows))]
    change = np.linalg.norm(new - carried) / np.linalg.norm(new)
    return (
        f"residual of the start {residuals[0]:.2g}, of zero {residuals[1]:.2g}; |change|/|impulses| {change:.2f}; "
        f"{len(states[1]) - len(common)} new, {changed} of {len(common)} change state"
    )


def state_names(problem: ContactProblem, impulses: np.ndarray) -> dict[str, str]:
    """Return the state of each contact, "open", "stick" or "slip", by its key."""
    layout = problem.layout
    lanes, bound = layout.pad(impulses), layout.friction_coefficient
    found = {}
    for key, (normal, *tangential), mu in zip(problem.keys, lanes[:, : 1 + layout.sliding], bound, strict=True):
        is_slipping = np.hypot.reduce(tangential) >= (1.0 - 1e-6) * mu * normal if tangential else False
        found[key] = "open" if normal <= 0.0 else "slip" if is_slipping else "stick"
    return found


def drift(name: str) -> None:
    """Print how far each solver leads the motion of one sequence away in ``DRIFT_STEPS`` steps."""
    recipe = SEQUENCE_RECIPES[name]
    begin = first_state(recipe)
    exact = moved(recipe, begin, "Robust", STEP_STOP, WARM)
    way = np.abs(exact.position - begin.position).max()
    for solver in SOLVERS:
        for tolerance in TOLERANCES:
            ends = [moved(recipe, begin, solver, Stop(tolerance, **LIMITS), start) for start in (COLD, WARM)]
            errors = [np.abs(end.position - exact.position).max() for end in ends]
            print(f"| {name} | {solver} | {tolerance:g} | {way:.2g} | {errors[0]:.2g} | {errors[1]:.2g} |", flush=True)


def moved(recipe: SequenceRecipe, state: State, solver: str, stop: Stop, start: str) -> State:
    """Return the state after ``DRIFT_STEPS`` steps."""
    scene = make_scene(recipe.scene)
    rule = MidpointRule(scene.system, StepSolver(create(solver), start), stop, scene.step_size, depth=scene.depth)
    *_, last = rule.steps(state, DRIFT_STEPS)
    return last.state


def main(what: str, names: Sequence[str]) -> None:
    """Print one of the two tables."""
    for name in names or SEQUENCE_MEMBERS:
        {"iterations": iterations, "drift": drift}[what](name)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
