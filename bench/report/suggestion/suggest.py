"""Say which solver to take for given problems."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from ....problems.catalog.catalog import load
from ....problems.contact.problem import ContactProblem
from ....problems.errors import ProxbenchError
from ....solvers.interface import SolverError
from ....solvers.registry import create, find
from ...errors import BenchError
from ...store.frames import read_frames
from .features import FEATURES, features
from .measured import Measured, measured_in, shipped
from .nearest import Regret, costs, nearest_weights, regret, regret_of_single_best

MOST_NAMED = 3
"""Nearest problems that are named."""

FAR = 1.5
"""Distance of the nearest measured problem from which nothing measured is like the given one."""


@dataclass(frozen=True)
class Suggestion:
    """Which solver to take.

    Attributes:
        solver: the one for all given problems together.
        accuracy: judged residual to which times were measured.
        source: what was measured, in words.
        problems: one row a given problem: problem, solver (the one for it alone), factor (its time over the least one,
            on the problems nearest to it), nearest (their names), distance (of the nearest one).
        solvers: one row a solver that supports all given problems, the best first: solver, factor (over all of them).
        regret: of a suggestion for each measured problem from all others.
        regret_of_families: the same from the problems of other families.
        single: of the solver that is best on all others, for comparison.
    """

    solver: str
    accuracy: float
    source: str
    problems: pd.DataFrame
    solvers: pd.DataFrame
    regret: Regret
    regret_of_families: Regret
    single: Regret

    @property
    def words(self) -> str:
        """What the columns mean, and what suggestions cost, in words."""
        return (
            f"factor: time to {self.accuracy:.0e} over that of the fastest solver, on the nearest problems of "
            f"{self.source}. What suggestions cost there, if each problem gets one from all others: {self.regret}; "
            f"from those of other families: {self.regret_of_families}; if all get the one best solver: {self.single}."
        )

    @property
    def far(self) -> list[str]:
        """Names of the given problems that nothing measured is like."""
        return list(self.problems.loc[self.problems["distance"] > FAR, "problem"])


def suggest(
    problems: Sequence[str | Path | ContactProblem] | str | Path | ContactProblem,
    run: os.PathLike[str] | str | None = None,
    accuracy: float = 1e-4,
) -> Suggestion:
    """Say which solver to take for problems like these, from what was measured on those most like them.

    Args:
        problems: names, files, or problems, or one of them.
        run: the run to go by, or its folder; the table of the package if None.
        accuracy: judged residual to reach.

    Raises:
        ProblemError: for a problem that is unknown or cannot be read.
        BenchError: if the run has no case, none of its solvers reaches the accuracy, or all decline a problem.
    """
    given = [problems] if isinstance(problems, str | Path | ContactProblem) else list(problems)
    chosen = [one if isinstance(one, ContactProblem) else load(one) for one in given]
    return suggested(shipped() if run is None else measured_in(read_frames(Path(run))), chosen, accuracy)


def suggested(measured: Measured, given: Sequence[ContactProblem], accuracy: float) -> Suggestion:
    """Return which solver to take, from measured times; see ``suggest``."""
    if not 0.0 < accuracy < 1.0:
        raise BenchError(f"the accuracy is a judged residual between 0 and 1, got {accuracy:g}.")
    if not given:
        raise BenchError("there is no problem to suggest a solver for; name one.")
    seconds, reached = measured.at(accuracy)
    seconds = seconds.dropna(how="all")
    if seconds.empty:
        raise BenchError(
            f"no solver of {measured.source} reaches {reached:g} on any problem; choose a coarser accuracy."
        )
    known, names, solvers = costs(seconds.to_numpy(dtype=np.float64)), list(seconds.index), list(seconds.columns)
    of_known = measured.problems.loc[names, list(FEATURES)].to_numpy(dtype=np.float64)
    rows, total = [], np.zeros(len(solvers))
    for problem in given:
        weights, distance = nearest_weights(features(problem), of_known)
        own = np.where(_declines(solvers, problem), np.inf, weights @ known)
        best = int(np.argmin(own))
        if np.isinf(own[best]):
            raise BenchError(f"all solvers of {measured.source} decline {problem.name}; measure others first.")
        nearest = ", ".join(names[place] for place in np.argsort(distance, kind="stable")[:MOST_NAMED])
        rows.append((problem.name, solvers[best], float(np.exp(own[best])), nearest, float(distance.min())))
        total += own
    ranking = pd.DataFrame({"solver": solvers, "factor": np.exp(total / len(given))})
    ranking = ranking[np.isfinite(ranking["factor"])].sort_values("factor", kind="stable", ignore_index=True)
    if ranking.empty:
        raise BenchError("no solver supports all of these problems; name fewer of them.")
    families = list(measured.problems.loc[names, "family"])
    return Suggestion(
        str(ranking["solver"].iloc[0]),
        reached,
        measured.source,
        pd.DataFrame(rows, columns=["problem", "solver", "factor", "nearest", "distance"]),
        ranking,
        regret(known, of_known, names),
        regret(known, of_known, families),
        regret_of_single_best(known, names),
    )


def _declines(solvers: Sequence[str], problem: ContactProblem) -> list[bool]:
    """Return which solvers do not support a problem, or are not installed; those of plugins are not looked at."""
    return [_is_built_in(name) and not _supports(name, problem) for name in solvers]


def _is_built_in(name: str) -> bool:
    with suppress(SolverError):
        return find(name) is None
    return False


def _supports(name: str, problem: ContactProblem) -> bool:
    with suppress(ProxbenchError):
        return create(name).supports(problem) is None
    return False
