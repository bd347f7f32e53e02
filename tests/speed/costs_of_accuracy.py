"""Measure the cost of accuracy in scenes of rigid bodies, for quantities of practical interest.

``arch``     least thickness at which a masonry arch stands, over that of the equilibrium, by tolerance and step
``sizes``    the same for arches of 7 to 51 stones
``friction`` the same for arches of 27 stones with little friction, which collapse by hinging and sliding
``sliding``  when such an arch falls that has too little friction to stand at any thickness
``sweeps``   the same by the number of sweeps
``creep``    how far a stone moves in ten seconds in an arch that is one per cent thicker than necessary
``stack``    drift of ten boxes by the ratio of their masses, and by the depth at which they touch at the start
``drift``    drift of these boxes by tolerance and step
``cube``     how far a cube that slides along the ground lifts and sinks
``chain``    error of the energy of a chain
``swing``    energy of a chain, and of a heavy ball on it, over ten seconds
``orders``   errors of all scenes with a closed form as the step is halved, and the order of the midpoint rule
``joints``   how far joints open and the energy error, with and without closing them at each step
``linkages`` energy of a pendulum and a four-bar linkage over 10⁵ steps
``resting``  how far joints open and bodies penetrate if a linkage or a chain lies on the ground
``vanishing`` contacts of bodies at rest that open or change their keys, in 1000 steps
``free``     energy and momentum of free bodies over 10⁵ steps
``piles``    time of a step of 100, 1000 and 5000 boxes, the part for finding contacts, and redundancy
``cards``, ``dominoes``, ``containers``, ``walls`` motions with a known result; see ``known_motions.py``

``python tests/speed/costs_of_accuracy.py --tables arch stack`` prints these tables in Markdown. ``--output costs.csv``
stores them in a file, and ``--charts FOLDER`` draws them. Seconds are processor time of the steps; run
``proxbench warm`` before, so that kernels are compiled. All tables take one to two hours.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
from accuracy_charts import draw
from convergence_orders import free, orders
from joint_errors import joints, linkages, swing
from known_motions import cards, containers, dominoes, walls
from lasting_contacts import vanishing
from pile_costs import piles
from proxbench.problems.motion.equilibrium import bisect, find_equilibrium, problem_at_rest
from proxbench.problems.motion.scenes.rigid.arch import Arch
from proxbench.problems.motion.scenes.rigid.boxes import BoxStack, ThrownBox
from proxbench.problems.motion.scenes.rigid.linkages import Chain
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create
from resting_linkages import resting

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
STEPS = (1e-2, 5e-3, 2e-3)
STEP = 5e-3
"""Δt [s] in tables in which it does not vary."""

SWEEPS = (10, 30, 100, 300, 1000)
SWEEPING = ("NSGS", "SORprox")
SOLVERS = ("Robust", *SWEEPING, "InteriorPoint", "ClarabelCoulomb", "SemismoothNewton")
COMPARED = ("Robust", "NSGS", "InteriorPoint", "ClarabelCoulomb")
"""Solvers of work–precision diagrams, measured with each of ``STEPS``; others are measured only with ``STEP``."""

RELAXED = "ClarabelSOCP"
"""A solver of the convex model, which opens contacts that slide."""

MAX_ITERATIONS = 5000
MAX_SECONDS = 20.0
"""Processor time of one simulation [s]."""

MAX_DRIFT_SECONDS = 40.0
"""Processor time of one simulation of a stack [s], in which some solvers reach their limit of iterations."""

N_WARM_UP_STEPS = 5
"""Steps before those that are timed."""

FRICTION = 0.8
"""Friction coefficient of the joints of an arch in tables in which it does not vary."""

DURATION = 1.0
"""Simulated time [s] for which an arch must stand."""

FALLEN = 1e-3
"""Displacement [m] at which an arch of radius 1 m counts as falling; it takes less than a second."""

OVERLAP = 1e-5
"""Depth [m] of the contacts of a stack at the start; with less, the error of a step would open contacts."""

THROWN_OVER = 0.1
"""Drift [m] at which a simulation of a stack ends, the height of a box."""


@dataclass(frozen=True)
class Motion:
    """A simulated motion.

    Attributes:
        largest: largest observed value.
        time: simulated time [s].
        unsolved: number of steps that were not solved to the tolerance.
        iterations: mean number of iterations per step.
        seconds: processor time [s].
    """

    largest: float
    time: float
    unsolved: int
    iterations: float
    seconds: float


def simulate(
    scene: Any,
    observe: Callable[[State], float],
    solver: str,
    stop: Stop,
    step: float,
    duration: float,
    bound: float = math.inf,
    max_seconds: float = MAX_SECONDS,
) -> Motion:
    """Simulate until the observed value exceeds a bound, or ``max_seconds`` are over."""
    rule = MidpointRule(scene.system(), create(solver), stop, step)
    for _ in rule.steps(scene.start(), N_WARM_UP_STEPS):
        pass
    largest, state, unsolved, iterations, count = 0.0, scene.start(), 0, 0, 0
    steps, seconds = rule.steps(state, round(duration / step)), 0.0
    while largest <= bound and seconds <= max_seconds:
        began = time.process_time()
        taken = next(steps, None)
        seconds += time.process_time() - began
        if taken is None:
            break
        state, count = taken.state, count + 1
        unsolved += taken.status not in (Status.SOLVED, None)
        iterations += taken.iterations
        largest = max(largest, abs(observe(state)))
    return Motion(largest, state.time, unsolved, iterations / count, seconds)


def to_tolerance(tolerance: float) -> Stop:
    return Stop(tolerance, MAX_ITERATIONS, MAX_SECONDS)


@cache
def least_thickness(stones: int, friction: float = FRICTION) -> float:
    """Return the least t/R at which the arch can stand by the equilibrium program."""

    def stands(thickness: float) -> bool:
        return can_stand(Arch(stones, thickness, friction))

    return bisect(stands, 0.05, 0.4, 1e-6)


def can_stand(arch: Arch) -> bool:
    return find_equilibrium(problem_at_rest(arch.system(), arch.start())).can_stand


def thickness_ratio(stones: int, solver: str, stop: Stop, step: float, friction: float = FRICTION) -> float:
    """Return the least t/R at which the arch stands for a second of motion, over that of the equilibrium.

    Returns:
        The ratio to 2e-4; 0.5 if it stands even then, inf if it falls with 1.5.
    """
    return search_thickness(stones, solver, stop, step, friction)[0]


def search_thickness(
    stones: int, solver: str, stop: Stop, step: float, friction: float = FRICTION
) -> tuple[float, list[Motion]]:
    """Return the ratio of ``thickness_ratio``, and the motions that determine it."""
    exact, motions = least_thickness(stones, friction), list[Motion]()

    def stands(ratio: float) -> bool:
        arch = Arch(stones, ratio * exact, friction)
        motions.append(simulate(arch, arch.largest_displacement, solver, stop, step, DURATION, FALLEN))
        is_complete = motions[-1].time >= DURATION * (1.0 - 1e-9)  # otherwise it ran out of processor time
        return motions[-1].largest <= FALLEN and is_complete

    low, high = next(((1.0 - width, 1.0 + width) for width in (0.01, 0.1) if brackets(stands, width)), (0.5, 1.5))
    if high == 1.5 and not stands(high):
        return math.inf, motions
    if low == 0.5 and stands(low):
        return low, motions
    return bisect(stands, low, high, 2e-4), motions


def brackets(stands: Callable[[float], bool], width: float) -> bool:
    """Return whether an arch stands with the ratio 1 + width, and falls with 1 − width."""
    return stands(1.0 + width) and not stands(1.0 - width)


def ladder(
    solvers: Iterable[str], tolerances: Iterable[float] = TOLERANCES, compared: Sequence[str] = COMPARED
) -> Iterator[tuple[str, float, float]]:
    """Yield each solver with ``STEP``, or with each of ``STEPS`` [s] if it is compared, and with each tolerance."""
    for solver in solvers:
        for step in STEPS if solver in compared else (STEP,):
            for tolerance in tolerances:
                yield solver, step, tolerance


def arch() -> Iterator[dict[str, Any]]:
    for solver, step, tolerance in ladder((*COMPARED, "SORprox")):
        ratio, motions = search_thickness(7, solver, to_tolerance(tolerance), step)
        total = {name: sum(getattr(motion, name) for motion in motions) for name in ("time", "unsolved", "seconds")}
        yield {"solver": solver, "step": step, "tolerance": tolerance, "ratio": ratio, **total}


def sizes() -> Iterator[dict[str, Any]]:
    for stones in (7, 9, 13, 27, 51):
        limit = least_thickness(stones)
        for solver, step, tolerance in ladder(("Robust", "NSGS"), (1e-3, 1e-4, 1e-6)):
            ratio, motions = search_thickness(stones, solver, to_tolerance(tolerance), step)
            found = {"equilibrium": limit, "motion": ratio * limit, "ratio": ratio}
            cost = sum(motion.seconds for motion in motions) / sum(motion.time for motion in motions)
            yield {"stones": stones, "solver": solver, "step": step, "tolerance": tolerance, **found, "seconds": cost}


def friction() -> Iterator[dict[str, Any]]:
    for coefficient in (0.36, 0.33, 0.31):
        limit = least_thickness(27, coefficient)
        ratio = thickness_ratio(27, "Robust", to_tolerance(1e-6), STEP, coefficient)
        yield {"friction": coefficient, "equilibrium": limit, "motion": ratio * limit, "ratio": ratio}


def sliding() -> Iterator[dict[str, Any]]:
    for thickness in (0.2, 0.3):
        scene = Arch(27, thickness, 0.30)
        motion = simulate(scene, scene.largest_displacement, "Robust", to_tolerance(1e-6), STEP, 10.0, THROWN_OVER)
        yield {"friction": scene.friction, "thickness": thickness, "stands": can_stand(scene), **asdict(motion)}


def sweeps() -> Iterator[dict[str, Any]]:
    for solver in SWEEPING:
        for step in STEPS:
            for number in SWEEPS:
                ratio = thickness_ratio(7, solver, Stop(1e-12, number, math.inf), step)
                yield {"solver": solver, "step": step, "sweeps": number, "ratio": ratio}


def creep() -> Iterator[dict[str, Any]]:
    scene = Arch(7, 1.01 * least_thickness(7))
    for solver, step, tolerance in ladder(SOLVERS[:-1], compared=("Robust", "NSGS")):
        motion = simulate(scene, scene.largest_displacement, solver, to_tolerance(tolerance), step, 10.0, THROWN_OVER)
        yield {"solver": solver, "step": step, "tolerance": tolerance, **asdict(motion)}


def stack() -> Iterator[dict[str, Any]]:
    for overlap in (OVERLAP, 1e-9):
        for top, ratio in (("equal", 1.0), ("light", 1e3), ("light", 1e6), ("heavy", 1e3), ("heavy", 1e6)):
            scene = BoxStack(ratio=ratio, heavy_on_top=top == "heavy", overlap=overlap)
            for solver in SOLVERS:
                stop = Stop(1e-6, MAX_ITERATIONS, MAX_DRIFT_SECONDS)
                motion = simulate(scene, scene.drift, solver, stop, STEPS[0], 10.0, THROWN_OVER, MAX_DRIFT_SECONDS)
                yield {"overlap": overlap, "top": top, "ratio": ratio, "solver": solver, **asdict(motion)}


def drift() -> Iterator[dict[str, Any]]:
    scene = BoxStack(ratio=100.0, heavy_on_top=True, overlap=OVERLAP)
    for solver, step, tolerance in ladder(SOLVERS):
        stop = Stop(tolerance, MAX_ITERATIONS, MAX_DRIFT_SECONDS)
        motion = simulate(scene, scene.drift, solver, stop, step, 2.0, THROWN_OVER, MAX_DRIFT_SECONDS)
        yield {"solver": solver, "step": step, "tolerance": tolerance, **asdict(motion)}


def cube() -> Iterator[dict[str, Any]]:
    scene = ThrownBox()
    for solver, step, tolerance in ladder((*SOLVERS, RELAXED), (*TOLERANCES, 1e-10)):
        lifts: list[float] = []

        def observe(state: State, lifts: list[float] = lifts) -> float:
            lifts.append(scene.lift(state))
            return lifts[-1]

        motion = simulate(scene, observe, solver, to_tolerance(tolerance), step, 1.5)
        found = {"lift": max(lifts), "sink": -min(lifts), **asdict(motion)}
        yield {"solver": solver, "step": step, "tolerance": tolerance, **found}


def chain() -> Iterator[dict[str, Any]]:
    scene = Chain()
    system, start = scene.system(), scene.start()
    potential_energy = system.potential_energy
    assert potential_energy is not None

    def energy(state: State) -> float:
        return potential_energy(state.position) + system.kinetic_energy(state.velocity)

    begin = energy(start)
    height = begin - energy(scene.state(0.0 * scene.normal_modes()[0]))
    for solver, step, tolerance in ladder(SOLVERS):
        motion = simulate(
            scene, lambda state: (energy(state) - begin) / height, solver, to_tolerance(tolerance), step, 2.0
        )
        yield {"solver": solver, "step": step, "tolerance": tolerance, **asdict(motion)}


TABLES: dict[str, Callable[[], Iterator[dict[str, Any]]]] = {
    made.__name__: made
    for made in (
        *(arch, sizes, friction, sliding, sweeps, creep, stack, drift, cube, chain, swing),
        *(orders, joints, linkages, resting, vanishing, free, piles),
        *(cards, dominoes, containers, walls),
    )
}


def print_table(name: str, make: Callable[[], Iterator[dict[str, Any]]]) -> Iterator[pd.DataFrame]:
    """Print a table row by row; yield what has been measured of it after each row."""
    rows: list[dict[str, Any]] = []
    for row in make():
        if not rows:
            print(f"\n| {name} | {' | '.join(row)} |\n| --- |{' ---: |' * len(row)}")
        cells = [f"{one:.4g}" if isinstance(one, float) else str(one) for one in row.values()]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
        rows.append({"table": name, **row})
        yield pd.DataFrame(rows)


def main() -> None:
    """Measure, print, and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=(), help="tables to measure")
    parser.add_argument("--output", type=Path, default=Path("costs.csv"), help="file of the measurements")
    parser.add_argument("--charts", type=Path, help="folder for the charts of this file")
    options = parser.parse_args()
    for name in options.tables:
        kept = pd.read_csv(options.output) if options.output.exists() else pd.DataFrame({"table": []})
        for measured in print_table(name, TABLES[name]):
            pd.concat([kept[kept["table"] != name], measured]).to_csv(options.output, index=False)
    if options.charts:
        draw(pd.read_csv(options.output), options.charts, [*SOLVERS, RELAXED])


if __name__ == "__main__":
    main()
