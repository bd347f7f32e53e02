"""Which solver to take for problems like given ones, from what a run measured on those most like them.

The cost of a solver on a measured problem is log(t / t*), with the time t to the accuracy and the least one t* of all
solvers, and log ``UNSOLVED_FACTOR`` where it does not reach it. For a given problem the costs of the ``NEIGHBOURS``
measured problems that are closest in their features are averaged with weights 1 / (d + ``NEAR``)², d their distance,
and the solver of the least cost is taken.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ...errors import BenchError
from ...store.frames import RunFrames
from ..accuracy import attempts
from .features import distances, features

NEIGHBOURS = 3
"""Measured problems that a suggestion goes by."""

NEAR = 0.25
"""Distance below which problems count almost the same."""

UNSOLVED_FACTOR = 100.0
"""Times the least time that not to solve a problem counts as."""


class Regret(NamedTuple):
    """What suggestions cost.

    Attributes:
        factor: geometric mean of the time over the least one, over the problems that are solved.
        unsolved: number of problems that the suggested solver does not solve while another one does.
        problems: number of problems that any solver solves.
    """

    factor: float
    unsolved: int
    problems: int


@dataclass(frozen=True)
class Suggestion:
    """Which solver to take.

    Attributes:
        solver: the one for all given problems together.
        accuracy: judged residual to which times were measured.
        problems: one row a given problem: problem, solver (the one for it alone), factor (its time over the least one,
            on the problems nearest to it), nearest (their names), distance (of the nearest one).
        solvers: one row a solver, the best first: solver, factor (over all given problems).
        regret: of suggestions for each problem of the run from the others.
        single: of the solver that is best on all others, for comparison.
    """

    solver: str
    accuracy: float
    problems: pd.DataFrame
    solvers: pd.DataFrame
    regret: Regret
    single: Regret


def suggested(
    run: RunFrames,
    known: Mapping[str, ContactProblem],
    given: Sequence[ContactProblem],
    declined: Mapping[str, Sequence[str]],
    accuracy: float,
) -> Suggestion:
    """Return which solver to take.

    Args:
        run: what was measured.
        known: its problems by name.
        given: problems to solve.
        declined: names of the solvers that do not support one of them, by its name.
        accuracy: judged residual to reach.

    Raises:
        BenchError: if the run has no tolerance as fine as the accuracy, or no solver reaches it, or all solvers that do
            decline a given problem.
    """
    costs = _costs(run, known, accuracy)
    measured = np.array([features(known[name]) for name in costs.index])
    rows, sums = [], pd.Series(0.0, index=costs.columns)
    for problem in given:
        weights, distance = _weights(features(problem), measured)
        own = _averaged(costs, weights).drop(list(declined.get(problem.name, ())), errors="ignore")
        if own.empty:
            raise BenchError(f"every solver of {run.folder} declines {problem.name}; measure others first.")
        nearest = ", ".join(costs.index[np.argsort(-weights, kind="stable")[: int((weights > 0.0).sum())]])
        rows.append((problem.name, own.idxmin(), float(np.exp(own.min())), nearest, distance))
        sums = sums.add(own)  # NaN where it declines one of them
    ranking = np.exp(sums.dropna() / len(given)).sort_values(kind="stable")
    if ranking.empty:
        raise BenchError("no solver supports all of these problems; name fewer of them.")
    regret, single = _regrets(costs, measured)
    return Suggestion(
        str(ranking.index[0]),
        accuracy,
        pd.DataFrame(rows, columns=["problem", "solver", "factor", "nearest", "distance"]),
        ranking.rename("factor").rename_axis("solver").reset_index(),
        regret,
        single,
    )


def _costs(run: RunFrames, known: Mapping[str, ContactProblem], accuracy: float) -> pd.DataFrame:
    """Return the costs of solvers (columns) on the problems that one of them solves (rows)."""
    if accuracy < min(run.info.plan.tolerances) * (1.0 - 1e-9):
        raise BenchError(
            f"{run.folder} has no tolerance as fine as {accuracy:g}; choose a coarser accuracy, or measure one that has."
        )
    times = attempts(run, [accuracy]).pivot(index="problem", columns="solver", values="seconds")
    times = times.reindex(columns=[name for name in run.info.plan.solvers if name in times.columns])
    times = times[times.index.isin(known)].dropna(how="all")
    if times.empty:
        raise BenchError(f"no solver of {run.folder} reaches {accuracy:g} on any problem; choose a coarser accuracy.")
    costs = np.log(times.div(times.min(axis=1), axis=0))
    return costs.clip(upper=np.log(UNSOLVED_FACTOR)).fillna(np.log(UNSOLVED_FACTOR))


def _weights(given: FloatArray, measured: FloatArray) -> tuple[FloatArray, float]:
    """Return the weights of measured problems, shape (n,), and the distance of the nearest one."""
    distance = distances(given, measured)
    weights = 1.0 / (distance + NEAR) ** 2
    if len(weights) > NEIGHBOURS:
        weights[np.argsort(distance, kind="stable")[NEIGHBOURS:]] = 0.0
    return weights / weights.sum(), float(distance.min())


def _averaged(costs: pd.DataFrame, weights: FloatArray) -> "pd.Series[float]":
    return costs.mul(weights, axis=0).sum()


def _regrets(costs: pd.DataFrame, measured: FloatArray) -> tuple[Regret, Regret]:
    """Return the regret of suggestions for each problem from all others, and that of the best solver on these."""
    near, single = [], []
    for place in range(len(costs)):
        others = np.arange(len(costs)) != place
        if not others.any():
            continue
        weights, _ = _weights(measured[place], measured[others])
        near.append(costs.iloc[place][_averaged(costs[others], weights).idxmin()])
        single.append(costs.iloc[place][costs[others].mean().idxmin()])
    return _regret(near), _regret(single)


def _regret(costs: Sequence[float]) -> Regret:
    solved = [cost for cost in costs if cost < np.log(UNSOLVED_FACTOR)]
    factor = float(np.exp(np.mean(solved))) if solved else float("nan")
    return Regret(factor, len(costs) - len(solved), len(costs))
