"""Tables of a run: the time to each accuracy on each problem, and how often each solver got there over all."""

import io
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.text import Text

from ...problems.spelling import for_command_line
from ...solvers.interface import Status
from ..store.condition import basis, run_state, steadiness, warnings
from ..store.frames import JUDGED, RunFrames
from ..store.outcome import FAULTS, Cell, Outcome, claim_reason
from .accuracy import (
    accuracies,
    accuracy_tag,
    compares_all,
    measured_points,
    ratios_table,
    shown_means,
    summary_table,
    time_to_accuracy,
)
from .fitting import hanging, print_table
from .matrix import matrix_page
from .output_file import write_file
from .studies import headline, points_table, print_points
from .text import counted, inline, markdown_table

_CASE_COLUMNS = ("problem", "n_contacts", "solver", "model")

_MARKS = (
    "Bold: the fastest, where the 95 % intervals of all ratios to it exclude 1; ≈: as fast, as far as the rounds show; "
    "tables/ratios has the intervals."
)
"""What marks of times mean."""

_TIME = "time_to_"
"""What the keys of the time columns begin with; an accuracy follows."""


def results_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row a case: time to each accuracy [s], the best judged residual, its iterations, how it ended and why.

    Columns: problem, n_contacts, solver, model, ``time_to_1e-02`` … (of ``accuracies``), residual, iterations,
    outcome, reason.
    """
    shown = {_TIME + accuracy_tag(accuracy): accuracy for accuracy in accuracies(frames)}
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


def write_tables(frames: RunFrames, folder: Path) -> list[Path]:
    """Write both tables as CSV, Parquet and Markdown, and the matrix of solvers and problems; return the files.

    A run over trajectories has a table of its points in place of summary and matrix. The matrix is of claims, which are
    of judged residuals, and written with those alone.

    Raises:
        UnwritableError: if they cannot be written.
        BenchError: if a link in the folder leads out of it.
    """
    files = []
    for name, frame, shown, note in _tables(frames):
        parquet = io.BytesIO()
        frame.to_parquet(parquet, index=False)
        page = _markdown_head(frames) + _markdown(shown(frame)) + note
        contents = {"csv": frame.to_csv(index=False).encode(), "parquet": parquet.getvalue(), "md": page.encode()}
        files += [write_file(folder / f"{name}.{kind}", content) for kind, content in contents.items()]
    if not frames.is_study and frames.residual == JUDGED:
        files.append(write_file(folder / "matrix.md", matrix_of_run(frames).encode()))
    return files


def _tables(frames: RunFrames) -> list[tuple[str, pd.DataFrame, Callable[[pd.DataFrame], pd.DataFrame], str]]:
    """Return the tables of a run: name, numbers, how they are shown, and a note below."""
    ratios = ratios_table(frames)
    shown = partial(_shown_results, is_study=frames.is_study, ratios=ratios, bold="**{}**")
    results = ("results", results_table(frames), shown, "" if ratios.empty else f"\n{_MARKS}\n")
    if frames.is_study:
        return [results, ("points", points_table(frames), _shown_points, "")]
    summary = summary_table(frames)
    note = f"\n{_summary_legend(summary)}\n" if len(summary) else ""
    return [results, ("ratios", ratios, _shown_ratios, ""), ("summary", summary, _shown_summary, note)]


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
    for sentence in (*basis(frames), steadiness(frames.info)):
        console.print(Text(sentence, style="dim"))
    console.print()
    results = results_table(frames)
    if results.empty:
        console.print(Text("no case of this run is finished"))
        return
    noted = (
        (*FAULTS, Outcome.UNSUPPORTED) if frames.is_study else tuple(one for one in Outcome if one != Outcome.SOLVED)
    )
    ratios = ratios_table(frames)
    for problem, rows in results.groupby("problem", sort=False):
        shown = _shown_results(rows, frames.is_study, ratios)
        shown = shown.drop(columns=["problem", "contacts", "why"], errors="ignore")
        console.print(Text(_headline(frames, str(problem), int(rows["n_contacts"].iloc[0])), style="bold"))
        optional = ("iter.", "solves", "residual", "error", "ended")
        print_table(console, shown, words=("model", "ended"), optional=optional, bold=_fastest(rows, ratios))
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
        _print_summary(summary, results["problem"].nunique(), console)
    console.print(Text(_legend(frames, list(_times(results)), summary), style="dim"))


def _print_summary(summary: pd.DataFrame, count: int, console: Console) -> None:
    """Print the summary over so many problems: one table, or one an accuracy where each solver has two means."""
    title, tags = f"all {count} problems" if count > 1 else "summary", _tags(summary)
    for shown in [tags] if compares_all(summary) else [[tag] for tag in tags]:
        to = "" if shown == tags else f", to {shown[0]}"
        console.print(Text(title + to, style="bold"))
        print_table(console, _shown_summary(summary, shown), words=("model",), optional=("wrong",))
        console.print()


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


def _times(results: pd.DataFrame) -> dict[str, str]:
    """Return the heads of the time columns, and their keys."""
    return {key.removeprefix(_TIME): key for key in results.columns if key.startswith(_TIME)}


def _legend(frames: RunFrames, heads: list[str], summary: pd.DataFrame) -> str:
    columns = f"Columns {heads[0]} to {heads[-1]} give" if len(heads) > 1 else f"Column {heads[0]} gives"
    least = f", preparing included, to that {frames.residual} residual"
    least = " of a simulation, to that error" if frames.is_study else least
    times = f"{columns} the least median time{least}; – means never reached."
    times += "" if frames.is_study else f" {_MARKS}"
    return times if summary.empty else f"{times}\n{_summary_legend(summary)}"


def _summary_legend(summary: pd.DataFrame) -> str:
    common = int(summary["common"].iloc[0])
    own = "mean of own: over all that the solver supports, whose number stands behind the slash."
    if compares_all(summary):
        means = f"mean: shifted geometric mean time over {counted(common, 'problem')}, failures at the time limit."
    elif common:
        which = f"the {counted(common, 'problem')} that all these solvers support, failures at the time limit"
        means = f"mean of {common}: shifted geometric mean time over {which}; {own}"
    else:
        means = f"no problem is supported by all these solvers, so no means compare; {own}"
    return (
        "says: how many of the problems that the solver supports it claims to solve; true: how many the judge "
        f"confirms; {means}"
    )


def _tags(summary: pd.DataFrame) -> list[str]:
    return [key.removeprefix("success_") for key in summary.columns if key.startswith("success_")]


def duration(seconds: float) -> str:
    """Return a time in engineering units, or a dash for NaN: ``"3.1 ms"``."""
    if not np.isfinite(seconds):
        return "–"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.2g} µs"


def _standings(results: pd.DataFrame, ratios: pd.DataFrame) -> dict[tuple[Any, str], str]:
    """Return how the cells of a table of results stand, by index and head."""
    columns = zip(ratios["problem"], ratios["solver"], ratios["accuracy"], ratios["standing"], strict=True)
    known = {(problem, solver, accuracy_tag(accuracy)): standing for problem, solver, accuracy, standing in columns}
    return {
        (row.Index, head): known.get((row.problem, row.solver, head), "")
        for row in results.itertuples()
        for head in _times(results)
    }


def _fastest(results: pd.DataFrame, ratios: pd.DataFrame) -> set[tuple[Any, str]]:
    return {cell for cell, standing in _standings(results, ratios).items() if standing == "fastest"}


def _shown_ratios(ratios: pd.DataFrame) -> pd.DataFrame:
    shown = ratios[["problem", "solver", "standing"]].copy()
    shown.insert(1, "to", ratios["accuracy"].map(accuracy_tag))
    shown.insert(3, "time", ratios["seconds"].map(duration))
    for place, head in enumerate(("ratio", "low", "high"), 4):
        shown.insert(place, head, [f"{value:.3g}" if np.isfinite(value) else "–" for value in ratios[head]])
    return shown


def _shown_results(
    results: pd.DataFrame, is_study: bool = False, ratios: pd.DataFrame | None = None, bold: str = "{}"
) -> pd.DataFrame:
    """Return results in texts, times that tie with the least marked, and those of winners as ``bold`` has them."""
    times = _times(results)
    standing = {} if ratios is None else _standings(results, ratios)
    heads = {"n_contacts": "contacts", "iterations": "iter.", "outcome": "ended", "reason": "why"}
    shown = results.rename(columns=heads | {key: head for head, key in times.items()})
    for head in times:
        forms = {"tie": "≈ {}", "fastest": bold}
        cells = zip(shown.index, shown[head].map(duration), strict=True)
        shown[head] = [forms.get(standing.get((index, head), ""), "{}").format(text) for index, text in cells]
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


def _shown_summary(summary: pd.DataFrame, tags: Sequence[str] = ()) -> pd.DataFrame:
    """Return the summary in texts, of the accuracies with these tags, else of all."""
    shown = summary[["solver", "model"]].copy()
    means = shown_means(summary)
    for tag in tags or _tags(summary):
        for head, share in (("says", f"success_{tag}"), ("true", f"correct_{tag}")):
            pairs = zip(summary[share], summary["problems"], strict=True)
            shown[f"{head}\n{tag}"] = [f"{round(value * number)}/{number}" for value, number in pairs]
        for head, key in means.items():
            lines = [*head.split(" ", 1), tag]
            shown["\n".join(lines)] = summary[f"{key}_{tag}"].map(duration)
    return shown.assign(wrong=summary["wrong"])


def _markdown_head(frames: RunFrames) -> str:
    """Return the state of a run as paragraphs above a table."""
    return "".join(f"{inline(for_command_line(sentence))}\n\n" for sentence in run_state(frames))


def _markdown(shown: pd.DataFrame) -> str:
    heads = [str(column).replace("\n", " ") for column in shown.columns]
    return markdown_table(heads, shown.map(inline).itertuples(index=False))
