"""Data of a page as one JSON document: tables of problems, solvers, cases, points and curves, in columns with names.

Python computes what no filter of the page changes: the time to each accuracy and the best point of every case. Times
have seven digits. Residuals have six and are rounded up, so that they compare with every accuracy of at most six digits
as the exact ones do.
"""

import math
from collections.abc import Iterable
from decimal import ROUND_CEILING, Context
from typing import Any

import numpy as np
import pandas as pd

from ...store.condition import drift, run_state
from ...store.frames import JUDGED, RunFrames
from ...store.ratios import reaching
from ...store.records import Machine, RunRecord
from ...store.store import plain_name
from ..accuracy import (
    SHIFT_SECONDS,
    claimed_cases,
    counted_cases,
    excluded_cases,
    summary_accuracies,
    times_to_accuracies,
)
from ..charts.palette import looks, on_dark
from ..charts.profiles import SHARE
from ..charts.templates import ROWS, templates
from ..profiles import BUDGETS, RESIDUALS, profile_accuracies
from ..tables import case_notes, ending
from .commands import option, protocol_options, run_command

MAX_TEXT = 4000
"""Last characters of the output of a failed case that a page holds; the file of the case has all."""

MAX_CURVE_POINTS = 300_000
"""Points of convergence curves in a page, of all cases together."""

MIN_CURVE_POINTS = 20
"""Points that a curve keeps however many cases there are."""

LAWS = {1: "no friction (1 row a contact)", 2: "planar friction (2 rows)", 3: "spatial friction (3 rows)"}
"""Laws of problems by their rows a contact."""

RECORDINGS = "recordings"
"""Folder of the recordings of a run."""

_UP = Context(prec=6, rounding=ROUND_CEILING)

_OF_ENDING = ("tolerance", "outcome", "status", "reason", "model_residual", "notes")
"""Columns of points that decide how a case ended."""

_IDENTITY = ["problem", "solver"]


def page_document(frames: RunFrames, baseline: str) -> dict[str, Any]:
    """Return everything that the page of a run shows.

    Args:
        frames: the run, over contact problems and with at least one case.
        baseline: the solver that speed-ups are against at first.
    """
    info = frames.info
    solvers = [name for name in info.plan.solvers if name in set(frames.cases["solver"])]
    named = looks(info.plan.solvers)
    accuracies = sorted({*info.plan.tolerances, *profile_accuracies(frames)}, reverse=True)
    return {
        "run": _about(frames),
        "machine": _machine(frames),
        "accuracies": accuracies,
        "accuracy": summary_accuracies(frames)[-1],
        "residuals": list(RESIDUALS),
        "budgets": list(BUDGETS),
        "solvers": _solvers(frames, solvers),
        "baseline": baseline,
        "problems": _problems(frames),
        "open": _first_drawable(frames),
        "cases": _cases(frames, accuracies),
        "points": _points(frames),
        "curves": _curves(frames),
        "charts": templates({name: named[name] for name in solvers}, frames.residual),
        "rows": ROWS,
        "share": SHARE,
    }


def _first_drawable(frames: RunFrames) -> str:
    """Return the first problem of which both charts of a page have something to draw, else the first one with points.

    An axis needs two different values.
    """
    points = frames.points[np.isfinite(frames.points["residual"]) & frames.points["total_seconds"].notna()]
    residuals = points.groupby("problem")["residual"].nunique()
    iterations = frames.iterations.groupby("problem")["iteration"].nunique()
    both = set(residuals.index[residuals > 1]) & set(iterations.index[iterations > 2])
    problems = list(dict.fromkeys(frames.cases["problem"]))
    found = (name for chosen in (both, set(points["problem"])) for name in problems if name in chosen)
    return str(next(found, problems[0]))


def _about(frames: RunFrames) -> dict[str, Any]:
    info = frames.info
    sentences = [*run_state(frames), *info.plan.left_out, *frames.damaged]
    return {
        "id": info.run_id,
        "suite": info.plan.suite,
        "folder": str(frames.folder),
        "residual": frames.residual,
        "root": "" if frames.residual == JUDGED else "../",
        "limit": info.plan.limits.solve_seconds,
        "shift": SHIFT_SECONDS,
        "command": run_command(info),
        "protocol": protocol_options(info),
        "sentences": sentences,
        "finished": frames.n_finished,
        "planned": frames.n_planned,
    }


def _machine(frames: RunFrames) -> dict[str, list[tuple[str, str]]]:
    """Return tables of names and values: the machine, versions, the protocol, sessions and plugins."""
    info, factor = frames.info, drift(frames)
    plan = info.plan
    limits = plan.limits
    protocol = {
        "passes": plan.passes,
        "seed": plan.seed,
        "judge": f"version {info.judge}",
        "time of a solve": f"{limits.solve_seconds:g} s",
        "time of a case": f"{limits.case_seconds:g} s",
        "memory of a case": f"{limits.memory_bytes / 2**20:.0f} MiB",
        "probes": "unknown" if np.isnan(factor) else f"90 % over 10 % quantile: {factor:.2f}",
    }
    machines = {one.host for one in info.sessions if one.machine is not None}
    names = [f"{one.started} on {one.host}" if len(machines) > 1 else one.started for one in info.sessions]
    ends = [f"to {one.finished}" if one.finished else "interrupted" for one in info.sessions]
    plugins = {f"{use.kind} {use.name}": f"{use.source} {use.sha256[:16]}".strip() for use in info.plugins}
    tables = {
        **_machines(info),
        "Versions": info.machine.versions.items(),
        "Protocol": protocol.items(),
        "Sessions": list(zip(names, ends, strict=True)),
        "Plugins": plugins.items(),
    }
    return {name: [(key, str(value)) for key, value in table] for name, table in tables.items() if table}


def _machines(info: RunRecord) -> dict[str, list[tuple[str, Any]]]:
    """Return a table of each machine that measured, called by its name where there are several."""
    measured = {one.host: one.machine for one in info.sessions if one.machine is not None} or {"": info.machine}
    names = {host: f"Machine {host}" if len(measured) > 1 else "Machine" for host in measured}
    return {names[host]: list(_hardware(machine).items()) for host, machine in measured.items()}


def _hardware(machine: Machine) -> dict[str, Any]:
    commit = machine.commit or "unknown"
    return {
        "processor": machine.processor,
        "cores": f"{machine.cores}, {machine.logical_cores} logical",
        "memory": f"{machine.memory_bytes / 2**30:.1f} GiB",
        "system": machine.system,
        "Python": machine.python,
        "threads": ", ".join(
            f"{pool.internal_api or pool.user_api}: {pool.num_threads}" for pool in machine.thread_pools
        ),
        "commit": f"{commit}, with changes that are not committed" if machine.dirty else commit,
        "source": machine.source or "unknown",
    }


def _solvers(frames: RunFrames, solvers: list[str]) -> list[dict[str, Any]]:
    named, models = (
        looks(frames.info.plan.solvers),
        dict(zip(frames.cases["solver"], frames.cases["model"], strict=True)),
    )
    return [
        {
            "name": name,
            "model": models[name],
            "file": plain_name(name),
            "option": option("solver", name),
            "on_dark": "#{:02x}{:02x}{:02x}".format(*on_dark(named[name].colour)),
            **vars(named[name]),
        }
        for name in solvers
    ]


def _problems(frames: RunFrames) -> list[dict[str, Any]]:
    firsts = {case["problem"]: case for case in frames.cases.drop_duplicates("problem").to_dict("records")}
    folder = frames.output_folder / RECORDINGS
    return [
        {
            "name": name,
            "family": case["family"],
            "law": _law(case["n_rows"], case["n_contacts"]),
            "contacts": case["n_contacts"],
            "rows": case["n_rows"],
            "digest": case["digest"],
            "file": plain_name(name),
            "option": option("problem", name),
            "recorded": (folder / f"{plain_name(name)}.rrd").is_file(),
        }
        for name, case in firsts.items()
    ]


def _law(rows: int, contacts: int) -> str:
    """Name the laws of a problem as far as its rows a contact say which they are."""
    if not contacts:
        return "no contact"
    return LAWS.get(rows // contacts, "more rows a contact") if rows % contacts == 0 else "mixed"


def _cases(frames: RunFrames, accuracies: list[float]) -> dict[str, list[Any]]:
    """Return the columns of the cases.

    ``seconds``, ``excluded`` and ``claimed`` have a value for each accuracy: the time to it (null where it is not
    reached), whether that time is of excluded rounds alone, and whether the solver claims to reach it.
    """
    points, limit = frames.points, frames.info.plan.limits.solve_seconds
    attempted = points[points["total_seconds"].notna()]
    attempts = dict(iter(attempted[[*_IDENTITY, *_OF_ENDING]].groupby(_IDENTITY, sort=False)))
    counted, times = set(counted_cases(frames).index), times_to_accuracies(points, accuracies, limit)
    seconds = dict(zip(times.index, times.to_numpy(), strict=True))
    excluded = [excluded_cases(points, accuracy, limit) for accuracy in accuracies]
    claimed = [claimed_cases(attempted, accuracy) for accuracy in accuracies]
    best = reaching(attempted, np.inf, limit).sort_values("residual", kind="stable").drop_duplicates(_IDENTITY)
    best_of = best.set_index(_IDENTITY)[["residual", "iterations"]].T.to_dict("list")
    rows = []
    for place, case in enumerate(frames.cases.to_dict("records")):
        name = case["problem"], case["solver"]
        of_case = attempts.get(name, attempted[list(_OF_ENDING)].iloc[:0])
        outcome, reason = ending(case, of_case)
        residual, iterations = best_of.get(name, (np.nan, np.nan))
        rows.append(
            {
                "problem": name[0],
                "solver": name[1],
                "supported": int(place in counted),
                "outcome": outcome,
                "reason": "; ".join(filter(None, (reason, case_notes(of_case)))),
                "traceback": case["traceback"][-MAX_TEXT:],
                "stderr": case["stderr"][-MAX_TEXT:],
                "wall": _digits([case["wall_seconds"]], 4)[0],
                "memory": int(case["peak_memory_bytes"]),
                "residual": _rounded_up(residual),
                "iterations": None if np.isnan(iterations) else int(iterations),
                "seconds": _digits(seconds.get(name, [np.nan] * len(accuracies)), 7),
                "excluded": [int(name in cases) for cases in excluded],
                "claimed": [int(name in cases) for cases in claimed],
            }
        )
    return {key: [row[key] for row in rows] for key in rows[0]}


def _points(frames: RunFrames) -> dict[str, list[Any]]:
    """Return the columns of all points, each with the number of its case."""
    points, numbers = frames.points, _case_numbers(frames)
    reasons = zip(points["reason"], points["notes"], strict=True)
    return {
        "case": [numbers[name] for name in zip(points["problem"], points["solver"], strict=True)],
        "tolerance": points["tolerance"].tolist(),
        "outcome": points["outcome"].tolist(),
        "reason": ["; ".join(filter(None, both)) for both in reasons],
        "excluded": points["is_excluded"].fillna(False).astype(int).tolist(),
        "iterations": [None if np.isnan(count) else int(count) for count in points["iterations"]],
        "residual": [_rounded_up(value) for value in points["residual"]],
        "model_residual": _digits(points["model_residual"], 3),
        "prepare": _digits(points["prepare_seconds"], 4),
        "seconds": _digits(points["total_seconds"], 7),
        "low": _digits(points["total_seconds_q1"], 4),
        "high": _digits(points["total_seconds_q3"], 4),
    }


def _curves(frames: RunFrames) -> dict[str, list[Any]]:
    """Return the columns of the convergence curves: the number of the case, its iterations and its residuals."""
    most, numbers = max(MIN_CURVE_POINTS, MAX_CURVE_POINTS // len(frames.cases)), _case_numbers(frames)
    curves = [(numbers[name], *_curve(curve, most)) for name, curve in frames.iterations.groupby(_IDENTITY, sort=False)]
    columns = zip(*curves, strict=True) if curves else ((), (), ())
    return {name: list(column) for name, column in zip(("case", "iteration", "residual"), columns, strict=True)}


def _case_numbers(frames: RunFrames) -> dict[Any, int]:
    names = zip(frames.cases["problem"], frames.cases["solver"], strict=True)
    return {name: number for number, name in enumerate(names)}


def _curve(curve: pd.DataFrame, most: int) -> list[list[Any]]:
    """Return the iterations and residuals of a curve, thinned to at most ``most`` points with the last one."""
    iterations, residuals = curve["iteration"].to_numpy(), curve["residual"].to_numpy()
    kept = np.flatnonzero((iterations > 0) & np.isfinite(residuals))
    if len(kept) > most:
        kept = kept[np.unique(np.linspace(0, len(kept) - 1, most).astype(int))]
    return [iterations[kept].tolist(), _digits(residuals[kept], 4)]


def _rounded_up(residual: float) -> float | None:
    """Return a residual rounded up to six digits from its shortest decimal form, so that 1e-10 stays 1e-10."""
    return float(_UP.create_decimal(repr(residual))) if math.isfinite(residual) else None


def _digits(values: Iterable[float], digits: int) -> list[float | None]:
    """Return numbers rounded to significant digits; None for those that are not finite."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in values]
