"""Profiles of solvers over many problems: performance, data and accuracy profiles, time budgets, and speed-ups.

Each profile covers the problems and solvers of one table, so it changes with the table: the shortest time of a problem
is that of the solvers shown. Times are compared only between solvers that use the same number of threads. Performance
profiles therefore cover the solvers with the fewest threads, and speed-ups those with as many as the baseline.

Shares count every problem of the view, solved or not. The view ``COMMON`` contains the problems that all solvers
support; the view ``EVERY`` contains all problems, and a solver fails on those that it does not support.

Source of the performance profile: E. D. Dolan and J. J. Moré, Benchmarking optimization software with performance
profiles, Mathematical Programming 91 (2002), eq. (2.2); of the data profile: J. J. Moré and S. M. Wild, Benchmarking
derivative-free optimization algorithms, SIAM Journal on Optimization 20(1) (2009), eq. (2.8), over seconds in place of
evaluations.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import pandas as pd

from ...problems.errors import suggestion
from ..errors import BenchError
from ..store.frames import CASE, RunFrames
from ..store.ratios import reaching
from .accuracy import (
    common_problems,
    counted_cases,
    excluded_cases,
    families,
    reachable_accuracies,
    summary_accuracies,
    threads_by_solver,
)

PROFILE_ACCURACIES = (1e-4, 1e-6, 1e-8)
"""Judged residuals of profiles, unless they are finer than all tolerances of the run."""

RESIDUALS = tuple(float(f"1e-{power}") for power in range(2, 13))
"""Judged residuals ε of an accuracy profile."""

BUDGETS = (1e-3, 1e-2, 1e-1, 1.0)
"""Times of the table of a data profile [s]."""

PADDING = 1.1
"""Ratio of the last corner of a profile to the largest value, so that the last step is visible."""

ALL = "all problems"
"""Value of the family column for all problems together."""

COMMON, EVERY = VIEWS = ("common", "all")
"""Problems that profiles cover: those that all solvers support, or all. Solvers that support none do not count."""

_LABELS = ["accuracy", "family", "view"]
"""Columns that identify a profile of times: its judged residual, family and view."""

_COLUMNS = {
    "performance": [*_LABELS, "solver", "ratio", "share", "problems"],
    "data": [*_LABELS, "solver", "seconds", "share", "problems"],
    "budgets": [*_LABELS, "solver", "budget", "solved", "problems", "share"],
    "accuracy": ["family", "view", "solver", "residual", "share", "problems"],
    "speedup": ["accuracy", "family", "solver", "problem", "speedup", "baseline"],
}
"""Columns of profiles."""


def check_view(name: str) -> None:
    """Raise ``BenchError`` if the view of profiles is unknown."""
    if name not in VIEWS:
        raise BenchError(f"there is no view {name!r} of profiles{suggestion(name, VIEWS)}")


def profile_accuracies(frames: RunFrames) -> tuple[float, ...]:
    """Return the judged residuals of the profiles of a run, from coarse to fine."""
    return reachable_accuracies(PROFILE_ACCURACIES, frames.info.plan.tolerances) or summary_accuracies(frames)


def seconds_matrix(frames: RunFrames, accuracy: float) -> pd.DataFrame:
    """Return the time to an accuracy [s]: rows are problems, columns are solvers; NaN where it is not reached.

    Problems on which the time of any solver is excluded are omitted.
    """
    limit = frames.info.plan.limits.solve_seconds
    matrix = _matrix(frames, reaching(frames.points, accuracy, limit), "total_seconds")
    return matrix.drop(index=list({problem for problem, _ in excluded_cases(frames.points, accuracy, limit)}))


def residual_matrix(frames: RunFrames) -> pd.DataFrame:
    """Return the smallest judged residual of counted points, in the form of ``seconds_matrix``; NaN without points."""
    counted = reaching(frames.points, np.inf, frames.info.plan.limits.solve_seconds)
    return _matrix(frames, counted[counted["total_seconds"].notna()], "residual")


def _matrix(frames: RunFrames, points: pd.DataFrame, column: str) -> pd.DataFrame:
    solvers = [name for name in frames.info.plan.solvers if name in set(frames.cases["solver"])]
    minima = points.groupby(CASE, sort=False)[column].min().unstack("solver")
    return minima.reindex(index=pd.Index(frames.cases["problem"].unique(), name="problem"), columns=solvers)


def performance_profile(seconds: pd.DataFrame) -> pd.DataFrame:
    """Return the share of problems that each solver solves within a ratio to the shortest time of any solver.

    Args:
        seconds: as ``seconds_matrix`` returns it.

    Returns:
        The corners of the steps: solver, ratio (from 1 to slightly beyond the largest), share.
    """
    ratios = seconds.div(seconds.min(axis=1), axis=0)
    return _steps(ratios, "ratio", 1.0, PADDING * np.fmax(_largest(ratios), 1.0))


def data_profile(seconds: pd.DataFrame) -> pd.DataFrame:
    """Return the share of problems that each solver solves within a time.

    Args:
        seconds: as ``seconds_matrix`` returns it.

    Returns:
        The corners of the steps: solver, seconds (from the shortest to the last of ``BUDGETS``, or slightly beyond the
        longest), share.
    """
    shortest = float(np.fmin.reduce(seconds.to_numpy(dtype=np.float64), axis=None))
    first = shortest if np.isfinite(shortest) else BUDGETS[0]
    return _steps(seconds, "seconds", first, np.fmax(PADDING * _largest(seconds), BUDGETS[-1]))


def budget_table(seconds: pd.DataFrame) -> pd.DataFrame:
    """Return the problems solved within each of ``BUDGETS``: solver, budget [s], solved, problems, share."""
    rows = [
        (solver, budget, int((times <= budget).sum()), len(times))
        for solver, times in seconds.items()
        for budget in BUDGETS
    ]
    table = pd.DataFrame(rows, columns=["solver", "budget", "solved", "problems"])
    return table.assign(share=table["solved"] / table["problems"])


def accuracy_profile(residuals: pd.DataFrame) -> pd.DataFrame:
    """Return the share of problems that each solver solves to a judged residual of at most each of ``RESIDUALS``.

    Args:
        residuals: as ``residual_matrix`` returns it.

    Returns:
        solver, residual, share.
    """
    rows = [(solver, residual, (own <= residual).mean()) for solver, own in residuals.items() for residual in RESIDUALS]
    return pd.DataFrame(rows, columns=["solver", "residual", "share"])


def speedups(seconds: pd.DataFrame, baseline: str) -> pd.DataFrame:
    """Return the speed-up of each solver over a baseline, on the problems that both solve.

    Args:
        seconds: as ``seconds_matrix`` returns it.
        baseline: one of its solvers.

    Returns:
        solver, problem, speedup (time of the baseline over that of the solver).
    """
    factors = (1.0 / seconds.drop(columns=baseline)).mul(seconds[baseline], axis=0)
    rows = factors.melt(var_name="solver", value_name="speedup", ignore_index=False).dropna()
    rows = rows.rename_axis(index="problem").reset_index()
    return rows.reindex(columns=["solver", "problem", "speedup"])


def with_threads(frames: RunFrames, values: pd.DataFrame, baseline: str = "") -> pd.DataFrame:
    """Return the columns of solvers that use as many threads as a baseline, or the fewest if it is empty."""
    threads = threads_by_solver(frames)
    own = threads.reindex(values.columns).to_numpy(dtype=np.float64)
    selected: pd.DataFrame = values[values.columns[own == (threads[baseline] if baseline else own.min(initial=np.inf))]]
    return selected


def other_threads_note(frames: RunFrames, solvers: Iterable[str], baseline: str = "") -> str:
    """Return a note that names the solvers that ``with_threads`` leaves out; empty if there are none."""
    names = list(solvers)
    selected = with_threads(frames, pd.DataFrame(columns=names), baseline).columns
    left_out = [name for name in names if name not in selected]
    return f"without solvers that use another number of threads: {', '.join(left_out)}" if left_out else ""


def baseline_of(frames: RunFrames, name: str = "") -> str:
    """Return the reference solver of speed-ups: ``name`` if given.

    Otherwise, return the one that solves the most problems to the finest accuracy, among those with the fewest threads.

    Raises:
        BenchError: if the run has no case of ``name``, or no case at all.
    """
    solvers = list(dict.fromkeys(frames.cases["solver"]))
    if name and name not in solvers:
        raise BenchError(f"{frames.folder} has no solver {name!r}{suggestion(name, solvers)}")
    require_cases(frames)
    finest, limit = profile_accuracies(frames)[-1], frames.info.plan.limits.solve_seconds
    solved = _matrix(frames, reaching(frames.points, finest, limit), "total_seconds")
    return name or str(with_threads(frames, solved).notna().sum().idxmax())


def require_cases(frames: RunFrames) -> None:
    """Raise ``BenchError`` if a run has no case."""
    if frames.cases.empty:
        raise BenchError(f"{frames.folder} has no finished case; resume the run first.")


def profile_tables(frames: RunFrames, baseline: str) -> dict[str, pd.DataFrame]:
    """Return the numbers of all profiles of a run, over all problems and by family, in both views.

    A view without problems has no rows.

    Returns:
        By name: "performance", "data" and "budgets" with the additional columns accuracy, family and view, "accuracy"
        with family and view, all four with the number of problems; "speedup" with accuracy, family and baseline.
    """
    kinds: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
        "performance": performance_profile,
        "data": data_profile,
        "budgets": budget_table,
    }
    parts: dict[str, list[pd.DataFrame]] = {name: [] for name in (*kinds, "speedup", "accuracy")}
    residuals = residual_matrix(frames)
    times = {accuracy: seconds_matrix(frames, accuracy) for accuracy in profile_accuracies(frames)}
    for family, own in _families_and_all(frames):
        for accuracy, all_seconds in times.items():
            seconds = all_seconds[all_seconds.index.isin(own)]
            factors = speedups(with_threads(frames, seconds, baseline), baseline)
            parts["speedup"].append(factors.assign(accuracy=accuracy, family=family, baseline=baseline))
            for view, view_matrix in _views(frames, seconds):
                for name, profile in kinds.items():
                    labels: dict[str, Any] = {
                        "accuracy": accuracy,
                        "family": family,
                        "view": view,
                        "problems": len(view_matrix),
                    }
                    own_columns = with_threads(frames, view_matrix) if name == "performance" else view_matrix
                    parts[name].append(profile(own_columns).assign(**labels))
        for view, view_matrix in _views(frames, residuals.loc[own]):
            rows = accuracy_profile(view_matrix)
            parts["accuracy"].append(rows.assign(family=family, view=view, problems=len(view_matrix)))
    return {
        name: pd.concat(tables, ignore_index=True)[columns]
        if (tables := parts[name])
        else pd.DataFrame(columns=columns)
        for name, columns in _COLUMNS.items()
    }


def _views(frames: RunFrames, values: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield the part of a matrix of problems and solvers in each of ``VIEWS``, unless it is empty."""
    if values.empty:
        return
    cases = counted_cases(frames)
    cases = cases[cases["problem"].isin(values.index)]
    common = common_problems(cases)
    if common:
        yield COMMON, values.loc[values.index.isin(common), values.columns.isin(cases["solver"])]
    yield EVERY, values


def _families_and_all(frames: RunFrames) -> Iterator[tuple[str, pd.Index]]:
    """Yield the problems of a run: all, and those of each of its ``families``."""
    problems = frames.cases.drop_duplicates("problem").set_index("problem")["family"]
    yield ALL, problems.index
    for family in families(frames):
        yield family, problems.index[problems == family]


def _largest(values: pd.DataFrame) -> float:
    """Return the largest number of a table; NaN without one."""
    return float(np.fmax.reduce(values.to_numpy(dtype=np.float64), axis=None))


def _steps(values: pd.DataFrame, column: str, first: float, last: float) -> pd.DataFrame:
    """Return the empirical distribution function of each column, as corners of a staircase."""
    solvers: list[str] = []
    all_corners, shares = [np.empty(0)], [np.empty(0)]
    for solver, own in values.items() if len(values) else ():
        solved = np.sort(own.dropna().to_numpy(dtype=np.float64))
        corners = np.unique(np.concatenate([[first], solved, [last]]))
        solvers += [str(solver)] * len(corners)
        all_corners.append(corners)
        shares.append(np.searchsorted(solved, corners, side="right") / len(own))
    columns = {column: np.concatenate(all_corners), "share": np.concatenate(shares)}
    return pd.DataFrame({"solver": pd.Series(solvers, dtype=str), **columns})
