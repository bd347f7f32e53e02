"""Times to reach an accuracy, and numbers of solved problems, for one problem and over all problems of a run."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ...problems.arrays import FloatArray
from ...solvers.composite.warm import warm_name
from ..store.fields import TOLERANCE_ROUNDING, accuracy_tag
from ..store.frames import CASE, RunFrames
from ..store.outcome import Outcome
from ..store.ratios import ALONE, EXCLUDED, MARGIN, STANDINGS, reaching, standings, times_by_point

ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
"""Judged residuals for which tables give times, if a run has more than four tolerances."""

SUMMARY_ACCURACIES = (1e-4, 1e-6)
"""Judged residuals of the summary."""

SHIFT_SECONDS = 1e-3
"""Shift of the geometric mean [s], which limits the weight of problems that are solved in less time."""

_PAIR_COLUMNS = ["problem", "family", "tolerance"]
"""Columns on which the points of a solver and those of its warm variant are joined."""

_START_COLUMNS = [
    "problems",
    "cold_solved",
    "warm_solved",
    "cold_iterations",
    "warm_iterations",
    "timed",
    "cold_seconds",
    "warm_seconds",
    "gain",
    "slower",
]
"""Columns of ``starts_table`` after family, solver and tolerance."""


def accuracies(frames: RunFrames) -> tuple[float, ...]:
    """Return the judged residuals for which the tables of a run give times, from coarse to fine.

    These are the tolerances of the run if there are no more of them than ``ACCURACIES``. Otherwise they are those of
    ``ACCURACIES`` that are not finer than the finest tolerance, because finer ones would count as failures.
    """
    tolerances = _tolerances(frames)
    if len(tolerances) <= len(ACCURACIES):
        return tolerances
    return reachable_accuracies(ACCURACIES, tolerances) or tolerances[-1:]


def summary_accuracies(frames: RunFrames) -> tuple[float, ...]:
    """Return the judged residuals of the summary, at most two of ``accuracies``."""
    tolerances = _tolerances(frames)
    if len(tolerances) <= len(ACCURACIES) and not set(SUMMARY_ACCURACIES) <= set(tolerances):
        return tolerances[-2:]
    return reachable_accuracies(SUMMARY_ACCURACIES, tolerances) or accuracies(frames)[-1:]


def _tolerances(frames: RunFrames) -> tuple[float, ...]:
    """Return the tolerances of a run, from coarse to fine."""
    return tuple(sorted(frames.info.plan.tolerances, reverse=True))


def reachable_accuracies(wanted: Sequence[float], tolerances: Sequence[float]) -> tuple[float, ...]:
    """Return the accuracies that are not finer than the finest tolerance."""
    return tuple(accuracy for accuracy in wanted if accuracy >= min(tolerances) * (1.0 - TOLERANCE_ROUNDING))


def times_to_accuracies(points: pd.DataFrame, levels: Sequence[float], limit: float = np.inf) -> pd.DataFrame:
    """Return the least median time [s] in which each case reaches each accuracy; NaN if it does not.

    Rows are cases that reach any accuracy, by problem and solver; columns are accuracies.

    Args:
        points: as in ``RunFrames``, of any number of cases.
        levels: the accuracies.
        limit: time limit of one solve [s].
    """
    counted = reaching(points, max(levels, default=np.inf), limit)
    counted = counted[counted["total_seconds"].notna()]
    times = {level: counted[counted["residual"] <= level].groupby(CASE)["total_seconds"].min() for level in levels}
    return pd.DataFrame(times, columns=list(levels))


def excluded_cases(points: pd.DataFrame, accuracy: float, limit: float = np.inf) -> set[tuple[str, str]]:
    """Return (problem, solver) of each case whose time to an accuracy has only excluded rounds.

    Args:
        points: as in ``RunFrames``, of any number of cases.
        accuracy: judged residual.
        limit: time limit of one solve [s].
    """
    reached = reaching(points, accuracy, limit).dropna(subset="total_seconds")
    least = reached.sort_values("total_seconds", kind="stable").drop_duplicates(CASE)
    excluded = least[least["is_excluded"].astype(bool)]
    return set(zip(excluded["problem"], excluded["solver"], strict=True))


def ratios_table(frames: RunFrames) -> pd.DataFrame:
    """Return the standing of each solver on each problem at each of ``accuracies``, with intervals of the ratios.

    A solver is compared with those that use the same number of threads. If there is no other such solver, its standing
    is "alone".

    Columns: problem, accuracy, and those of ``standings``. The table of a run over trajectories is empty.
    """
    points, rounds, limit = frames.points, frames.rounds, frames.info.plan.limits.solve_seconds
    tables = []
    for problem in [] if frames.is_study else frames.cases["problem"].unique():
        own, times = points[points["problem"] == problem], times_by_point(rounds[rounds["problem"] == problem])
        by_threads = [own[own["solver"].isin(solvers)] for solvers in solvers_by_threads(frames).values()]
        for accuracy in accuracies(frames):
            groups = [standings(comparable, times, accuracy, limit) for comparable in by_threads]
            if len(groups) > 1:
                groups = [group.assign(standing=ALONE) if len(group) == 1 else group for group in groups]
            tables += [group.assign(problem=problem, accuracy=accuracy) for group in groups]
    columns = ["problem", "accuracy", *STANDINGS]
    return pd.concat(tables, ignore_index=True)[columns] if tables else pd.DataFrame(columns=columns)


def solvers_by_threads(frames: RunFrames) -> dict[int, list[str]]:
    """Return the solvers of a run by their number of threads, in ascending order."""
    threads = threads_by_solver(frames)
    return {count: list(threads.index[threads == count]) for count in sorted(map(int, threads.unique()))}


def threads_by_solver(frames: RunFrames) -> "pd.Series[int]":
    """Return the largest number of threads that each solver of a run used; if unknown, the declared number."""
    cases = frames.cases
    declared = cases.groupby("solver", sort=False)["threads"].max()
    used = cases[cases["threads_used"] > 0].groupby("solver")["threads_used"].max()
    return used.reindex(declared.index).fillna(declared).astype(int)


def excluded_times(frames: RunFrames) -> pd.DataFrame:
    """Return the times that have only excluded rounds: problem, solver, accuracy and standing."""
    limit = frames.info.plan.limits.solve_seconds
    rows = [
        (problem, solver, accuracy, EXCLUDED)
        for accuracy in accuracies(frames)
        for problem, solver in sorted(excluded_cases(frames.points, accuracy, limit))
    ]
    return pd.DataFrame(rows, columns=["problem", "solver", "accuracy", "standing"])


def mean_time(times: FloatArray, limit: float) -> float:
    """Return the shifted geometric mean of times [s], with NaN and times above ``limit`` [s] replaced by it.

    The mean is NaN if there are no times.
    """
    if not len(times):
        return float("nan")
    filled = np.where(np.isnan(times), limit, np.minimum(times, limit))
    return float(np.exp(np.mean(np.log(filled + SHIFT_SECONDS))) - SHIFT_SECONDS)


def counted_cases(frames: RunFrames) -> pd.DataFrame:
    """Return the cases that tables count: supported ones that failed or were measured at all tolerances."""
    cases: pd.DataFrame = frames.cases[(frames.cases["outcome"] != Outcome.UNSUPPORTED) & frames.cases["is_tried"]]
    return cases


def common_problems(cases: pd.DataFrame) -> set[str]:
    """Return the problems of ``counted_cases`` that all solvers support, ignoring solvers that support none."""
    counts = cases.groupby("problem")["solver"].nunique()
    return set(counts.index[counts == cases["solver"].nunique()])


def attempts(frames: RunFrames, levels: Sequence[float]) -> pd.DataFrame:
    """Return one row per solver, problem of its ``counted_cases``, and accuracy of ``levels``, in the order of the run.

    Columns: solver, model, problem, accuracy, seconds (the time to this accuracy, NaN if it is not reached), claimed
    (whether the solver claims to reach it), common (whether all solvers of the table support the problem), excluded
    (whether the time has only excluded rounds), compared (whether the problem is common, and no solver's time is
    excluded).
    """
    cases = counted_cases(frames)
    common = common_problems(cases)
    points = frames.points[frames.points["total_seconds"].notna()]
    limit = frames.info.plan.limits.solve_seconds
    times = times_to_accuracies(points, levels, limit)
    order = {name: k for k, name in enumerate(frames.info.plan.solvers)}
    cases = cases.sort_values("solver", key=lambda names: names.map(order), kind="stable").reset_index(drop=True)
    names = list(zip(cases["problem"], cases["solver"], strict=True))
    parts = []
    for level in levels:
        seconds, claimed = times[level].to_dict(), claimed_cases(points, level)
        excluded = excluded_cases(points, level, limit)
        columns: dict[str, Any] = {
            "seconds": [seconds.get(name, np.nan) for name in names],
            "claimed": [name in claimed for name in names],
            "common": cases["problem"].isin(common),
            "excluded": [name in excluded for name in names],
            "compared": cases["problem"].isin(common - {problem for problem, _ in excluded}),
        }
        parts.append(cases[["solver", "model", "problem"]].assign(accuracy=level, **columns))
    return pd.concat(parts).sort_index(kind="stable").reset_index(drop=True)


ACCURACY_COLUMNS = ("success", "correct", "mean_time", "mean_problems", "own_mean_time", "own_problems")
"""Prefixes of the columns of a summary for each accuracy."""


def summary_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row per solver over all problems of the run.

    Columns: solver, model, problems (its ``counted_cases``), common (those of all solvers), and for each of
    ``summary_accuracies``: the share of its problems that the solver claims to solve (success), the share that the
    judge confirms (correct), and shifted geometric means of the time [s], in which a failure counts as the time limit.
    The means are over the common problems (mean_time; NaN without any), and over all problems of the solver
    (own_mean_time, not comparable between solvers). Further columns are the numbers of problems in both means
    (mean_problems, own_problems) and of wrong claims (wrong). Means ignore excluded times; a common problem with an
    excluded time is omitted for all solvers.
    """
    levels = summary_accuracies(frames)
    all_attempts = attempts(frames, levels)
    points, limit = frames.points, frames.info.plan.limits.solve_seconds
    rows = []
    for (solver, model), own in all_attempts.groupby(["solver", "model"], sort=False):
        row: dict[str, Any] = {"solver": solver, "model": model, "problems": own["problem"].nunique()}
        row["common"] = own["problem"][own["common"]].nunique()
        for accuracy in levels:
            own_attempts = own[own["accuracy"] == accuracy]
            seconds = own_attempts["seconds"]
            time_groups = seconds[own_attempts["compared"]], seconds[~own_attempts["excluded"]]
            means = [value for times in time_groups for value in (mean_time(times.to_numpy(), limit), len(times))]
            values = (own_attempts["claimed"].mean(), seconds.notna().mean(), *means)
            row |= dict(zip(_accuracy_columns(accuracy), values, strict=True))
        row["wrong"] = int(((points["solver"] == solver) & (points["outcome"] == Outcome.WRONG)).sum())
        rows.append(row)
    columns = [name for accuracy in levels for name in _accuracy_columns(accuracy)]
    return pd.DataFrame(rows, columns=["solver", "model", "problems", "common", *columns, "wrong"])


def families(frames: RunFrames) -> list[str]:
    """Return the families of the problems of a run, in order.

    The list is empty if there is only one family, or one per problem.
    """
    names = list(dict.fromkeys(frames.cases["family"]))
    return names if 1 < len(names) < frames.cases["problem"].nunique() else []


def families_table(frames: RunFrames) -> pd.DataFrame:
    """Return the summary of each family of problems: its name, and the columns of ``summary_table``.

    Common problems of a family are those that all solvers support, ignoring solvers that support none.
    """
    parts = [
        summary_table(frames.only(own)).assign(family=str(family))
        for family, own in frames.cases.groupby("family", sort=False)["problem"].unique().items()
    ]
    columns = ["family", *summary_table(frames).columns]
    return pd.concat(parts, ignore_index=True)[columns] if parts else pd.DataFrame(columns=columns)


def starts_table(frames: RunFrames) -> pd.DataFrame:
    """Return the effect of warm starts, one row for each family, solver and tolerance.

    Columns: family, solver, tolerance; problems (the number of those with a previous step), and how many of them are
    solved from zero (cold_solved) and warm (warm_solved). The mean iterations (cold_iterations, warm_iterations) are
    over the problems solved both ways. The other columns are over those of these problems that have no excluded time:
    their number (timed), the geometric mean times [s] (cold_seconds, warm_seconds), the ratio of the cold to the warm
    mean (gain), and the number of problems that a warm start slows down by ``MARGIN`` or more (slower).
    """
    points, rows = frames.points, list[dict[str, Any]]()
    shown = points[points["tolerance"].isin(accuracies(frames))] if len(points) else points
    by_solver = dict(iter(shown.groupby("solver", sort=False)))
    for solver in frames.info.plan.solvers:
        if solver in by_solver and warm_name(solver) in by_solver:
            pairs = by_solver[solver].merge(by_solver[warm_name(solver)], on=_PAIR_COLUMNS, suffixes=("_cold", "_warm"))
            groups = pairs.groupby(["family", "tolerance"], sort=False)
            rows += [
                {"family": family, "solver": solver, "tolerance": level, **_compare_starts(own)}
                for (family, level), own in groups
            ]
    order = {family: index for index, family in enumerate(dict.fromkeys(frames.cases["family"]))}
    rows.sort(key=lambda row: (-row["tolerance"], order[row["family"]]))
    return pd.DataFrame(rows, columns=["family", "solver", "tolerance", *_START_COLUMNS])


def _compare_starts(pairs: pd.DataFrame) -> dict[str, float]:
    """Return the numbers in one row of ``starts_table``.

    Args:
        pairs: cold and warm points of one solver, family and tolerance, with the suffixes "_cold" and "_warm".
    """
    solved = {start: pairs[f"outcome_{start}"] == Outcome.SOLVED for start in ("cold", "warm")}
    solved_pairs = pairs[solved["cold"] & solved["warm"]]
    timed = solved_pairs[~solved_pairs[["is_excluded_cold", "is_excluded_warm"]].astype(bool).any(axis=1)]
    cold, warm = (np.log(timed[f"total_seconds_{start}"].to_numpy(dtype=float)) for start in ("cold", "warm"))
    means = [float(np.exp(values.mean())) if len(values) else float("nan") for values in (cold, warm, cold - warm)]
    return {
        "problems": len(pairs),
        "cold_solved": int(solved["cold"].sum()),
        "warm_solved": int(solved["warm"].sum()),
        "cold_iterations": float(solved_pairs["iterations_cold"].mean()),
        "warm_iterations": float(solved_pairs["iterations_warm"].mean()),
        "timed": len(timed),
        "cold_seconds": means[0],
        "warm_seconds": means[1],
        "gain": means[2],
        "slower": int((warm - cold >= np.log1p(MARGIN)).sum()),
    }


def problems_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row per problem: the number of solvers that reach each accuracy, and the fastest one.

    Times are compared only between the solvers with the fewest threads.

    Columns: problem, family, n_contacts, n_rows, solvers (with a counted case); for each accuracy the number of solvers
    that reach it (``solved_1e-04``), the fastest of them (``fastest_1e-04``, empty if none, or if a time is excluded)
    and its time [s] (``time_1e-04``); the least judged residual, ignoring wrong claims (residual), and its solver
    (best).
    """
    table = frames.cases[["problem", "family", "n_contacts", "n_rows"]]
    table = table.drop_duplicates("problem", ignore_index=True)
    names, shown = table["problem"], accuracies(frames)
    table["solvers"] = _counts(names, counted_cases(frames)["problem"])
    all_reached = attempts(frames, shown).dropna(subset="seconds")
    compared = next(iter(solvers_by_threads(frames).values()), [])
    for accuracy in shown:
        tag, reached = accuracy_tag(accuracy), all_reached[all_reached["accuracy"] == accuracy]
        is_compared = reached["solver"].isin(compared)
        with_excluded = reached["problem"][is_compared & reached["excluded"].astype(bool)]
        is_compared &= ~reached["problem"].isin(with_excluded)
        least = _rows_of_least(reached[is_compared], "seconds")
        table[f"solved_{tag}"] = _counts(names, reached["problem"])
        table[f"fastest_{tag}"] = [least["solver"].get(name, "") for name in names]
        table[f"time_{tag}"] = names.map(least["seconds"])
    trusted = frames.points[frames.points["outcome"] != Outcome.WRONG].dropna(subset="residual")
    best = _rows_of_least(trusted, "residual")
    solvers = [best["solver"].get(name, "") for name in names]
    return table.assign(residual=names.map(best["residual"]), best=solvers)


def _counts(names: "pd.Series[str]", occurrences: "pd.Series[str]") -> "pd.Series[int]":
    """Return the number of occurrences of each name."""
    return names.map(occurrences.value_counts()).fillna(0).astype(int)


def _rows_of_least(rows: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return the row of each problem with the least number in a column."""
    return rows.sort_values(column, kind="stable").drop_duplicates("problem").set_index("problem")


def compares_all(summary: pd.DataFrame) -> bool:
    """Return whether all problems of a summary are common, so that both means are equal."""
    return bool((summary["common"] == summary["problems"]).all())


def shown_means(summary: pd.DataFrame) -> dict[str, str]:
    """Return the means that a summary shows: a mapping from headings to the prefixes of their columns."""
    if compares_all(summary):
        return {"mean": "mean_time"}
    common = int(summary["common"].max())
    return ({f"mean of {common}": "mean_time"} if common else {}) | {"own mean": "own_mean_time"}


def _accuracy_columns(accuracy: float) -> list[str]:
    return [f"{kind}_{accuracy_tag(accuracy)}" for kind in ACCURACY_COLUMNS]


def claimed_cases(points: pd.DataFrame, accuracy: float) -> set[tuple[str, str]]:
    """Return (problem, solver) of each case whose solver claims to reach ``accuracy``."""
    finer = points[
        (points["tolerance"] <= accuracy * (1.0 + TOLERANCE_ROUNDING)) & (points["status"] == Outcome.SOLVED)
    ]
    return set(zip(finer["problem"], finer["solver"], strict=True))
