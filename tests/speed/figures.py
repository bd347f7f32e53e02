"""Twelve figures of the speed of the installed package, each prepared once and then repeated.

``pair.py`` runs this file in two processes with different states of the package and reads the processor times. A child
reads commands from its standard input, ``prepare FIGURE`` and ``run FIGURE COUNT``, and answers each with one line of
JSON. Both children start simulations from the same states, which are in the folder that is named on the command line.
"""

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from proxbench.problems import ContactProblem, judge, load, save_problem
from proxbench.problems.contact.residual import Residual
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

Repeat = Callable[[], Any]
"""One repetition of a figure."""

DEPTH, STEPS = 1e-4, 5
"""Penetration [m] that a projection leaves, and the steps of one repetition."""

FLOWING = 300
"""Steps of 1 ms after which a thousand balls flow through the outlet."""


def make_ten_contacts(folder: Path) -> Repeat:
    """Make a problem of ten contacts from its numbers."""
    return _maker("hard-stack-10")


def solve_ten_contacts(folder: Path) -> Repeat:
    """Prepare and solve ten contacts to 1e-8, from their numbers."""
    make, solver, stop = _maker("hard-stack-10"), create("Robust"), Stop(1e-8)
    return lambda: solver.prepare(make()).solve(stop)


def hundred_sweeps_over_factors(folder: Path) -> Repeat:
    """Sweep a hundred times over 1674 contacts, with W and M⁻¹."""
    return _sweeps("SORprox(relaxation=1.5, form='factors')")


def hundred_sweeps_over_matrix(folder: Path) -> Repeat:
    """Sweep a hundred times over 1674 contacts, with G."""
    return _sweeps("SORprox(relaxation=1.5)")


def prepare_1674_contacts(folder: Path) -> Repeat:
    """Prepare Robust for 1674 contacts."""
    problem, solver = load("funnel-1000"), create("Robust")
    return lambda: solver.prepare(problem.fresh())


def solve_340_contacts(folder: Path) -> Repeat:
    """Prepare and solve 340 contacts to 1e-6 by Robust."""
    return _solve("Robust", "funnel-300")


def solve_60_contacts_by_newton_steps(folder: Path) -> Repeat:
    """Prepare and solve 60 contacts to 1e-6 by InteriorPoint."""
    return _solve("InteriorPoint", "funnel-30")


def five_steps_of_thousand_balls_by_momentum(folder: Path) -> Repeat:
    """Take five steps of 1 ms of a thousand balls in flow, solved to 1e-2 by the default solver, with projection."""
    with np.load(folder / "flowing.npz") as kept:
        state = State(**kept)
    stepper = _balls("MomentumFallback")
    return lambda: list(stepper.steps(state, STEPS))


def five_steps_of_arch(folder: Path) -> Repeat:
    """Take five steps of 1 ms of an arch of rigid bodies, solved to 1e-6, with projection."""
    scene = make_scene("arch")
    stepper = MidpointRule(scene.system, create("Robust"), Stop(1e-6), 1e-3, depth=DEPTH)
    return lambda: list(stepper.steps(scene.start, STEPS))


def judge_1674_contacts(folder: Path) -> Repeat:
    """Judge impulses of 1674 contacts."""
    problem, impulses = _swept()
    return lambda: judge(problem, impulses)


def residual_of_1674_contacts(folder: Path) -> Repeat:
    """Compute the residual of an iterate of 1674 contacts."""
    problem, impulses = _swept()
    residual = Residual(problem)
    return lambda: residual(impulses, problem.relative_velocity(impulses))


def load_1674_contacts(folder: Path) -> Repeat:
    """Load a problem of 1674 contacts from a file."""
    file = folder / f"{os.getpid()}.npz"
    save_problem(load("funnel-1000"), file)
    return lambda: load(file)


FIGURES: dict[str, Callable[[Path], Repeat]] = {
    made.__name__.replace("_", " "): made
    for made in (
        make_ten_contacts,
        solve_ten_contacts,
        hundred_sweeps_over_factors,
        hundred_sweeps_over_matrix,
        prepare_1674_contacts,
        solve_340_contacts,
        solve_60_contacts_by_newton_steps,
        five_steps_of_thousand_balls_by_momentum,
        five_steps_of_arch,
        judge_1674_contacts,
        residual_of_1674_contacts,
        load_1674_contacts,
    )
}
"""The function that prepares each figure, by its name."""


def pour(folder: Path) -> None:
    """Pour a thousand balls, and save the state in which they flow."""
    *_, last = _balls("SORprox(relaxation=1.5, form='factors')").steps(make_scene("funnel(balls=1000)").start, FLOWING)
    np.savez(folder / "flowing.npz", **vars(last.state))


def _balls(solver: str) -> MidpointRule:
    return MidpointRule(make_scene("funnel(balls=1000)").system, create(solver), Stop(1e-2), 1e-3, depth=DEPTH)


def _maker(name: str) -> Callable[[], ContactProblem]:
    problem = load(name)
    c, laws, factors = problem.free_velocity, problem.laws, problem.factors
    assert factors is not None
    directions, inverse_mass = factors.force_directions, factors.inverse_mass.matrix
    return lambda: ContactProblem.from_factors(directions, inverse_mass, c, laws=laws)


def _sweeps(entry: str) -> Repeat:
    problem = load("funnel-1000")
    prepared: Any = create(entry).prepare(problem)
    iterates = prepared.begin(np.zeros(problem.n_rows))
    return lambda: iterates.sweep(100)


def _solve(entry: str, name: str) -> Repeat:
    problem, solver, stop = load(name), create(entry), Stop(1e-6)
    return lambda: solver.prepare(problem.fresh()).solve(stop)


def _swept() -> tuple[ContactProblem, Any]:
    problem = load("funnel-1000")
    return problem, create("SORprox(relaxation=1.5)").prepare(problem).solve(Stop(1e-4)).impulses


def seconds(repeat: Repeat, count: int) -> float:
    """Return the processor time of one of ``count`` repetitions [s]."""
    began = time.process_time()
    for _ in range(count):
        repeat()
    return (time.process_time() - began) / count


def answers(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the answer to each command; it is an error text for a figure that this state of the package lacks."""
    prepared: dict[str, Repeat] = {}
    for line in sys.stdin:
        command, figure, *count = json.loads(line)
        if command == "run":
            yield {"seconds": seconds(prepared[figure], *count)}
            continue
        try:
            repeat = prepared[figure] = FIGURES[figure](folder)
            seconds(repeat, 2)  # compiles
            yield {"seconds": seconds(repeat, 1)}
        except Exception as error:
            yield {"missing": f"{type(error).__name__}: {error}"}


if __name__ == "__main__":
    channel = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # output of the package goes to standard error
    for answer in answers(Path(sys.argv[1])):
        print(json.dumps(answer), file=channel, flush=True)
