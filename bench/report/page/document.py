"""Data of a page as one JSON document: tables of problems, solvers, cases, points and curves, in named columns.

Python computes the values that do not depend on filters: the time to each accuracy and the best point of every case.
Numbers are rounded to the digits that the page shows; residuals that it compares with accuracies are not rounded.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...store.condition import drift, run_state
from ...store.frames import CASE, JUDGED, RunFrames
from ...store.ratios import reaching
from ...store.records import Machine
from ...store.store import plain_name
from ..accuracy import (
    SHIFT_SECONDS,
    claimed_cases,
    counted_cases,
    excluded_cases,
    starts_table,
    summary_accuracies,
    threads_by_solver,
    times_to_accuracies,
)
from ..charts.palette import on_dark, solver_styles
from ..charts.problems import MAX_RESIDUAL, MIN_RESIDUAL
from ..charts.profiles import SHARE
from ..charts.templates import ROWS, templates
from ..endings import attempted_points, case_endings, join_texts
from ..profiles import BUDGETS, PADDING, RESIDUALS, profile_accuracies
from .commands import option, protocol_options, repeat_command

MAX_TEXT = 4000
"""Number of characters at the end of the output of a failed case that a page shows; the case file contains all."""

MAX_CURVE_POINTS = 300_000
"""Largest number of points of all convergence curves of a page."""

MIN_CURVE_POINTS = 20
"""Smallest number of points to which a curve is thinned."""

LAWS = {1: "no friction (1 row per contact)", 2: "planar friction (2 rows)", 3: "spatial friction (3 rows)"}
"""Laws of problems by their rows per contact."""

RECORDINGS = "recordings"
"""Folder of the recordings of a run."""


def page_document(frames: RunFrames, baseline: str) -> dict[str, Any]:
    """Return everything that the page of a run shows.

    Args:
        frames: the run, over contact problems and with at least one case.
        baseline: initial reference solver of speed-ups.
    """
    info = frames.info
    solvers = [name for name in info.plan.solvers if name in set(frames.cases["solver"])]
    styles = solver_styles(info.plan.solvers)
    accuracies = sorted({*info.plan.tolerances, *profile_accuracies(frames)}, reverse=True)
    return {
        "run": _about(frames),
        "machine": _machine(frames),
        "accuracies": accuracies,
        "accuracy": summary_accuracies(frames)[-1],
        "residuals": list(RESIDUALS),
        "budgets": list(BUDGETS),
        "padding": PADDING,
        "min_residual": MIN_RESIDUAL,
        "max_residual": MAX_RESIDUAL,
        "solvers": _solvers(frames, solvers),
        "baseline": baseline,
        "problems": _problems(frames),
        "open": _first_drawable(frames),
        "cases": _cases(frames, accuracies),
        "points": _points(frames),
        "starts": _starts(frames),
        "curves": _curves(frames),
        "charts": templates({name: styles[name] for name in solvers}, frames.residual),
        "rows": ROWS,
        "share": SHARE,
    }


def _first_drawable(frames: RunFrames) -> str:
    """Return the first problem for which both charts of a page can be drawn, else the first one with points.

    An axis needs two different values.
    """
    points = frames.points[np.isfinite(frames.points["residual"]) & frames.points["total_seconds"].notna()]
    residuals = points.groupby("problem")["residual"].nunique()
    iterations = frames.iterations.groupby("problem")["iteration"].nunique()
    drawable = set(residuals.index[residuals > 1]) & set(iterations.index[iterations > 2])
    problems = list(dict.fromkeys(frames.cases["problem"]))
    candidates = (name for group in (drawable, set(points["problem"])) for name in problems if name in group)
    return str(next(candidates, problems[0]))


def _about(frames: RunFrames) -> dict[str, Any]:
    """Return the facts about the whole run."""
    info = frames.info
    sentences = [*run_state(frames), *info.plan.left_out, *frames.damaged]
    return {
        "id": info.run_id,
        "title": f"{info.run_id}, {info.plan.problems_in_words(frames.cases['problem'].nunique())}"
        if info.plan.suite
        else info.run_id,
        "folder": str(frames.folder),
        "residual": frames.residual,
        "root": "" if frames.residual == JUDGED else "../",
        "limit": info.plan.limits.solve_seconds,
        "shift": SHIFT_SECONDS,
        "command": repeat_command(info),
        "protocol": protocol_options(info),
        "sentences": sentences,
        "finished": frames.n_finished,
        "planned": frames.n_planned,
    }


def _machine(frames: RunFrames) -> dict[str, list[tuple[str, str]]]:
    """Return tables of names and values: machines, versions, environment, protocol, sessions and plugins."""
    info, factor = frames.info, drift(frames)
    plan, limits = info.plan, info.plan.limits
    machines = {session.machine.host: session.machine for session in info.sessions} or {"": info.machine}
    has_single_machine = len(machines) == 1
    tables: dict[str, dict[str, Any]] = {
        "Machine" if has_single_machine else f"Machine {host}": _hardware(machine) for host, machine in machines.items()
    }
    tables["Versions"], tables["Environment"] = info.machine.versions, info.machine.settings
    tables["Protocol"] = {
        "passes": plan.passes,
        "seed": plan.seed,
        "judge": f"version {info.judge}",
        "time limit of a solve": f"{limits.solve_seconds:g} s",
        "time limit of a case": f"{limits.case_seconds:g} s",
        "memory limit of a case": f"{limits.memory_bytes / 2**20:.0f} MiB",
        "threads of a library": 1,
        "probes": "unknown" if np.isnan(factor) else f"ratio of 90 % to 10 % quantile {factor:.2f}",
    }
    tables["Sessions"] = {
        session.started + ("" if has_single_machine else f" on {session.machine.host}"): f"to {session.finished}"
        if session.finished
        else "interrupted"
        for session in info.sessions
    }
    tables["Plugins"] = {f"{use.kind} {use.name}": f"{use.source} {use.sha256[:16]}".strip() for use in info.plugins}
    return {name: [(key, str(value)) for key, value in table.items()] for name, table in tables.items() if table}


def _hardware(machine: Machine) -> dict[str, Any]:
    """Return the facts about a machine and its software by name."""
    pools = dict.fromkeys(f"{pool.internal_api or pool.user_api} {pool.version}" for pool in machine.thread_pools)
    commit = machine.commit or "unknown"
    return {
        "processor": machine.processor,
        "cores": f"{machine.cores}, {machine.logical_cores} logical",
        "memory": f"{machine.memory_bytes / 2**30:.1f} GiB",
        "system": machine.system,
        "Python": machine.python,
        "libraries": ", ".join(pools),
        "commit": f"{commit}, with changes that are not committed" if machine.dirty else commit,
        "source": machine.source or "unknown",
    }


def _solvers(frames: RunFrames, solvers: list[str]) -> list[dict[str, Any]]:
    """Return one row per solver: model, threads, file name, command-line option, and style."""
    styles = solver_styles(frames.info.plan.solvers)
    threads = threads_by_solver(frames)
    first_cases = frames.cases.drop_duplicates("solver").set_index("solver")
    return [
        {
            "name": name,
            "model": first_cases["model"][name],
            "threads": int(threads[name]),
            "file": plain_name(name),
            "option": option("solver", name),
            "on_dark": "#{:02x}{:02x}{:02x}".format(*on_dark(styles[name].colour)),
            **vars(styles[name]),
        }
        for name in solvers
    ]


def _problems(frames: RunFrames) -> list[dict[str, Any]]:
    """Return one row per problem: sizes, digest, file name, command-line option, and whether it has a recording."""
    first_cases = {case["problem"]: case for case in frames.cases.drop_duplicates("problem").to_dict("records")}
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
        for name, case in first_cases.items()
    ]


def _law(rows: int, contacts: int) -> str:
    """Return the kind of laws that follows from the number of rows per contact."""
    if not contacts:
        return "no contact"
    return LAWS.get(rows // contacts, "more rows per contact") if rows % contacts == 0 else "mixed"


def _cases(frames: RunFrames, accuracies: list[float]) -> dict[str, list[Any]]:
    """Return the columns of the cases.

    ``seconds``, ``excluded`` and ``claimed`` have a value for each accuracy: the time to it (null if it is not
    reached), whether all rounds of this time are excluded, and whether the solver claims the accuracy.
    """
    attempted, limit = attempted_points(frames), frames.info.plan.limits.solve_seconds
    best = reaching(attempted, np.inf, limit).sort_values("residual", kind="stable").drop_duplicates(CASE)
    times = times_to_accuracies(frames.points, accuracies, limit)
    excluded = [excluded_cases(frames.points, accuracy, limit) for accuracy in accuracies]
    claimed = [claimed_cases(attempted, accuracy) for accuracy in accuracies]
    table = frames.cases[[*CASE, "traceback", "stderr"]].merge(best[[*CASE, "residual", "iterations"]], "left", CASE)
    endings, names = case_endings(frames), list(zip(table["problem"], table["solver"], strict=True))
    seconds = dict(zip(times.index, times.to_numpy(), strict=True))
    return {
        **{name: table[name].tolist() for name in CASE},
        "supported": frames.cases.index.isin(counted_cases(frames).index).astype(int).tolist(),
        "outcome": endings["outcome"].tolist(),
        "reason": list(map(join_texts, endings["reason"], endings["notes"])),
        "traceback": table["traceback"].str[-MAX_TEXT:].tolist(),
        "stderr": table["stderr"].str[-MAX_TEXT:].tolist(),
        "wall": _rounded(frames.cases["wall_seconds"], 4),
        "memory": frames.cases["peak_memory_bytes"].astype(int).tolist(),
        "residual": _rounded(table["residual"]),
        "iterations": _rounded(table["iterations"]),
        "seconds": [_rounded(seconds.get(name, [np.nan] * len(accuracies)), 7) for name in names],
        "excluded": [[int(name in cases) for cases in excluded] for name in names],
        "claimed": [[int(name in cases) for cases in claimed] for name in names],
    }


def _points(frames: RunFrames) -> dict[str, list[Any]]:
    """Return the columns of all points, each with the number of its case."""
    points, case_numbers = frames.points, _case_numbers(frames)
    digits = {
        "residual": ("residual", 4),
        "model_residual": ("model_residual", 3),
        "prepare": ("prepare_seconds", 4),
        "seconds": ("total_seconds", 7),
        "low": ("total_seconds_q1", 4),
        "high": ("total_seconds_q3", 4),
    }
    return {
        "case": [case_numbers[name] for name in zip(points["problem"], points["solver"], strict=True)],
        "tolerance": points["tolerance"].tolist(),
        "outcome": points["outcome"].tolist(),
        "reason": list(map(join_texts, points["reason"], points["notes"])),
        "excluded": points["is_excluded"].fillna(False).astype(int).tolist(),
        "iterations": _rounded(points["iterations"]),
        **{name: _rounded(points[column], number) for name, (column, number) in digits.items()},
    }


def _starts(frames: RunFrames) -> list[dict[str, Any]]:
    """Return the rows of ``starts_table``, with four digits."""
    return [
        {str(name): value if isinstance(value, str) else _rounded([value], 4)[0] for name, value in row.items()}
        for row in starts_table(frames).to_dict("records")
    ]


def _curves(frames: RunFrames) -> dict[str, list[Any]]:
    """Return the columns of the convergence curves: the number of the case, its iterations and its residuals.

    Curves are thinned to the limits of the page, and keep their last point.
    """
    max_points, case_numbers = max(MIN_CURVE_POINTS, MAX_CURVE_POINTS // len(frames.cases)), _case_numbers(frames)
    curves: dict[str, list[Any]] = {"case": [], "iteration": [], "residual": []}
    drawable = frames.iterations[(frames.iterations["iteration"] > 0) & np.isfinite(frames.iterations["residual"])]
    for name, curve in drawable.groupby(CASE, sort=False):
        thinned = curve.iloc[np.unique(np.linspace(0, len(curve) - 1, min(max_points, len(curve))).astype(int))]
        curves["case"].append(case_numbers[name])
        curves["iteration"].append(thinned["iteration"].tolist())
        curves["residual"].append(_rounded(thinned["residual"], 4))
    return curves


def _case_numbers(frames: RunFrames) -> dict[Any, int]:
    names = zip(frames.cases["problem"], frames.cases["solver"], strict=True)
    return {name: number for number, name in enumerate(names)}


def _rounded(values: Iterable[float], digits: int = 17) -> list[float | None]:
    """Return numbers rounded to significant digits; None for those that are not finite."""
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in values]
