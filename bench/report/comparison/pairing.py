"""The comparable part of two runs: the same solvers on problems of equal digests, and whether times are comparable."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import pandas as pd

from ...errors import BenchError
from ...store.condition import (
    MAX_BUSY_CORES,
    busy_cores,
    differences,
    hardware_differences,
    machines_by_problem,
    require_comparable,
    warnings,
)
from ...store.frames import CASE, RunFrames
from ...store.records import Machine
from ..layout.text import titled_names

MAX_SPEED_DIFFERENCE = 0.08
"""Largest relative difference between the median probes of two comparable runs."""

MAX_EXCLUDED_SHARE = 0.5
"""Share of excluded rounds above which the times of a run are not compared."""

MAX_NAMES = 5
"""Largest number of names in a sentence."""


@dataclass(frozen=True)
class Pairing:
    """Two runs, restricted to their common part.

    Attributes:
        before: the first run, without cases and tolerances that the second run lacks.
        after: the second run, restricted in the same way.
        notes: sentences about omitted parts and other differences.
        accuracies: the common tolerances, from coarse to fine.
        incomparable_reason: why times are not comparable; empty if they are.
        yardsticks: solvers that determine the scale of times: those not from plugins, or all if anything has changed.
        is_same_software: whether machine, package and libraries are unchanged, so that the yardsticks are certain.
    """

    before: RunFrames
    after: RunFrames
    notes: tuple[str, ...]
    accuracies: tuple[float, ...]
    incomparable_reason: str
    yardsticks: tuple[str, ...]
    is_same_software: bool


def pair(before: RunFrames, after: RunFrames) -> Pairing:
    """Restrict two runs to their comparable part.

    Raises:
        BenchError: if a run is a study or has no case, if the runs were judged by different versions of the judge,
            or if they have no case or no tolerance in common.
    """
    for run in (before, after):
        require_comparable(run)
    if before.info.judge != after.info.judge:
        raise BenchError(
            f"{before.folder} was judged by version {before.info.judge} of the judge, {after.folder} by version "
            f"{after.info.judge}; residuals of both are not comparable, measure the older one again."
        )
    notes = [f"{run.folder}: {sentence}" for run in (before, after) for sentence in (*warnings(run), *run.damaged)]
    keys, left_out = _common_cases(before, after)
    tolerances = set(before.info.plan.tolerances) & set(after.info.plan.tolerances)
    if keys.empty or not tolerances:
        lacking = "case (solver on a problem with the same name and data)" if keys.empty else "tolerance"
        raise BenchError(
            f"{before.folder} and {after.folder} have no {lacking} in common; measure both with the same problems, "
            "solvers and tolerances."
        )
    pairs = _machines_in_pairs(before, after, set(keys["problem"]))
    hardware = list(dict.fromkeys(difference for pair in pairs for difference in hardware_differences(*pair)))
    changed = list(dict.fromkeys(difference for pair in pairs for difference in differences(*pair)))
    if software := [difference for difference in changed if difference not in hardware]:
        notes.append(f"not the same: {'; '.join(software)}")
    solvers = tuple(dict.fromkeys(keys["solver"]))
    own_solvers = tuple(name for name in solvers if not _comes_from_plugin(name, (before, after)))
    return Pairing(
        _restricted(before, keys, tolerances),
        _restricted(after, keys, tolerances),
        (*notes, *left_out),
        tuple(sorted(tolerances, reverse=True)),
        f"the machines differ: {'; '.join(hardware)}" if hardware else _load_reason(before, after),
        solvers if changed else own_solvers,
        not changed,
    )


def _machines_in_pairs(before: RunFrames, after: RunFrames, problems: set[str]) -> list[tuple[Machine, Machine]]:
    """Return all pairs of machines on which a problem was measured in the first and in the second run."""
    measured = [machines_by_problem(run) for run in (before, after)]
    pairs = [
        (first, second)
        for problem in problems
        for first in measured[0].get(problem, [before.info.machine])
        for second in measured[1].get(problem, [after.info.machine])
    ]
    return [pair for index, pair in enumerate(pairs) if pair not in pairs[:index]]


def _common_cases(before: RunFrames, after: RunFrames) -> tuple[pd.DataFrame, list[str]]:
    """Return problem and solver of common cases with equal digests and starts, and sentences about omitted cases."""
    digests = [dict(zip(run.cases["problem"], run.cases["digest"], strict=True)) for run in (before, after)]
    changed = [name for name, digest in digests[0].items() if digests[1].get(name, digest) != digest]
    notes = [titled_names("omitted because the numbers of these problems differ", changed, MAX_NAMES)]
    for column in CASE:
        sets = [dict.fromkeys(run.cases[column]) for run in (before, after)]
        for run, own, other in ((before, sets[0], sets[1]), (after, sets[1], sets[0])):
            names = [name for name in own if name not in other]
            notes.append(titled_names(f"{column}s only in {run.folder}", names, MAX_NAMES))
    columns = [*CASE, "threads", "threads_used", "start"]
    common = before.cases[columns].merge(after.cases[columns], on=CASE)
    common = common[~common["problem"].isin(changed)]
    for column, key, difference in (
        ("threads", "solver", "the declared numbers of threads of these solvers differ"),
        ("threads_used", "solver", "the numbers of threads that these solvers use differ"),
        ("start", "problem", "the starts of warm solvers differ on these problems"),
    ):
        is_equal = common[f"{column}_x"] == common[f"{column}_y"]
        if column == "threads_used":  # 0 is unknown, for example of a case that failed
            is_equal |= (common["threads_used_x"] == 0) | (common["threads_used_y"] == 0)
        names = list(dict.fromkeys(common[key][~is_equal]))
        notes.append(titled_names(f"omitted because {difference}", names, MAX_NAMES))
        common = common[is_equal]
    return common[CASE], [note for note in notes if note]


def _restricted(run: RunFrames, keys: pd.DataFrame, tolerances: Iterable[float]) -> RunFrames:
    """Return the part of a run with the cases ``keys`` and the tolerances."""
    points, rounds = (
        frame[frame["tolerance"].isin(tolerances)].merge(keys, on=CASE) for frame in (run.points, run.rounds)
    )
    return replace(run, cases=run.cases.merge(keys, on=CASE), points=points, rounds=rounds)


def _load_reason(before: RunFrames, after: RunFrames) -> str:
    """Return why times of two runs on one machine are not comparable; empty if they are."""
    if before.rounds.empty or after.rounds.empty:
        return ""
    for run in (before, after):
        share, busy = float((run.rounds["excluded"] != "").mean()), busy_cores(run.info)
        if share > MAX_EXCLUDED_SHARE:
            return f"other programs used the core in {100.0 * share:.0f} % of the rounds of {run.folder}"
        if busy > MAX_BUSY_CORES:
            return f"other programs used {busy:.1f} cores while {run.folder} was measured"
    speed = float(after.rounds["probe_seconds"].median() / before.rounds["probe_seconds"].median())
    if max(speed, 1.0 / speed) > 1.0 + MAX_SPEED_DIFFERENCE:
        return f"a fixed piece of work took {speed:.2f} times as long on the core while {after.folder} was measured"
    return ""


def _comes_from_plugin(solver: str, runs: Iterable[RunFrames]) -> bool:
    """Return whether a solver, or a part of it, comes from a plugin."""
    names = set(re.findall(r"\w+", solver))
    return any(use.kind == "solver" and use.name in names for run in runs for use in run.info.plugins)
