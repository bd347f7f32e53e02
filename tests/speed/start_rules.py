"""Compare rules that select the start of a step: the last impulses, a multiple of them, or zero.

``python tests/speed/start_rules.py sweeps`` continues the motions of ``MOTIONS`` from the last impulses, and also
solves each step from the other starts. It prints the mean iterations of each start and of each rule in ``RULES``, which
see the residual and the energy of the starts. Names of motions may follow. ``python tests/speed/start_rules.py errors
1000`` prints the mean errors, ‖Λ − Λ*‖_G / ‖Λ*‖_G, that solves of a pour to 1e-2 and 1e-3 have from each start, with
standard errors; Λ* is a solution to 1e-5. Both tables are Markdown. Other programs do not matter.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scaled_starts
from momentum_rule import poured
from proxbench.bench.simulation.generation.sequence_problems import SequenceRecipe, first_state
from proxbench.bench.simulation.starts import scaled_start
from proxbench.problems import ContactProblem
from proxbench.problems.contact.residual import residual_under
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Solution, Status, Stop, create

MEASURED = "SORprox(relaxation=1.1, form='factors', momentum='measured')"
SOLVERS, TOLERANCES = (MEASURED, "SORprox"), (1e-2, 1e-4)

LINKED = ("box_stack", "arch", "card_house", "dominoes", "hopper", "chain", "four_bar")
FLOWS = {f"flow-{balls}": (SequenceRecipe(f"funnel(balls={balls})", 0.3), 40) for balls in (1000, 4000)}
MOTIONS = {name: scaled_starts.MOTIONS[name] for name in LINKED} | FLOWS
"""The first step of each motion, and the number of steps."""

MAX_ITERATIONS = 5000
ERROR_TOLERANCES, ERROR_TIMES, EXACT = (1e-2, 1e-3), np.arange(0.3, 0.6, 0.03), Stop(1e-5, max_seconds=120.0)


@dataclass(frozen=True)
class Tried:
    """One step from one start: its iterations, and the residual and the energy [J] of the start."""

    iterations: int
    residual: float
    energy: float


Step = dict[str, Tried]
"""A step from each start, by its name."""


def least_residual(step: Step) -> str:
    """Select the start with the least residual."""
    return min(step, key=lambda name: step[name].residual)


def zero_if_worse(step: Step) -> str:
    """Select zero if the last impulses have a larger residual."""
    return "zero" if step["warm"].residual > step["zero"].residual else "warm"


def scaled_if_worse(step: Step) -> str:
    """Select the multiple if the last impulses have a larger residual than zero."""
    return "scaled" if step["warm"].residual > step["zero"].residual else "warm"


def zero_above_its_energy(step: Step) -> str:
    """Select zero if the last impulses have a larger energy."""
    return "zero" if step["warm"].energy > step["zero"].energy else "warm"


RULES: dict[str, Callable[[Step], str]] = {
    "least residual": least_residual,
    "zero if worse": zero_if_worse,
    "scaled if worse": scaled_if_worse,
    "zero above its energy": zero_above_its_energy,
}


@dataclass
class Trying:
    """A solver that solves each step from all starts, and answers as from the last impulses."""

    solver_name: str
    steps: list[Step] = field(default_factory=list)

    def prepare(self, problem: ContactProblem) -> "Prepared":
        """Prepare a step."""
        return Prepared(self, problem)


@dataclass(frozen=True)
class Prepared:
    """A step to solve from all starts."""

    trying: Trying
    problem: ContactProblem

    def solve(self, stop: Stop, start: np.ndarray | None = None, observe: None = None) -> Solution:
        """Solve the step from each start."""
        problem, solver = self.problem, create(self.trying.solver_name)
        prepared, residual = solver.prepare(problem), residual_under(problem, solver.model)
        if start is None:
            return prepared.solve(stop)
        starts = {"warm": start, "scaled": scaled_start(problem, start), "zero": np.zeros(problem.n_rows)}
        solved = {name: prepared.solve(stop, impulses) for name, impulses in starts.items()}
        step = {}
        for name, impulses in starts.items():
            velocity, one = problem.relative_velocity(impulses), solved[name]
            energy = 0.5 * float(impulses @ (velocity + problem.free_velocity))
            count = one.iterations if one.status is Status.SOLVED else MAX_ITERATIONS
            step[name] = Tried(count, residual(impulses, velocity), energy)
        self.trying.steps.append(step)
        return solved["warm"]


def print_sweeps(names: Sequence[str]) -> None:
    """Print the mean iterations of each start and rule."""
    columns = ["warm", "scaled", "zero", "least of the three", *RULES]
    print(f"| motion | momentum | to | {' | '.join(columns)} |\n|{' --- |' * 3}{' ---: |' * len(columns)}")
    for name in names or MOTIONS:
        recipe, n_steps = MOTIONS[name]
        scene, begin = make_scene(recipe.scene), first_state(recipe)
        for solver in SOLVERS:
            for tolerance in TOLERANCES:
                trying = Trying(solver)
                stop = Stop(tolerance, MAX_ITERATIONS, 60.0)
                rule = MidpointRule(scene.system, trying, stop, scene.step_size, depth=scene.depth)
                list(rule.steps(begin, n_steps))
                steps = trying.steps
                counts = [[step[start].iterations for step in steps] for start in ("warm", "scaled", "zero")]
                counts.append(np.min(counts, axis=0).tolist())
                counts += [[step[select(step)].iterations for step in steps] for select in RULES.values()]
                cells = " | ".join(f"{np.mean(count):.3g}" for count in counts)
                print(
                    f"| `{name}` | {'measured' if solver == MEASURED else 'none'} | {tolerance:.0e} | {cells} |",
                    flush=True,
                )


def print_errors(sizes: Sequence[int]) -> None:
    """Print the mean errors of pours from each start."""
    print("| balls | to | warm | scaled | zero |\n| ---: | --- | ---: | ---: | ---: |")
    for balls in sizes:
        errors: dict[float, list[list[float]]] = {tolerance: [] for tolerance in ERROR_TOLERANCES}
        for problem, start in poured(balls, ERROR_TIMES):
            exact = create("Robust").prepare(problem).solve(EXACT)
            if exact.status is not Status.SOLVED:
                continue
            prepared = create(MEASURED).prepare(problem)
            for tolerance, rows in errors.items():
                starts = (start, scaled_start(problem, start), None)
                found = [prepared.solve(Stop(tolerance, MAX_ITERATIONS), one).impulses for one in starts]
                rows.append([length(problem, one - exact.impulses) / length(problem, exact.impulses) for one in found])
        for tolerance, rows in errors.items():
            means, spreads = np.mean(rows, axis=0), np.std(rows, axis=0, ddof=1) / np.sqrt(len(rows))
            cells = " | ".join(f"{mean:.3f} ± {spread:.3f}" for mean, spread in zip(means, spreads, strict=True))
            print(f"| {balls} | {tolerance:.0e} | {cells} |", flush=True)


def length(problem: ContactProblem, impulses: np.ndarray) -> float:
    """Return ‖Λ‖_G = √(ΛᵀGΛ)."""
    return float(np.sqrt(max(impulses @ (problem.relative_velocity(impulses) - problem.free_velocity), 0.0)))


if __name__ == "__main__":
    if sys.argv[1] == "errors":
        print_errors([int(word) for word in sys.argv[2:]])
    else:
        print_sweeps(sys.argv[2:])
