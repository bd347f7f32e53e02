"""Tables of a run: the time to each accuracy on each problem, and how often each solver got there over all."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.text import Text

from ...problems.arrays import FloatArray
from ...problems.spelling import for_command_line
from ...solvers.interface import Status
from ..errors import BenchError
from ..store.condition import run_state, steadiness, warnings
from ..store.frames import RunFrames
from ..store.outcome import FAULTS, Cell, Outcome, claim_reason
from .fitting import hanging, print_table
from .matrix import matrix_page
from .studies import headline, points_table, print_points
from .text import counted, inline, markdown_table

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
"""Judged residuals that tables give the time to, if the run has more tolerances than these."""

SUMMARY_ACCURACIES = (1e-4, 1e-6)
"""Those of them that the summary is about."""

SHIFT_SECONDS = 1e-3
"""Shift of the geometric mean, so that microseconds on tiny problems do not outweigh seconds on large ones."""


_CASE_COLUMNS = ("problem", "n_contacts", "solver", "model")

_TIME = "time_to_"
"""What the keys of the time columns begin with; an accuracy follows."""


def accuracies(frames: RunFrames) -> tuple[float, ...]:
    """Return the judged residuals that the tables of a run give the time to, from coarse to fine.

    They are the tolerances of the run where these are as few as ``ACCURACIES``, else those of ``ACCURACIES`` that its
    tolerances reach: finer ones would be counted as failures.
    """
    ladder = _ladder(frames)
    if len(ladder) <= len(ACCURACIES):
        return ladder
    return _within(ACCURACIES, ladder) or ladder[-1:]


def summary_accuracies(frames: RunFrames) -> tuple[float, ...]:
    """Return the judged residuals of the summary, at most two of ``accuracies``."""
    ladder = _ladder(frames)
    if len(ladder) <= len(ACCURACIES):
        return ladder[-2:]
    return _within(SUMMARY_ACCURACIES, ladder) or accuracies(frames)[-1:]


def _ladder(frames: RunFrames) -> tuple[float, ...]:
    return tuple(sorted(frames.info.plan.tolerances, reverse=True))


def _within(wanted: tuple[float, ...], ladder: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(accuracy for accuracy in wanted if accuracy >= ladder[-1] * (1.0 - 1e-9))


def _tag(accuracy: float) -> str:
    """Return how columns call an accuracy, with the digits that it has: ``"1e-04"``, ``"2.5e-04"``."""
    written = (f"{accuracy:.{digits}e}" for digits in range(16))
    return next((text for text in written if np.isclose(float(text), accuracy, rtol=1e-9, atol=0.0)), f"{accuracy:e}")


LATE = 1.1
"""Solves that took longer than this many times their limit reach nothing; the others may end an iteration."""


def time_to_accuracy(points: pd.DataFrame, accuracy: float, limit: float = np.inf) -> float:
    """Return the least median time [s] of the points whose judged residual is at most ``accuracy``; NaN if none.

    Points that claim what the judge refutes (WRONG), or to have solved after the limit of time, do not count, nor do
    those that took more than ``LATE`` times the limit whatever they claim.
    """
    is_late = (points["outcome"] == Outcome.TIME_LIMIT) & (points["status"] == Status.SOLVED)
    is_late |= points["solve_seconds"] > LATE * limit
    reached = points[(points["residual"] <= accuracy) & (points["outcome"] != Outcome.WRONG) & ~is_late]
    return float(reached["total_seconds"].min())


def mean_time(times: FloatArray, limit: float) -> float:
    """Return the shifted geometric mean of times [s], those that are missing (NaN) or longer at ``limit`` [s].

    NaN without any time.
    """
    if not len(times):
        return float("nan")
    filled = np.where(np.isnan(times), limit, np.minimum(times, limit))
    return float(np.exp(np.mean(np.log(filled + SHIFT_SECONDS))) - SHIFT_SECONDS)


def results_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row a case: time to each accuracy [s], the best judged residual, its iterations, how it ended and why.

    Columns: problem, n_contacts, solver, model, ``time_to_1e-02`` … (of ``accuracies``), residual, iterations,
    outcome, reason.
    """
    shown = {_TIME + _tag(accuracy): accuracy for accuracy in accuracies(frames)}
    limit, rows = frames.info.plan.limits.solve_seconds, []
    for case in frames.cases.to_dict("records"):
        measured = measured_points(frames, case)
        row = {key: case[key] for key in _CASE_COLUMNS}
        row |= {key: time_to_accuracy(measured, accuracy, limit) for key, accuracy in shown.items()}
        trusted = measured[measured["outcome"] != Outcome.WRONG]
        row["residual"], row["iterations"] = np.nan, np.nan
        if len(trusted):
            best = trusted.iloc[int(trusted["residual"].argmin())]
            row["residual"], row["iterations"] = float(best["residual"]), float(best["iterations"])
        row["outcome"], row["reason"] = ending(case, measured)
        rows.append(row)
    return pd.DataFrame(rows, columns=[*_CASE_COLUMNS, *shown, "residual", "iterations", "outcome", "reason"])


def measured_points(frames: RunFrames, case: dict[Any, Any]) -> pd.DataFrame:
    """Return the points of a case that were attempted."""
    points = frames.points
    is_own = (points["problem"] == case["problem"]) & (points["solver"] == case["solver"])
    chosen: pd.DataFrame = points[is_own & points["total_seconds"].notna()]
    return chosen


def attempts(frames: RunFrames, levels: Sequence[float]) -> pd.DataFrame:
    """Return one row a solver, problem that it supports, and accuracy of ``levels``, solvers in the order of the run.

    Columns: solver, model, problem, accuracy, seconds (the time to it, NaN if it is not reached), claimed (whether the
    solver says that it is), common (whether all solvers of the table support the problem).
    """
    cases = frames.cases[frames.cases["outcome"] != Outcome.UNSUPPORTED]
    counts = cases.groupby("problem")["solver"].nunique()
    common = counts.index[counts == cases["solver"].nunique()]
    rows = []
    for solver in frames.info.plan.solvers:
        for case in cases[cases["solver"] == solver].to_dict("records"):
            points, problem = measured_points(frames, case), case["problem"]
            for accuracy in levels:
                seconds = time_to_accuracy(points, accuracy, frames.info.plan.limits.solve_seconds)
                claimed = _claims(points, accuracy)
                rows.append((solver, case["model"], problem, accuracy, seconds, claimed, problem in common))
    return pd.DataFrame(rows, columns=["solver", "model", "problem", "accuracy", "seconds", "claimed", "common"])


def summary_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row a solver over all problems of the run.

    Columns: solver, model, problems (that it supports), common (those that all solvers of the table support), and for
    each of ``summary_accuracies`` the share of its problems that the solver says it solved (success), the share that
    the judge confirms (correct), and the shifted geometric mean of the time over the common problems [s], with failures
    at the time limit of a solve, NaN without a common problem; then the number of wrong claims.
    """
    shown = summary_accuracies(frames)
    tried = attempts(frames, shown)
    points, limit = frames.points, frames.info.plan.limits.solve_seconds
    rows = []
    for (solver, model), own in tried.groupby(["solver", "model"], sort=False):
        row: dict[str, Any] = {"solver": solver, "model": model, "problems": own["problem"].nunique()}
        row["common"] = own["problem"][own["common"]].nunique()
        for accuracy in shown:
            tag, reached = _tag(accuracy), own[own["accuracy"] == accuracy]
            row[f"success_{tag}"], row[f"correct_{tag}"] = reached["claimed"].mean(), reached["seconds"].notna().mean()
            row[f"mean_time_{tag}"] = mean_time(reached["seconds"][reached["common"]].to_numpy(), limit)
        row["wrong"] = int(((points["solver"] == solver) & (points["outcome"] == Outcome.WRONG)).sum())
        rows.append(row)
    of_accuracies = [f"{kind}_{_tag(accuracy)}" for accuracy in shown for kind in ("success", "correct", "mean_time")]
    return pd.DataFrame(rows, columns=["solver", "model", "problems", "common", *of_accuracies, "wrong"])


def write_tables(frames: RunFrames, folder: Path) -> list[Path]:
    """Write both tables as CSV, Parquet and Markdown, and the matrix of solvers and problems; return the files.

    A run over trajectories has a table of its points in place of summary and matrix.

    Raises:
        BenchError: if the folder cannot be written.
    """
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, frame, shown, note in _tables(frames):
            frame.to_csv(folder / f"{name}.csv", index=False)
            frame.to_parquet(folder / f"{name}.parquet", index=False)
            content = _markdown_head(frames) + _markdown(shown(frame)) + note
            (folder / f"{name}.md").write_text(content, encoding="utf-8")
            files += [folder / f"{name}.{kind}" for kind in ("csv", "parquet", "md")]
        if not frames.is_study:
            (folder / "matrix.md").write_text(matrix_of_run(frames), encoding="utf-8")
            files.append(folder / "matrix.md")
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; choose another folder.") from None
    return files


def _tables(frames: RunFrames) -> list[tuple[str, pd.DataFrame, Callable[[pd.DataFrame], pd.DataFrame], str]]:
    """Return the tables of a run: name, numbers, how they are shown, and a note below."""
    results = ("results", results_table(frames), partial(_shown_results, is_study=frames.is_study), "")
    if frames.is_study:
        return [results, ("points", points_table(frames), _shown_points, "")]
    summary = summary_table(frames)
    note = f"\n{_summary_legend(summary)}\n" if len(summary) else ""
    return [results, ("summary", summary, _shown_summary, note)]


def matrix_of_run(frames: RunFrames) -> str:
    """Return the matrix of solvers and problems of a run as a Markdown page, with the reason of every failure."""
    cells = [
        Cell(row["problem"], row["solver"], Outcome(row["outcome"]), row["residual"], reason=row["reason"])
        for row in results_table(frames).to_dict("records")
    ]
    finest = min(frames.info.plan.tolerances)
    return matrix_page(cells, finest, f"proxbench report {frames.info.run_id}", _markdown_head(frames))


def print_tables(frames: RunFrames, console: Console) -> None:
    """Print the state of the run, one table a problem, with every failure spelled out below it, and the summary."""
    for warning in warnings(frames):
        console.print(Text(for_command_line(warning), style="bold yellow"))
    console.print(Text(steadiness(frames.info), style="dim"))
    console.print()
    results = results_table(frames)
    if results.empty:
        console.print(Text("no case of this run is finished"))
        return
    noted = (
        (*FAULTS, Outcome.UNSUPPORTED) if frames.is_study else tuple(one for one in Outcome if one != Outcome.SOLVED)
    )
    for problem, rows in results.groupby("problem", sort=False):
        shown = _shown_results(rows, frames.is_study).drop(columns=["problem", "contacts", "why"], errors="ignore")
        best = {head: rows[key].idxmin() for head, key in _times(rows).items() if rows[key].notna().any()}
        console.print(Text(_headline(frames, str(problem), int(rows["n_contacts"].iloc[0])), style="bold"))
        optional = ("iter.", "solves", "residual", "error", "ended")
        print_table(console, shown, words=("model", "ended"), optional=optional, best=best)
        for row in rows.to_dict("records"):
            if row["outcome"] in noted:
                note = f"{row['solver']}: {row['outcome']}, {row['reason']}"
                console.print(Text(hanging(note, console.width), style="dim"))
        console.print()
        if frames.is_study:
            print_points(frames, frames.info.plan.trajectory(str(problem)), console)
            console.print()
    summary = pd.DataFrame() if frames.is_study else summary_table(frames)
    if len(summary):
        count = results["problem"].nunique()
        console.print(Text(f"all {count} problems" if count > 1 else "summary", style="bold"))
        print_table(console, _shown_summary(summary), words=("model",), optional=("wrong",))
    console.print(Text(_legend(list(_times(results)), summary, frames.is_study), style="dim"))


def _headline(frames: RunFrames, problem: str, contacts: int) -> str:
    if frames.is_study:
        return headline(frames.info.plan.trajectory(problem))
    return f"{problem} · {counted(contacts, 'contact')}"


def ending(case: dict[Any, Any], measured: pd.DataFrame) -> tuple[str, str]:
    """Return how a case ended: its fault, else the worst of what its ladder shows, with the reason in words."""
    if case["outcome"] != Outcome.MEASURED or measured.empty:
        return str(case["outcome"]), str(case["reason"])
    for outcome in (Outcome.WRONG, Outcome.RELAXED):
        if len(claims := measured[measured["outcome"] == outcome]):
            first = claims.iloc[0]
            if first["status"] == Status.INFEASIBLE:
                return outcome.value, str(first["reason"])
            return outcome.value, claim_reason(outcome, first["tolerance"], case["model"], first["model_residual"])
    last = measured.iloc[-1]
    if last["outcome"] == Outcome.SOLVED:
        return Outcome.SOLVED.value, f"to {last['tolerance']:.0e}"
    return str(last["outcome"]), f"at {last['tolerance']:.0e}: {last['reason']}"


def _claims(points: pd.DataFrame, accuracy: float) -> bool:
    """Whether the solver says that it solved to ``accuracy``."""
    finer = points[points["tolerance"] <= accuracy * (1.0 + 1e-9)]
    return bool((finer["status"] == Outcome.SOLVED).any())


def _times(results: pd.DataFrame) -> dict[str, str]:
    """Return the heads of the time columns, and their keys."""
    return {key.removeprefix(_TIME): key for key in results.columns if key.startswith(_TIME)}


def _legend(heads: list[str], summary: pd.DataFrame, is_study: bool) -> str:
    columns = f"Columns {heads[0]} to {heads[-1]} give" if len(heads) > 1 else f"Column {heads[0]} gives"
    least = " of a simulation, to that error" if is_study else ", preparing included, to that judged residual"
    times = f"{columns} the least median time{least}; – means never reached."
    return times if summary.empty else f"{times}\n{_summary_legend(summary)}"


def _summary_legend(summary: pd.DataFrame) -> str:
    common = int(summary["common"].iloc[0])
    compared = "the problem" if common == 1 else f"the {common} problems"
    means = f"mean: shifted geometric mean time over {compared} that all these solvers support."
    if not common:
        means = "no mean is given, as no problem is supported by all these solvers."
    return (
        "says: how many of the problems that the solver supports it claims to solve; true: how many the judge "
        f"confirms; {means}"
    )


def duration(seconds: float) -> str:
    """Return a time in engineering units, or a dash for NaN: ``"3.1 ms"``."""
    if not np.isfinite(seconds):
        return "–"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.2g} µs"


def _shown_results(results: pd.DataFrame, is_study: bool = False) -> pd.DataFrame:
    times = _times(results)
    heads = {"n_contacts": "contacts", "iterations": "iter.", "outcome": "ended", "reason": "why"}
    shown = results.rename(columns=heads | {key: head for head, key in times.items()})
    for head in times:
        shown[head] = shown[head].map(duration)
    for head, form in (("residual", ".0e"), ("iter.", ".0f")):
        shown[head] = [f"{value:{form}}" if np.isfinite(value) else "–" for value in shown[head]]
    if is_study:
        return shown.drop(columns="contacts").rename(columns={"residual": "error", "iter.": "solves"})
    return shown


def _shown_points(points: pd.DataFrame) -> pd.DataFrame:
    shown = pd.DataFrame({"problem": points["problem"], "solver": points["solver"]})
    for head, key in (("at", "tolerance"), ("error", "error"), ("from", "low"), ("to", "high")):
        shown[head] = [f"{value:.2g}" if np.isfinite(value) else "–" for value in points[key]]
    shown.insert(3, "quantity", points["quantity"].fillna("–"))
    shown["wall"] = points["total_seconds"].map(duration)
    counts = {"solves": "iterations", "members": "repeats", "failed": "failed_members", "missed": "unsolved_steps"}
    for head, key in counts.items():
        shown[head] = [f"{value:.0f}" if np.isfinite(value) else "–" for value in points[key]]
    return shown.assign(why=points["reason"])


def _shown_summary(summary: pd.DataFrame) -> pd.DataFrame:
    shown = summary[["solver", "model"]].copy()
    for tag in (key.removeprefix("success_") for key in summary.columns if key.startswith("success_")):
        for head, share in (("says", f"success_{tag}"), ("true", f"correct_{tag}")):
            pairs = zip(summary[share], summary["problems"], strict=True)
            shown[f"{head}\n{tag}"] = [f"{round(value * number)}/{number}" for value, number in pairs]
        shown[f"mean\n{tag}"] = summary[f"mean_time_{tag}"].map(duration)
    return shown.assign(wrong=summary["wrong"])


def _markdown_head(frames: RunFrames) -> str:
    """Return the state of a run as paragraphs above a table."""
    return "".join(f"{inline(for_command_line(sentence))}\n\n" for sentence in run_state(frames))


def _markdown(shown: pd.DataFrame) -> str:
    heads = [str(column).replace("\n", " ") for column in shown.columns]
    return markdown_table(heads, shown.map(inline).itertuples(index=False))
