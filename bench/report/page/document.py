"""What a page knows of a run, as one JSON document: problems, solvers, cases, points and curves in columns of numbers.

Texts that occur often are stored once and referred to by number. Times have seven digits. Residuals have six and are
rounded up, so that they compare with every accuracy of at most six digits as the exact ones do.
"""

import math
from collections.abc import Iterable
from decimal import ROUND_CEILING, Context
from typing import Any

import numpy as np
import pandas as pd

from ....problems.contact.solver import Status
from ...store.condition import drift, run_state
from ...store.frames import JUDGED, RunFrames
from ...store.outcome import Outcome
from ...store.ratios import reaching
from ...store.records import Machine, RunRecord
from ...store.store import plain_name
from ..accuracy import SHIFT_SECONDS, counted_cases, summary_accuracies
from ..charts.palette import looks
from ..charts.profiles import SHARE
from ..charts.templates import ROWS, templates
from ..profiles import BUDGETS, RESIDUALS, profile_accuracies
from ..tables import case_notes, ending
from .commands import option, protocol_options, run_command

LONGEST_TEXT = 4000
"""Characters that a page has of what a failed case printed, from its end; the file of the case has all."""

MOST_CURVE_POINTS = 300_000
"""Points of convergence curves in a page, of all cases together."""

LEAST_CURVE_POINTS = 20
"""Points that a curve keeps however many cases there are."""

LAWS = {1: "no friction (1 row a contact)", 2: "planar friction (2 rows)", 3: "spatial friction (3 rows)"}
"""Laws of problems by their rows a contact."""

RECORDINGS = "recordings"
"""Folder of the recordings of a run."""

_UP = Context(prec=6, rounding=ROUND_CEILING)

_OF_ENDING = ("tolerance", "outcome", "status", "reason", "model_residual", "notes")
"""Columns of points that say how a case ended."""

_COUNTS, _CLAIMS, _EXCLUDED = 1, 2, 4
"""Marks of points: one that may reach an accuracy, one that says so itself, one whose time is excluded."""


def page_document(frames: RunFrames, baseline: str) -> dict[str, Any]:
    """Return everything that the page of a run shows.

    Args:
        frames: the run, over contact problems and with at least one case.
        baseline: the solver that speed-ups are against at first.
    """
    info, texts = frames.info, _Texts()
    problems = list(dict.fromkeys(frames.cases["problem"]))
    solvers = [name for name in info.plan.solvers if name in set(frames.cases["solver"])]
    named = looks(info.plan.solvers)
    accuracies = sorted({*info.plan.tolerances, *profile_accuracies(frames)}, reverse=True)
    return {
        "run": _about(frames),
        "machine": _machine(frames),
        "accuracies": accuracies,
        "profiles": list(profile_accuracies(frames)),
        "accuracy": summary_accuracies(frames)[-1],
        "residuals": list(RESIDUALS),
        "budgets": list(BUDGETS),
        "tolerances": list(info.plan.tolerances),
        "outcomes": [one.value for one in Outcome],
        "solvers": _solvers(frames, solvers),
        "baseline": solvers.index(baseline),
        "problems": _problems(frames),
        "cases": _cases(frames, problems, solvers, texts),
        "charts": templates({name: named[name] for name in solvers}, frames.residual),
        "rows": ROWS,
        "share": SHARE,
        "texts": texts.all,
    }


class _Texts:
    """Texts that are stored once, by number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {"": 0}

    def number(self, text: str) -> int:
        return self._numbers.setdefault(text, len(self._numbers))

    @property
    def all(self) -> list[str]:
        return list(self._numbers)


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
            **vars(named[name]),
        }
        for name in solvers
    ]


def _problems(frames: RunFrames) -> list[dict[str, Any]]:
    firsts = {case["problem"]: case for case in frames.cases.drop_duplicates("problem").to_dict("records")}
    folder = frames.folder / RECORDINGS
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


def _cases(frames: RunFrames, problems: list[str], solvers: list[str], texts: _Texts) -> dict[str, list[Any]]:
    """Return the columns of the cases; each has its points and its curve as columns of their own."""
    identity = ["problem", "solver"]
    measured = frames.points[frames.points["total_seconds"].notna()][[*identity, *_OF_ENDING]]
    attempts = dict(iter(measured.groupby(identity, sort=False)))
    columns_of_points, places = _points(frames, texts), frames.points.groupby(identity, sort=False).indices
    curves = dict(iter(frames.iterations.groupby(identity, sort=False)))
    counted = set(counted_cases(frames).index)
    most = max(LEAST_CURVE_POINTS, MOST_CURVE_POINTS // len(frames.cases))
    columns: dict[str, list[Any]] = {}
    for place, case in zip(frames.cases.index, frames.cases.to_dict("records"), strict=True):
        name = case["problem"], case["solver"]
        of_case = attempts.get(name, measured.iloc[:0])
        outcome, reason = ending(case, of_case)
        own = places.get(name, ())
        row = {
            "problem": problems.index(name[0]),
            "solver": solvers.index(name[1]),
            "supported": int(place in counted),
            "outcome": outcome,
            "reason": texts.number("; ".join(filter(None, (reason, case_notes(of_case))))),
            "traceback": texts.number(case["traceback"][-LONGEST_TEXT:]),
            "stderr": texts.number(case["stderr"][-LONGEST_TEXT:]),
            "wall": _digits([case["wall_seconds"]], 4)[0],
            "memory": int(case["peak_memory_bytes"]),
            "points": [[column[place] for place in own] for column in columns_of_points],
            "curve": _curve(curves[name], most) if name in curves else [[], []],
        }
        for key, value in row.items():
            columns.setdefault(key, []).append(value)
    return columns


def _points(frames: RunFrames, texts: _Texts) -> list[list[Any]]:
    """Return the columns of all points, in the order in which the script of the page reads them."""
    points, plan = frames.points, frames.info.plan
    counts = points.index.isin(reaching(points, np.inf, plan.limits.solve_seconds).index)
    marks = _COUNTS * counts + _CLAIMS * (points["status"] == Status.SOLVED).to_numpy(dtype=bool)
    marks += _EXCLUDED * points["is_excluded"].fillna(False).to_numpy(dtype=bool)
    distances = np.abs(np.subtract.outer(np.log(points["tolerance"].to_numpy()), np.log(plan.tolerances)))
    outcomes = {one.value: number for number, one in enumerate(Outcome)}
    return [
        distances.argmin(axis=1).tolist(),
        [outcomes[outcome] for outcome in points["outcome"]],
        [texts.number("; ".join(filter(None, both))) for both in zip(points["reason"], points["notes"], strict=True)],
        marks.astype(int).tolist(),
        [None if np.isnan(count) else int(count) for count in points["iterations"].tolist()],
        [_rounded_up(value) for value in points["residual"].tolist()],
        _digits(points["model_residual"], 3),
        _digits(points["prepare_seconds"], 4),
        _digits(points["total_seconds"], 7),
        _digits(points["total_seconds_q1"], 4),
        _digits(points["total_seconds_q3"], 4),
    ]


def _curve(curve: pd.DataFrame, most: int) -> list[list[Any]]:
    """Return iterations and residuals of a curve, at most so many, the last one among them."""
    iterations, residuals = curve["iteration"].to_numpy(), curve["residual"].to_numpy()
    kept = np.flatnonzero((iterations > 0) & np.isfinite(residuals))
    if len(kept) > most:
        kept = kept[np.unique(np.linspace(0, len(kept) - 1, most).astype(int))]
    return [iterations[kept].tolist(), _digits(residuals[kept], 4)]


def _rounded_up(residual: float) -> float | None:
    """Return a residual with six digits; that which a person reads counts, so that 1e-10 stays what it is."""
    return float(_UP.create_decimal(repr(residual))) if math.isfinite(residual) else None


def _digits(values: Iterable[float], digits: int) -> list[float | None]:
    """Return numbers with so many digits; None for those that are not finite."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in values]
