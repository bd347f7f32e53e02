"""Stored runs as pandas frames."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .store import Store

TIMES = ("prepare_seconds", "solve_seconds", "total_seconds")

CASE_COLUMNS = (
    "problem",
    "solver",
    "model",
    "digest",
    "n_contacts",
    "n_rows",
    "outcome",
    "reason",
    "wall_seconds",
    "peak_memory_bytes",
)


@dataclass(frozen=True)
class RunFrames:
    """One run.

    Attributes:
        cases: one row a case: problem, solver, model, digest, sizes, outcome, reason, wall time, peak memory.
        points: one row a ladder point: problem, solver, model, tolerance, outcome, status, reason, iterations, judged
            residual (and that of the solver's own model), median times [s] with their quartiles, repeats, the other
            numbers of the verdict, and the error in known impulses.
        iterations: the convergence curves: problem, solver, iteration, residual.
        info: what run.json says.
        damaged: one sentence for each case file that could not be read.
    """

    cases: pd.DataFrame
    points: pd.DataFrame
    iterations: pd.DataFrame
    info: dict[str, Any]
    damaged: list[str]


def load(run_dir: Path | str) -> RunFrames:
    """Load a stored run; damaged case files are left out and named.

    Raises:
        BenchError: if the folder is no run, or its run.json is damaged.
    """
    store = Store.open(Path(run_dir))
    info = store.read_info()
    cases, damaged = store.read_cases()
    order = {
        pair: number
        for number, pair in enumerate(
            (problem, solver) for problem in info["plan"]["problems"] for solver in info["plan"]["solvers"]
        )
    }
    cases.sort(key=lambda case: order.get((case["problem"], case["solver"]), len(order)))
    return RunFrames(
        cases=pd.DataFrame([[case[column] for column in CASE_COLUMNS] for case in cases], columns=list(CASE_COLUMNS)),
        points=_points(cases),
        iterations=_iterations(cases),
        info=info,
        damaged=damaged,
    )


def _points(cases: list[dict[str, Any]]) -> pd.DataFrame:
    rows = []
    for case in cases:
        for point in case["points"]:
            row = {key: case[key] for key in ("problem", "solver", "model")}
            row |= {key: value for key, value in point.items() if key not in (*TIMES, "verdict")}
            for time in TIMES:
                quartiles = point.get(time, {})
                row[time] = quartiles.get("median", np.nan)
                row |= {f"{time}_{key}": value for key, value in quartiles.items() if key != "median"}
            row |= {key: value for key, value in point.get("verdict", {}).items() if key not in row}
            if "verdict" in point:  # JSON has no infinity; a residual that is not a number is infinite
                row |= {key: np.inf for key in ("residual", "model_residual") if row[key] is None}
            rows.append(row)
    columns = ["problem", "solver", "model", "tolerance", "outcome", "status", "reason", "iterations", "residual"]
    frame = pd.DataFrame(rows)
    return frame.reindex(columns=[*columns, "model_residual", *TIMES]) if frame.empty else frame


def _iterations(cases: list[dict[str, Any]]) -> pd.DataFrame:
    curves = [
        pd.DataFrame({"problem": case["problem"], "solver": case["solver"], **case["curve"]})
        for case in cases
        if case["curve"]["iteration"]
    ]
    columns = ["problem", "solver", "iteration", "residual"]
    frame = pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(columns=columns)
    frame["residual"] = pd.to_numeric(frame["residual"]).fillna(np.inf)
    return frame[columns]
