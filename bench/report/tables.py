"""Tables of a run: the time to each accuracy on each problem, and how often each solver got there over all."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...problems.arrays import FloatArray
from ..errors import BenchError
from ..measure.matrix import Cell
from ..store.frames import RunFrames
from ..store.outcome import Outcome
from .matrix import matrix_page
from .text import inline

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
"""Judged residuals that tables give the time to, if more tolerances than these were asked for."""

SUMMARY_ACCURACIES = (1e-4, 1e-6)
"""Those of them that the summary is about."""

SHIFT_SECONDS = 1e-3
"""Shift of the geometric mean, so that microseconds on tiny problems do not outweigh seconds on large ones."""


_CASE_COLUMNS = ("problem", "n_contacts", "solver", "model")

_TIME = "time_to_"
"""What the keys of the time columns begin with; an accuracy follows."""


def accuracies(frames: RunFrames) -> tuple[float, ...]:
    """Return the judged residuals that the tables of a run give the time to, from coarse to fine.

    They are the tolerances of the run where these are as few as ``ACCURACIES``, else those of ``ACCURACIES`` that were
    asked for: what nobody asked for would be counted as a failure.
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
    return tuple(sorted(map(float, frames.info["plan"]["tolerances"]), reverse=True))


def _within(wanted: tuple[float, ...], ladder: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(accuracy for accuracy in wanted if accuracy >= ladder[-1] * (1.0 - 1e-9))


def _tag(accuracy: float) -> str:
    """Return how columns call an accuracy, with the digits that it has: ``"1e-04"``, ``"2.5e-04"``."""
    written = (f"{accuracy:.{digits}e}" for digits in range(16))
    return next((text for text in written if np.isclose(float(text), accuracy, rtol=1e-9, atol=0.0)), f"{accuracy:e}")


def time_to_accuracy(points: pd.DataFrame, accuracy: float) -> float:
    """Return the least median time [s] of the points whose judged residual is at most ``accuracy``; NaN if none.

    Points that claim what the judge refutes (WRONG) do not count.
    """
    if points.empty:
        return float("nan")
    reached = points[(points["residual"] <= accuracy) & (points["outcome"] != Outcome.WRONG)]
    return float(reached["total_seconds"].min()) if len(reached) else float("nan")


def mean_time(times: FloatArray, limit: float) -> float:
    """Return the shifted geometric mean of times [s], those that are missing (NaN) or longer at ``limit`` [s]."""
    filled = np.where(np.isnan(times), limit, np.minimum(times, limit))
    return float(np.exp(np.mean(np.log(filled + SHIFT_SECONDS))) - SHIFT_SECONDS)


def results_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row a case: time to each accuracy [s], the best judged residual, its iterations, how it ended and why.

    Columns: problem, n_contacts, solver, model, ``time_to_1e-02`` … (of ``accuracies``), residual, iterations,
    outcome, reason.
    """
    shown = accuracies(frames)
    keys = [_TIME + _tag(accuracy) for accuracy in shown]
    rows = []
    for case in frames.cases.to_dict("records"):
        points = _points_of(frames, case)
        measured = points[points["total_seconds"].notna()] if len(points) else points
        row = {key: case[key] for key in _CASE_COLUMNS}
        row |= {key: time_to_accuracy(measured, accuracy) for key, accuracy in zip(keys, shown, strict=True)}
        row |= _best(measured)
        row["outcome"], row["reason"] = ending(case, measured)
        rows.append(row)
    return pd.DataFrame(rows, columns=[*_CASE_COLUMNS, *keys, "residual", "iterations", "outcome", "reason"])


def summary_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row a solver over all problems of the run.

    Columns: solver, model, problems (that it supports), and for each of ``summary_accuracies`` the share that the
    solver says it solved (success), the share that the judge confirms (correct), and the shifted geometric mean of the
    time [s] with failures at the time limit of a solve; then the number of wrong claims.
    """
    shown = summary_accuracies(frames)
    limit = float(frames.info["plan"]["limits"]["solve_seconds"])
    rows = []
    for solver in frames.info["plan"]["solvers"]:
        cases = frames.cases[(frames.cases["solver"] == solver) & (frames.cases["outcome"] != Outcome.UNSUPPORTED)]
        if cases.empty:
            continue
        row: dict[str, Any] = {"solver": solver, "model": cases["model"].iloc[0], "problems": len(cases)}
        of_cases = [_points_of(frames, case) for case in cases.to_dict("records")]
        for accuracy in shown:
            claimed = [claims(points, accuracy) for points in of_cases]
            times = np.array([time_to_accuracy(points, accuracy) for points in of_cases])
            row[f"success_{_tag(accuracy)}"] = float(np.mean(claimed))
            row[f"correct_{_tag(accuracy)}"] = float(np.mean(~np.isnan(times)))
            row[f"mean_time_{_tag(accuracy)}"] = mean_time(times, limit)
        row["wrong"] = int(sum((points["outcome"] == Outcome.WRONG).sum() for points in of_cases if len(points)))
        rows.append(row)
    of_accuracies = [f"{kind}_{_tag(accuracy)}" for accuracy in shown for kind in ("success", "correct", "mean_time")]
    return pd.DataFrame(rows, columns=["solver", "model", "problems", *of_accuracies, "wrong"])


def write_tables(frames: RunFrames, folder: Path) -> list[Path]:
    """Write both tables as CSV, Parquet and Markdown, and the matrix of solvers and problems; return the files.

    Raises:
        BenchError: if the folder cannot be written.
    """
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, frame, shown in (
            ("results", results_table(frames), _shown_results),
            ("summary", summary_table(frames), _shown_summary),
        ):
            frame.to_csv(folder / f"{name}.csv", index=False)
            frame.to_parquet(folder / f"{name}.parquet", index=False)
            (folder / f"{name}.md").write_text(_markdown(shown(frame)), encoding="utf-8")
            files += [folder / f"{name}.{kind}" for kind in ("csv", "parquet", "md")]
        (folder / "matrix.md").write_text(matrix_of_run(frames), encoding="utf-8")
        files.append(folder / "matrix.md")
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; choose another folder.") from None
    return files


def matrix_of_run(frames: RunFrames) -> str:
    """Return the matrix of solvers and problems of a run as a Markdown page, with the reason of every failure."""
    cells = [
        Cell(
            row["problem"],
            row["solver"],
            Outcome(row["outcome"]),
            row["residual"],
            reason="" if row["outcome"] == Outcome.SOLVED else row["reason"],
        )
        for row in results_table(frames).to_dict("records")
    ]
    finest = min(frames.info["plan"]["tolerances"])
    return matrix_page(cells, finest, f"proxbench report {frames.info['run_id']}")


def print_tables(frames: RunFrames, console: Console) -> None:
    """Print one table a problem, with every failure spelled out below it, and the summary."""
    results = results_table(frames)
    if results.empty:
        console.print(Text("no case of this run is finished"))
        return
    for problem, rows in results.groupby("problem", sort=False):
        contacts = int(rows["n_contacts"].iloc[0])
        shown = _shown_results(rows).drop(columns=["problem", "contacts", "why"])
        best = {head: rows[key].idxmin() for head, key in _times(rows).items() if rows[key].notna().any()}
        _print(console, f"{problem} · {contacts} contact{'s' if contacts != 1 else ''}", shown, best)
        for row in rows.to_dict("records"):
            if row["outcome"] != Outcome.SOLVED:
                console.print(Text(f"  {row['solver']}: {row['outcome']}, {row['reason']}", style="dim"))
        console.print()
    summary = summary_table(frames)
    if len(summary):
        count = results["problem"].nunique()
        _print(console, f"all {count} problems" if count > 1 else "summary", _shown_summary(summary), {})
    console.print(Text(_legend(list(_times(results))), style="dim"))


def _points_of(frames: RunFrames, case: dict[Any, Any]) -> pd.DataFrame:
    points = frames.points
    chosen: pd.DataFrame = points[(points["problem"] == case["problem"]) & (points["solver"] == case["solver"])]
    return chosen


def _best(measured: pd.DataFrame) -> dict[str, float]:
    """Best judged residual among points that are not wrong, and the iterations that it took."""
    trusted = measured[measured["outcome"] != Outcome.WRONG] if len(measured) else measured
    if trusted.empty:
        return {"residual": float("nan"), "iterations": float("nan")}
    best = trusted.iloc[int(trusted["residual"].astype(float).argmin())]
    return {"residual": float(best["residual"]), "iterations": float(best["iterations"])}


def ending(case: dict[Any, Any], measured: pd.DataFrame) -> tuple[str, str]:
    """How the case ended: its fault, else the worst of what its ladder shows, with the reason in words."""
    if case["outcome"] != Outcome.MEASURED or measured.empty:
        return str(case["outcome"]), str(case["reason"])
    wrong = measured[measured["outcome"] == Outcome.WRONG]
    if len(wrong):
        first = wrong.iloc[0]
        reason = f"claimed {first['tolerance']:.0e}, the judge reads {first['model_residual']:.1e}"
        return Outcome.WRONG.value, reason
    last = measured.iloc[-1]
    if (measured["outcome"] == Outcome.RELAXED).any():
        return Outcome.RELAXED.value, f"solves the {case['model']} model, not Coulomb friction"
    if last["outcome"] == Outcome.SOLVED:
        return Outcome.SOLVED.value, f"to {last['tolerance']:.0e}"
    return str(last["outcome"]), f"at {last['tolerance']:.0e}: {last['reason']}"


def claims(points: pd.DataFrame, accuracy: float) -> bool:
    """Whether the solver says that it solved to ``accuracy``."""
    if points.empty:
        return False
    asked = points[points["tolerance"] <= accuracy * (1.0 + 1e-9)]
    return bool((asked["status"] == Outcome.SOLVED).any())


def _times(results: pd.DataFrame) -> dict[str, str]:
    """Return the heads of the time columns, and their keys."""
    return {key.removeprefix(_TIME): key for key in results.columns if key.startswith(_TIME)}


def _legend(heads: list[str]) -> str:
    columns = f"Columns {heads[0]} to {heads[-1]} give" if len(heads) > 1 else f"Column {heads[0]} gives"
    return (
        f"{columns} the least median time, preparing included, to that judged residual; – means never reached.\n"
        "cases: problems that the solver supports, which its rates and its mean are over; says: share that the solver "
        "claims; true: share that the judge confirms; mean: shifted geometric mean time."
    )


NARROW = 100
"""Terminals with fewer columns get tables without the model and the iterations; the files have everything."""

_SOLVER_WIDTH = {False: 28, True: 18}
"""Columns that a solver's name gets at least, in wide and narrow terminals; longer ones are wrapped."""


def duration(seconds: float) -> str:
    """Return a time in engineering units, or a dash for NaN: ``"3.1 ms"``."""
    if not np.isfinite(seconds):
        return "–"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.2g} µs"


def _shown_results(results: pd.DataFrame) -> pd.DataFrame:
    shown = pd.DataFrame({"problem": results["problem"], "contacts": results["n_contacts"]})
    shown["solver"] = results["solver"]
    shown["model"] = results["model"]
    for head, key in _times(results).items():
        shown[head] = results[key].map(duration)
    shown["residual"] = [f"{value:.0e}" if np.isfinite(value) else "–" for value in results["residual"]]
    shown["iter."] = [f"{value:.0f}" if np.isfinite(value) else "–" for value in results["iterations"]]
    shown["ended"] = results["outcome"]
    shown["why"] = results["reason"]
    return shown


def _shown_summary(summary: pd.DataFrame) -> pd.DataFrame:
    shown = pd.DataFrame({key: summary[key] for key in ("solver", "model")})
    shown["cases"] = summary["problems"]
    for tag in (key.removeprefix("success_") for key in summary.columns if key.startswith("success_")):
        shown[f"says\n{tag}"] = [f"{100 * value:.0f} %" for value in summary[f"success_{tag}"]]
        shown[f"true\n{tag}"] = [f"{100 * value:.0f} %" for value in summary[f"correct_{tag}"]]
        shown[f"mean\n{tag}"] = summary[f"mean_time_{tag}"].map(duration)
    shown["wrong"] = summary["wrong"]
    return shown


def _print(console: Console, title: str, shown: pd.DataFrame, best: dict[str, Any]) -> None:
    console.print(Text(title, style="bold"))
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, 1, 0, 0))
    is_narrow = console.width < NARROW
    if is_narrow:
        shown = shown.drop(columns=["model", "iter."], errors="ignore")
    for column in shown.columns:
        is_text = column in ("solver", "model", "ended")
        width = _SOLVER_WIDTH[is_narrow] if column == "solver" else None
        table.add_column(
            column, justify="left" if is_text else "right", no_wrap=column != "solver", min_width=width, overflow="fold"
        )
    for index, row in zip(shown.index, shown.itertuples(index=False), strict=True):
        cells = zip(shown.columns, row, strict=True)
        table.add_row(
            *(Text(str(value), style="bold green" if best.get(column) == index else "") for column, value in cells)
        )
    console.print(table)


def _markdown(shown: pd.DataFrame) -> str:
    rows = [[str(column).replace("\n", " ") for column in shown.columns], ["---"] * len(shown.columns)]
    rows += [[inline(value) for value in row] for row in shown.itertuples(index=False)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)
