"""Measure the gain and the cost of a warm start: iterations, the residual of the start, and the drift of the motion.

``python tests/speed/warm_starts.py iterations`` solves the steps of the suite ``sequences`` from zero and from the
solver's own answers, and prints the mean iterations, and a description of each step that takes more of them
warm. ``python tests/speed/warm_starts.py drift`` continues the motion of each sequence with each solver, and prints the
distance to the same motion with steps solved to 1e-10. Names of sequences may follow, for ``iterations`` also folders
that ``proxbench capture --every 1`` has written. ``python tests/speed/warm_starts.py guesses FILE.hdf5`` solves FCLIB
files from zero and from their stored guess. ``--solver`` and ``--tolerance`` select some.

Times are those of ``proxbench run --suite sequences``; this script counts iterations, so other programs do not matter
unless a solve reaches its time limit.
"""

import argparse
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import h5py
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
from proxbench.problems.exchange.sequences import BEFORE, warm_start_impulses
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create

SOLVERS = ("Robust", "SORprox", "NSGS", "InteriorPoint", "HybridNewton")
TOLERANCES = (1e-2, 1e-4, 1e-8)
LIMITS = {"max_iterations": 100_000, "max_seconds": 10.0}

EXACT_STOP = Stop(1e-8, 100_000, 60.0)
"""Limits of the answers whose contact states are compared."""

DRIFT_STEPS = 20
"""Steps after which motions are compared."""


def members(name: str) -> list[ContactProblem]:
    """Return the steps of a sequence, or those in a folder in the order of their names."""
    return [load(one) for one in SEQUENCE_MEMBERS.get(name) or sorted(Path(name).glob("*.npz"))]


def iterations(name: str, solvers: Sequence[str], tolerances: Sequence[float]) -> None:
    """Print the iterations of the steps of one sequence from zero and warm."""
    steps, robust = members(name), create("Robust")
    exact = cache(lambda index: robust.prepare(steps[index]).solve(EXACT_STOP).impulses)
    for solver in solvers:
        for tolerance in tolerances:
            counts = []
            start = None
            for index, step in enumerate(steps):
                prepared = create(solver).prepare(step)
                cold, warm = (prepared.solve(Stop(tolerance, **LIMITS), first) for first in (None, start))
                if start is not None:
                    counts.append((cold.iterations, warm.iterations, cold.status, warm.status))
                    if warm.iterations > cold.iterations:
                        print(f"    slower: {step.name} {solver} {tolerance:g} {counts[-1][:2]}", end=" ")
                        print(why(steps[index - 1], step, exact(index - 1), exact(index), start))
                follows = index + 1 < len(steps) and steps[index + 1].provenance.get(BEFORE) == step.name
                start = warm_start_impulses(step, warm.impulses, steps[index + 1]) if follows else None
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
    change = np.linalg.norm(new - carried) / (np.linalg.norm(new) or np.nan)  # nan if the answer is zero
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


def guesses(name: str, solvers: Sequence[str], tolerances: Sequence[float]) -> None:
    """Print the iterations on an FCLIB file from zero and from its guess, and the parts of the solver that ran."""
    problem = load(name)
    with h5py.File(name) as file:
        guess = file["guesses/1/r"][()]
    print(f"    {problem.name}: residual of the guess {judge(problem, guess).residual:.2g}")
    for solver in solvers:
        for tolerance in tolerances:
            prepared = create(solver).prepare(problem)
            found = [prepared.solve(Stop(tolerance, **LIMITS), start) for start in (None, guess)]
            cells = " | ".join(f"{one.iterations} {one.status} {one.message}" for one in found)
            print(f"| {problem.name} | {solver} | {tolerance:g} | {cells} |", flush=True)


def drift(name: str, solvers: Sequence[str], tolerances: Sequence[float]) -> None:
    """Print the distance of each solver's motion from the accurate one after ``DRIFT_STEPS`` steps of a sequence."""
    recipe = SEQUENCE_RECIPES[name]
    begin = first_state(recipe)
    exact = moved(recipe, begin, "Robust", STEP_STOP, WARM)
    way = np.abs(exact.position - begin.position).max()
    for solver in solvers:
        for tolerance in tolerances:
            ends = [moved(recipe, begin, solver, Stop(tolerance, **LIMITS), start) for start in (COLD, WARM)]
            errors = [np.abs(end.position - exact.position).max() for end in ends]
            print(f"| {name} | {solver} | {tolerance:g} | {way:.2g} | {errors[0]:.2g} | {errors[1]:.2g} |", flush=True)


def moved(recipe: SequenceRecipe, state: State, solver: str, stop: Stop, start: str) -> State:
    """Return the state after ``DRIFT_STEPS`` steps."""
    scene = make_scene(recipe.scene)
    rule = MidpointRule(scene.system, StepSolver(create(solver), start), stop, scene.step_size, depth=scene.depth)
    *_, last = rule.steps(state, DRIFT_STEPS)
    return last.state


def main() -> None:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["iterations", "drift", "guesses"])
    parser.add_argument("names", nargs="*", default=[*SEQUENCE_MEMBERS])
    parser.add_argument("--solver", action="append")
    parser.add_argument("--tolerance", action="append", type=float)
    given = parser.parse_args()
    tables = {"iterations": iterations, "drift": drift, "guesses": guesses}
    for name in given.names:
        tables[given.what](name, given.solver or SOLVERS, given.tolerance or TOLERANCES)


if __name__ == "__main__":
    main()
