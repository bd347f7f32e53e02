"""Cells of tables as text: times with units, counts, and marks of the fastest times."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ...problems.contact.model import Model
from ..store.condition import EXCLUDED_MARK
from ..store.fields import accuracy_tag
from ..store.ratios import EXCLUDED
from .accuracy import shown_means
from .endings import join_texts

TIME = "time_to_"
"""Prefix of the keys of the time columns, before the accuracy."""


def duration(seconds: float) -> str:
    """Return a time in engineering units, ``"3.1 ms"``, or a dash if it is not finite."""
    if not np.isfinite(seconds):
        return "–"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.2g} µs"


def _number_texts(values: "pd.Series[float]", form: str) -> list[str]:
    """Return numbers as text in the format ``form``, such as ``".2g"``, with dashes for those that are not finite."""
    return [f"{value:{form}}" if np.isfinite(value) else "–" for value in values]


def time_columns(results: pd.DataFrame) -> dict[str, str]:
    """Return the keys of the time columns by their headings."""
    return {key.removeprefix(TIME): key for key in results.columns if key.startswith(TIME)}


def summary_tags(summary: pd.DataFrame) -> list[str]:
    """Return the tags of the accuracies of a summary."""
    return [key.removeprefix("success_") for key in summary.columns if key.startswith("success_")]


def standings_of_cells(results: pd.DataFrame, ratios: pd.DataFrame) -> dict[tuple[Any, str], str]:
    """Return the standing of each time in a table of results, by index and heading."""
    columns = zip(ratios["problem"], ratios["solver"], ratios["accuracy"], ratios["standing"], strict=True)
    standings = {(problem, solver, accuracy_tag(accuracy)): standing for problem, solver, accuracy, standing in columns}
    return {
        (row.Index, heading): standings.get((row.problem, row.solver, heading), "")
        for row in results.itertuples()
        for heading in time_columns(results)
    }


def shown_ratios(ratios: pd.DataFrame) -> pd.DataFrame:
    """Return ratios and their intervals as text."""
    shown = ratios[["problem", "solver", "standing"]].copy()
    shown.insert(1, "to", ratios["accuracy"].map(accuracy_tag))
    shown.insert(3, "time", ratios["seconds"].map(duration))
    for position, heading in enumerate(("ratio", "low", "high"), 4):
        shown.insert(position, heading, _number_texts(ratios[heading], ".3g"))
    return shown


def shown_results(
    results: pd.DataFrame, standings: Mapping[tuple[Any, str], str], is_study: bool = False, bold: str = "{}"
) -> pd.DataFrame:
    """Return results as text, with marks of times that are excluded or may be the fastest.

    The column *threads* is shown if a solver declares several threads. It shows both numbers if the solver uses fewer.
    The column *by model*, which studies lack, shows the residual under the model of each solver, unless all solvers use
    Coulomb's law.

    Args:
        results: as ``results_table`` returns it.
        standings: standing of each time, as ``standings_of_cells`` returns it.
        is_study: whether the results are those of a study, whose residuals are errors and iterations are solves.
        bold: format of the fastest times, with {} for the time.
    """
    times = time_columns(results)
    headings = {"n_contacts": "contacts", "iterations": "iter.", "outcome": "ended", "reason": "why"}
    reasons = list(map(join_texts, results["reason"], results["notes"]))
    shown = results.assign(reason=reasons).drop(columns=["notes", "excluded"])
    shown = shown.rename(columns=headings | {key: heading for heading, key in times.items()})
    for heading in times:
        forms = {"tie": "≈ {}", "fastest": bold, EXCLUDED: f"{{}}{EXCLUDED_MARK}"}
        cells = zip(shown.index, shown[heading].map(duration), strict=True)
        shown[heading] = [forms.get(standings.get((index, heading), ""), "{}").format(text) for index, text in cells]
    pairs = zip(shown.pop("threads_used"), shown["threads"], strict=True)
    shown["threads"] = [f"{used} of {declared}" if 0 < used < declared else str(declared) for used, declared in pairs]
    if (results["threads"] == 1).all():
        shown = shown.drop(columns="threads")
    model_residuals = shown.pop("model_residual")
    if not is_study and not all_solve_coulomb(results):
        shown.insert(list(shown.columns).index("residual") + 1, "by model", model_residuals)
    for heading, form in (("residual", ".0e"), ("by model", ".0e"), ("iter.", ".0f")):
        if heading in shown:
            shown[heading] = _number_texts(shown[heading], form)
    if is_study:
        return shown.drop(columns=["contacts", "family"]).rename(columns={"residual": "error", "iter.": "solves"})
    return shown


def all_solve_coulomb(cases: pd.DataFrame) -> bool:
    """Return whether the solvers of all ``cases`` use Coulomb's law."""
    return bool((cases["model"] == str(Model.COULOMB)).all())


def shown_points(points: pd.DataFrame) -> pd.DataFrame:
    """Return the points of a study as text."""
    shown = pd.DataFrame({"problem": points["problem"], "solver": points["solver"]})
    shown["at"] = _number_texts(points["tolerance"], "g")
    for heading, key in (("error", "error"), ("from", "low"), ("to", "high")):
        shown[heading] = _number_texts(points[key], ".2g")
    shown.insert(3, "quantity", points["quantity"].fillna("–"))
    walls = zip(points["total_seconds"], points["is_excluded"].eq(True), strict=True)  # missing values are not True
    shown["wall"] = [duration(wall) + (EXCLUDED_MARK if is_excluded else "") for wall, is_excluded in walls]
    shown["CPU"] = [duration(seconds) for seconds in points["processor_seconds"]]
    counts = {"solves": "iterations", "members": "repeats", "failed": "failed_members", "missed": "unsolved_steps"}
    if (points["overlapping_steps"] > 0).any():
        counts["overlaps"] = "overlapping_steps"
    for heading, key in counts.items():
        shown[heading] = _number_texts(points[key], ".0f")
    return shown.assign(why=points["reason"])


def shown_summary(summary: pd.DataFrame, tag: str = "") -> pd.DataFrame:
    """Return the summary as text, for the accuracy of a tag, or for all accuracies with their tags in the headings."""
    shown = summary[["solver", "model"]].copy()
    for level in [tag] if tag else summary_tags(summary):
        suffix = "" if tag else f" {level}"
        for heading, share in (("claimed", f"success_{level}"), ("confirmed", f"correct_{level}")):
            shown[heading + suffix] = solved_texts(summary, share)
        for heading, key in shown_means(summary).items():
            shown[heading + suffix] = mean_texts(summary, key, level)
    return shown.assign(wrong=summary["wrong"])


def solved_texts(summary: pd.DataFrame, share: str) -> list[str]:
    """Return the numbers of solved and of all problems as text, ``"3/5"``, given the column of their ratio."""
    pairs = zip(summary[share], summary["problems"], strict=True)
    return [f"{round(value * number)}/{number}" for value, number in pairs]


def mean_texts(summary: pd.DataFrame, key: str, tag: str) -> list[str]:
    """Return mean times as text, with the number of problems if excluded times reduce it."""
    number, total = ("mean_problems", "common") if key == "mean_time" else ("own_problems", "problems")
    columns = summary[f"{key}_{tag}"], summary[f"{number}_{tag}"], summary[total]
    return [
        f"{duration(mean)} ({count})" if 0 < count < n_problems else duration(mean)
        for mean, count, n_problems in zip(*columns, strict=True)
    ]


def shown_problems(problems: pd.DataFrame) -> pd.DataFrame:
    """Return problems as text: number of solvers that reach each accuracy, shortest time, and fastest solver."""
    shown = problems[["problem", "family"]].assign(contacts=problems["n_contacts"].astype(str))
    fastest = pd.Series("–", index=problems.index)
    for key in problems.columns[problems.columns.str.startswith("solved_")]:
        tag = key.removeprefix("solved_")
        cells = zip(problems[key], problems["solvers"], problems[f"time_{tag}"], strict=True)
        shown[tag] = [f"{number}/{n_solvers} {duration(seconds)}" for number, n_solvers, seconds in cells]
        fastest = problems[f"fastest_{tag}"].where(problems[f"fastest_{tag}"] != "", fastest)
    shown["residual"] = _number_texts(problems["residual"], ".0e")
    return shown.assign(solver=fastest)


def shown_families(solvers: Sequence[str], table: pd.DataFrame, tags: Sequence[str] = ()) -> pd.DataFrame:
    """Return the solved problems and mean times of each solver (rows) in each family (columns).

    Args:
        solvers: solvers in the order of the rows; those without a row in ``table`` are omitted.
        table: one row per family and solver, as ``families_table`` returns it.
        tags: accuracies to show; all of ``table`` if empty.
    """
    rows: dict[str, dict[str, str]] = {solver: {} for solver in solvers if solver in set(table["solver"])}
    shown_tags, headings = tags or summary_tags(table), dict[str, None]()
    means = {tag: mean_texts(table, "mean_time", tag) for tag in shown_tags}
    solved = {tag: solved_texts(table, f"correct_{tag}") for tag in shown_tags}
    for index, row in enumerate(table.to_dict("records")):
        for tag in shown_tags:
            heading = row["family"] if len(shown_tags) == 1 else f"{row['family']} {tag}"
            rows[row["solver"]][heading] = f"{solved[tag][index]} {means[tag][index]}"
            headings[heading] = None
    cells = [
        {"solver": solver, **{heading: row.get(heading, "–") for heading in headings}} for solver, row in rows.items()
    ]
    return pd.DataFrame(cells, columns=["solver", *headings])


def shown_starts(starts: pd.DataFrame) -> pd.DataFrame:
    """Return the table of starts as text: solved problems, iterations and times from zero and warm, and the gain."""
    shown = starts[["family", "solver"]].assign(to=starts["tolerance"].map(accuracy_tag))
    for start in ("cold", "warm"):
        counts = zip(starts[f"{start}_solved"], starts["problems"], strict=True)
        shown[f"{start} solved"] = [f"{solved}/{total}" for solved, total in counts]
    for start in ("cold", "warm"):
        shown[f"{start} iter."] = _number_texts(starts[f"{start}_iterations"], ".3g")
    for start in ("cold", "warm"):
        shown[start] = [duration(value) for value in starts[f"{start}_seconds"]]
    shown["gain"] = _number_texts(starts["gain"], ".2g")
    counts = zip(starts["slower"], starts["timed"], strict=True)
    return shown.assign(slower=[f"{slower}/{timed}" for slower, timed in counts])
