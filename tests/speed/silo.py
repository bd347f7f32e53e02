"""Measure the effect of the tolerance of a step in pours of thousands of balls, and its cost.

A pour begins with balls on a lattice above the funnel. Means are over the second half of ``--duration``, in which balls
leave through the outlet: flow rate, mean height and energy lost (see ``MotionRecorder``), and the largest penetration
at the beginning of a step. Single trajectories are chaotic, so each setting runs with several seeds. Deviations are
relative to the tightest tolerance with the shortest step, seed by seed.

``python tests/speed/silo.py --balls 1000 4000 --output silo.csv`` measures; ``--from silo.csv`` prints the table of
this file in Markdown. Times are medians of the processor time of a step, over the second half.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.step_times import StepClocks
from proxbench.problems.motion.stepping.step import AcceptedStep
from proxbench.problems.motion.trajectories.pour import MotionRecorder

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4)
MAX_ITERATIONS = 500
SETTING = ["balls", "step", "tolerance"]
QUANTITIES = ("flow rate", "mean height", "energy lost")


def pour(balls: int, step: float, tolerance: float, seed: int, duration: float, outlet: float) -> dict[str, float]:
    """Simulate one pour and return its setting, its aggregates and its costs."""
    plan = make_simulation_plan(
        "funnel",
        {"balls": balls, "seed": seed, "outlet": outlet},
        stepper=f"Moreau(step={step:g})",
        duration=duration,
        tolerance=tolerance,
        max_iterations=MAX_ITERATIONS,
    )
    recorder, clocks, processor = MotionRecorder(plan.scene), StepClocks(plan.solver), [0.0]

    def on_step(_: int, taken: AcceptedStep) -> None:
        recorder.record(taken.end)
        processor.append(clocks.processor)

    result = simulate(plan, on_step=[on_step], watch_steps=clocks.watch)
    is_late = result.steps["time"] > 0.5 * duration
    steps = result.steps[is_late]
    return {
        "balls": balls,
        "step": step,
        "tolerance": tolerance,
        "seed": seed,
        **recorder.aggregates(duration),
        "penetration": float(steps["penetration"].max()),
        "contacts": float(steps["contacts"].mean()),
        "iterations": float(steps["iterations"].mean()),
        "unsolved": float((steps["residual"] > tolerance).mean()),
        "step_seconds": float(np.median(np.diff(processor)[is_late])),
    }


def deviations(rows: pd.DataFrame) -> pd.DataFrame:
    """Return a row per setting: means over seeds, and deviations from the best one of the same balls and seed."""
    tables = []
    for _, of_balls in rows.groupby("balls"):
        best = of_balls.sort_values(["step", "tolerance"]).groupby("seed").first()
        table = of_balls.groupby(SETTING, as_index=False).mean().drop(columns="seed")
        for name in QUANTITIES:
            relative = of_balls.set_index("seed")[name] / best[name].reindex(of_balls["seed"]) - 1.0
            grouped = relative.to_numpy()
            by_setting = of_balls.assign(deviation=grouped).groupby(SETTING)["deviation"]
            table[name + ", deviation"] = by_setting.mean().to_numpy()
            table[name + ", error"] = by_setting.sem().to_numpy()
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def markdown(table: pd.DataFrame) -> str:
    """Return the table of ``deviations`` in Markdown."""
    head = ["balls", "Δt", "tolerance", "contacts", "sweeps", "unsolved", "a step", *QUANTITIES, "penetration"]
    lines = [f"| {' | '.join(head)} |", "| ---: " * len(head) + "|"]
    for _, row in table.sort_values(SETTING, ascending=[True, True, False]).iterrows():
        cells = [f"{row['balls']:.0f}", f"{1e3 * row['step']:g} ms", f"{row['tolerance']:.0e}".replace("e-0", "e-")]
        cells += [f"{row['contacts']:.0f}", f"{row['iterations']:.0f}", f"{100 * row['unsolved']:.1f} %"]
        cells += [f"{1e3 * row['step_seconds']:.3g} ms"]
        for name in QUANTITIES:
            deviation, error = 100.0 * row[name + ", deviation"], 100.0 * row[name + ", error"]
            cells.append(f"{deviation:.1f} %" if np.isnan(error) else f"{deviation:.1f} ± {error:.1f} %")
        cells.append(f"{row['penetration']:.3f} r")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def measure(arguments: argparse.Namespace) -> pd.DataFrame:
    """Simulate all pours, in ``--jobs`` processes, and return one row for each."""
    seeds = range(arguments.seeds)
    settings = [
        (*setting, arguments.duration, arguments.outlet)
        for setting in product(arguments.balls, arguments.steps, arguments.tolerances, seeds)
    ]
    rows = []
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as executor:
        for row in executor.map(pour, *zip(*settings, strict=True)):
            rows.append(row)
            if arguments.output:
                pd.DataFrame(rows).to_csv(arguments.output, index=False)
    return pd.DataFrame(rows)


def main(words: Sequence[str] | None = None) -> None:
    """Measure or read, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--balls", type=int, nargs="+", default=[1000, 4000])
    parser.add_argument("--tolerances", type=float, nargs="+", default=list(TOLERANCES))
    parser.add_argument("--steps", type=float, nargs="+", default=[1e-3])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration", type=float, default=1.0, help="simulated time [s]")
    parser.add_argument("--outlet", type=float, default=4.5, help="radius of the outlet in ball radii")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--output", type=Path)
    parser.add_argument("--from", dest="stored", type=Path)
    arguments = parser.parse_args(words)
    rows = pd.read_csv(arguments.stored) if arguments.stored else measure(arguments)
    print(markdown(deviations(rows)))


if __name__ == "__main__":
    main()
