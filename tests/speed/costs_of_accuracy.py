"""Measure what accuracy costs in scenes of rigid bodies, in the quantities that people look at.

``arch``     least thickness at which a masonry arch stands, over that of the equilibrium, by tolerance and step
``sizes``    the same for arches of 7 to 51 stones
``friction`` the same for arches of 27 stones with little friction, which collapse by hinging and sliding
``sliding``  when such an arch of any thickness falls, with less friction than it can stand with
``sweeps``   the same by the number of sweeps
``creep``    how far a stone of an arch moves in ten seconds that is one per cent thicker than it must be
``stack``    drift of ten boxes by the ratio of their masses, and by the depth at which they touch at the start
``drift``    drift of these boxes by tolerance
``cube``     how far a cube that slides along the ground lifts and sinks
``chain``    error of the energy of a chain
``orders``   errors of all scenes with a closed form where the step is halved, and the order of the midpoint rule
``joints``   how far joints open and what energy they keep, with and without closing them at each step
``free``     energy and momentum of free bodies over 10⁵ steps
``piles``    time of a step of 100, 1000 and 5000 boxes, the part of finding contacts, and redundancy

``python tests/speed/costs_of_accuracy.py --tables arch stack`` prints these tables in Markdown. ``--output costs.csv``
keeps them in a file, and ``--charts FOLDER`` draws what it holds. Seconds are processor time; those
of the first use of a kernel contain its compilation. All tables take half an hour.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import altair as alt
import pandas as pd
from convergence_orders import free, orders
from joint_errors import joints
from pile_costs import piles
from proxbench.bench.report.charts.drawing import heading, stacked, write_drawing
from proxbench.bench.report.charts.palette import Look, looks
from proxbench.problems.motion.equilibrium import bisect, find_equilibrium, problem_at_rest
from proxbench.problems.motion.scenes.rigid.arch import Arch
from proxbench.problems.motion.scenes.rigid.boxes import BoxStack, ThrownBox
from proxbench.problems.motion.scenes.rigid.linkages import Chain
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
EVEN_DECADES = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10]
STEPS = (1e-2, 5e-3, 2e-3)
STEP = 5e-3
"""Δt [s] where it does not vary."""

SWEEPS = (10, 30, 100, 300, 1000)
SWEEPING = ("NSGS", "SORprox")
SOLVERS = ("Robust", *SWEEPING, "InteriorPoint", "ClarabelCoulomb", "SemismoothNewton")
RELAXED = "ClarabelSOCP"
"""A solver of the convex model, which opens contacts that slide."""

MAX_ITERATIONS = 5000
MAX_SECONDS = 20.0
"""Processor time of one simulation [s]."""

FRICTION = 0.8
"""Friction coefficient of the joints of an arch where it does not vary."""

FALLEN = 1e-3
"""Displacement [m] at which an arch of radius 1 m counts as falling; it takes less than a second."""

OVERLAP = 1e-5
"""Depth [m] of the contacts of a stack at the start; less than what the error of a step moves a box loses contacts."""

THROWN_OVER = 0.1
"""Drift [m] at which a simulation of a stack ends, the height of a box."""


@dataclass(frozen=True)
class Motion:
    """A simulated motion.

    Attributes:
        largest: largest value of what was observed.
        time: simulated time [s].
        unsolved: number of steps that were not solved to the tolerance.
        iterations: mean number of iterations a step.
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
) -> Motion:
    """Simulate until the observed value exceeds a bound, or ``MAX_SECONDS`` are over."""
    rule = MidpointRule(scene.system(), create(solver), stop, step)
    largest, state, unsolved, iterations, count = 0.0, scene.start(), 0, 0, 0
    began = time.process_time()
    for taken in rule.steps(state, round(duration / step)):
        state, count = taken.state, count + 1
        unsolved += taken.status not in (Status.SOLVED, None)
        iterations += taken.iterations
        largest = max(largest, abs(observe(state)))
        if largest > bound or time.process_time() - began > MAX_SECONDS:
            break
    return Motion(largest, state.time, unsolved, iterations / count, time.process_time() - began)


def to_tolerance(tolerance: float) -> Stop:
    return Stop(tolerance, MAX_ITERATIONS, MAX_SECONDS)


@cache
def least_thickness(stones: int, friction: float = FRICTION) -> float:
    """Return the least t/R at which the equilibrium program says that the arch can stand."""

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
    exact = least_thickness(stones, friction)

    def stands(ratio: float) -> bool:
        arch = Arch(stones, ratio * exact, friction)
        return simulate(arch, arch.moved, solver, stop, step, 1.0, FALLEN).largest <= FALLEN

    low, high = next(((1.0 - width, 1.0 + width) for width in (0.01, 0.1) if brackets(stands, width)), (0.5, 1.5))
    if high == 1.5 and not stands(high):
        return math.inf
    if low == 0.5 and stands(low):
        return low
    return bisect(stands, low, high, 2e-4)


def brackets(stands: Callable[[float], bool], width: float) -> bool:
    """Return whether an arch stands with the ratio 1 + width, and falls with 1 − width."""
    return stands(1.0 + width) and not stands(1.0 - width)


def arch() -> Iterator[dict[str, Any]]:
    for solver in ("Robust", *SWEEPING):
        for step in STEPS if solver in ("Robust", "NSGS") else (STEP,):
            for tolerance in TOLERANCES:
                began = time.process_time()
                ratio = thickness_ratio(7, solver, to_tolerance(tolerance), step)
                seconds = time.process_time() - began
                yield {"solver": solver, "step": step, "tolerance": tolerance, "ratio": ratio, "seconds": seconds}


def sizes() -> Iterator[dict[str, Any]]:
    for stones in (7, 9, 13, 27, 51):
        for solver in ("Robust", "NSGS"):
            for tolerance in (1e-4, 1e-6):
                ratio = thickness_ratio(stones, solver, to_tolerance(tolerance), STEP)
                limit = least_thickness(stones)
                found = {"equilibrium": limit, "motion": ratio * limit, "ratio": ratio}
                yield {"stones": stones, "solver": solver, "tolerance": tolerance, **found}


def friction() -> Iterator[dict[str, Any]]:
    for coefficient in (0.36, 0.33, 0.31):
        limit = least_thickness(27, coefficient)
        ratio = thickness_ratio(27, "Robust", to_tolerance(1e-6), STEP, coefficient)
        yield {"friction": coefficient, "equilibrium": limit, "motion": ratio * limit, "ratio": ratio}


def sliding() -> Iterator[dict[str, Any]]:
    for thickness in (0.2, 0.3):
        scene = Arch(27, thickness, 0.30)
        motion = simulate(scene, scene.moved, "Robust", to_tolerance(1e-6), STEP, 10.0, THROWN_OVER)
        yield {"friction": scene.friction, "thickness": thickness, "stands": can_stand(scene), **asdict(motion)}


def sweeps() -> Iterator[dict[str, Any]]:
    for solver in SWEEPING:
        for step in STEPS:
            for number in SWEEPS:
                ratio = thickness_ratio(7, solver, Stop(1e-12, number, math.inf), step)
                yield {"solver": solver, "step": step, "sweeps": number, "ratio": ratio}


def creep() -> Iterator[dict[str, Any]]:
    scene = Arch(7, 1.01 * least_thickness(7))
    for solver in SOLVERS[:-1]:
        for step in STEPS if solver in ("Robust", "NSGS") else (STEP,):
            for tolerance in TOLERANCES:
                motion = simulate(scene, scene.moved, solver, to_tolerance(tolerance), step, 10.0, THROWN_OVER)
                yield {"solver": solver, "step": step, "tolerance": tolerance, **asdict(motion)}


def stack() -> Iterator[dict[str, Any]]:
    for overlap in (OVERLAP, 1e-9):
        for top, ratio in (("equal", 1.0), ("light", 1e3), ("light", 1e6), ("heavy", 1e3), ("heavy", 1e6)):
            scene = BoxStack(ratio=ratio, heavy_on_top=top == "heavy", overlap=overlap)
            for solver in SOLVERS:
                motion = simulate(scene, scene.drift, solver, to_tolerance(1e-6), STEPS[0], 10.0, THROWN_OVER)
                yield {"overlap": overlap, "top": top, "ratio": ratio, "solver": solver, **asdict(motion)}


def drift() -> Iterator[dict[str, Any]]:
    scene = BoxStack(ratio=100.0, heavy_on_top=True, overlap=OVERLAP)
    for solver in SOLVERS:
        for tolerance in TOLERANCES:
            motion = simulate(scene, scene.drift, solver, to_tolerance(tolerance), STEP, 2.0, THROWN_OVER)
            yield {"solver": solver, "tolerance": tolerance, **asdict(motion)}


def cube() -> Iterator[dict[str, Any]]:
    scene = ThrownBox()
    for solver in (*SOLVERS, RELAXED):
        for step in STEPS if solver == "Robust" else (STEP,):
            for tolerance in (*TOLERANCES, 1e-10):
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
    swing = begin - energy(scene.state(0.0 * scene.normal_modes()[0]))
    for solver in SOLVERS:
        for step in STEPS if solver in ("Robust", "NSGS") else (STEP,):
            for tolerance in TOLERANCES:
                stop = to_tolerance(tolerance)
                motion = simulate(scene, lambda state: (energy(state) - begin) / swing, solver, stop, step, 2.0)
                yield {"solver": solver, "step": step, "tolerance": tolerance, **asdict(motion)}


TABLES: dict[str, Callable[[], Iterator[dict[str, Any]]]] = {
    made.__name__: made
    for made in (arch, sizes, friction, sliding, sweeps, creep, stack, drift, cube, chain, orders, joints, free, piles)
}


def print_table(name: str, make: Callable[[], Iterator[dict[str, Any]]]) -> pd.DataFrame:
    """Print a table row by row; return it."""
    rows: list[dict[str, Any]] = []
    for row in make():
        if not rows:
            print(f"\n| {name} | {' | '.join(row)} |\n| --- |{' ---: |' * len(row)}")
        cells = [f"{one:.4g}" if isinstance(one, float) else str(one) for one in row.values()]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
        rows.append({"table": name, **row})
    return pd.DataFrame(rows)


def panel(
    rows: pd.DataFrame, value: str, title: str, least: float, most: float, styles: Mapping[str, Look]
) -> alt.LayerChart:
    """Return a value over the tolerance, a line for each solver; values are cut at ``least`` and ``most``."""
    shown, names = rows.assign(cut=rows[value].clip(least, most)), list(styles)
    colours, dashes = [one.colour for one in styles.values()], [one.dash for one in styles.values()]
    legend = alt.Legend(symbolType="stroke", symbolSize=500)
    axis = alt.Axis(format=".0e", tickCount=5, labelOverlap=True)
    even = alt.Axis(format=".0e", values=EVEN_DECADES)
    base = alt.Chart(shown).encode(
        x=alt.X("tolerance:Q", title="tolerance", axis=even).scale(type="log", reverse=True, nice=False),
        y=alt.Y("cut:Q", title=title, axis=axis).scale(type="log", domain=(least, most), nice=False),
        color=alt.Color("solver:N", title=None, sort=names, legend=legend).scale(domain=names, range=colours),
    )
    dash = alt.StrokeDash("solver:N", title=None, sort=names, legend=legend).scale(domain=names, range=dashes)
    layers = [base.mark_line(strokeWidth=2).encode(strokeDash=dash), base.mark_point(filled=True, size=45, opacity=1)]
    return alt.LayerChart(layer=layers).properties(width=210, height=200)


def draw(measured: pd.DataFrame, folder: Path) -> None:
    """Draw the two charts of the documentation."""

    def rows(table: str) -> pd.DataFrame:
        found = measured[measured["table"] == table]
        return found[found["step"].isna() | (found["step"] == STEP)]

    arches = rows("arch").assign(error=lambda table: (table["ratio"] - 1.0).abs())
    charts = {
        "arch-by-tolerance": (
            "An arch of seven stones, steps of 5 ms",
            [
                (arches, "error", "error of the least thickness", 1e-4, 0.1),
                (rows("creep"), "largest", "movement in 10 s [m]", 1e-11, 0.1),
            ],
        ),
        "stack-cube-chain-by-tolerance": (
            "A stack, a thrown cube and a chain, steps of 5 ms",
            [
                (rows("drift"), "largest", "drift of the stack in 2 s [m]", 1e-12, 1.0),
                (rows("cube"), "lift", "lift of the cube [m]", 1e-12, 1.0),
                (rows("chain"), "largest", "error of the energy in 2 s", 1e-14, 1.0),
            ],
        ),
    }
    for name, (title, panels) in charts.items():
        drawn = {solver for panel_rows, *_ in panels for solver in panel_rows["solver"]}
        styles = {solver: one for solver, one in looks([*SOLVERS, RELAXED]).items() if solver in drawn}
        row = alt.hconcat(*(panel(*one, styles) for one in panels), spacing=30)
        chart = stacked([row], heading(title, [], 700), {"color": "shared", "strokeDash": "shared"})
        write_drawing(chart, folder / name)


def main() -> None:
    """Measure, print, and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=(), help="tables to measure")
    parser.add_argument("--output", type=Path, default=Path("costs.csv"), help="file of the measurements")
    parser.add_argument("--charts", type=Path, help="folder for the charts of this file")
    options = parser.parse_args()
    for name in options.tables:
        measured = print_table(name, TABLES[name])
        kept = pd.read_csv(options.output) if options.output.exists() else pd.DataFrame({"table": []})
        pd.concat([kept[kept["table"] != name], measured]).to_csv(options.output, index=False)
    if options.charts:
        draw(pd.read_csv(options.output), options.charts)


if __name__ == "__main__":
    main()
