"""The comparable part of two runs: the same solvers on problems of equal digests, and whether times compare."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import pandas as pd

from ...errors import BenchError
from ...store.condition import (
    BUSY,
    busy_cores,
    differences,
    machines_by_problem,
    other_hardware,
    require_comparable,
    warnings,
)
from ...store.frames import RunFrames
from ...store.records import Machine

SAME_SPEED = 0.08
"""Part by which the median probes of two runs may differ."""

MOST_EXCLUDED = 0.5
"""Share of excluded rounds above which a run compares with none."""

MOST_NAMES = 5
"""Names that a sentence lists."""

CASE = ["problem", "solver"]
"""What identifies a case."""


@dataclass(frozen=True)
class Pairing:
    """Two runs, restricted to what both have.

    Attributes:
        before: the first run, its frames without the cases and tolerances that the second one has not.
        after: the second run.
        notes: sentences about what is left out, and what else differs.
        accuracies: the tolerances that both have, from coarse to fine.
        obstacle: why times do not compare; empty if they do.
        yardsticks: solvers that take the same time in both runs unless the machine differs.
        is_known: whether that is certain, because the package and its libraries are the same ones.
    """

    before: RunFrames
    after: RunFrames
    notes: tuple[str, ...]
    accuracies: tuple[float, ...]
    obstacle: str
    yardsticks: tuple[str, ...]
    is_known: bool


def pair(before: RunFrames, after: RunFrames) -> Pairing:
    """Restrict two runs to what compares.

    Raises:
        BenchError: if one is a study or has no case, if they were judged by different versions of the judge, or if
            they have no case or no tolerance in common.
    """
    for run in (before, after):
        require_comparable(run)
    if before.info.judge != after.info.judge:
        raise BenchError(
            f"{before.folder} was judged by version {before.info.judge} of the judge, {after.folder} by version "
            f"{after.info.judge}; residuals of both do not compare, measure the older one again."
        )
    notes = [f"{run.folder}: {sentence}" for run in (before, after) for sentence in (*warnings(run), *run.damaged)]
    keys, left_out = _common_cases(before, after)
    tolerances = set(before.info.plan.tolerances) & set(after.info.plan.tolerances)
    if keys.empty or not tolerances:
        lacking = "case (solver on a problem of the same numbers)" if keys.empty else "tolerance"
        raise BenchError(
            f"{before.folder} and {after.folder} have no {lacking} in common; measure both with the same problems, "
            "solvers and tolerances."
        )
    pairs = _machines_in_pairs(before, after, set(keys["problem"]))
    hardware = list(dict.fromkeys(said for pair in pairs for said in other_hardware(*pair)))
    changed = list(dict.fromkeys(said for pair in pairs for said in differences(*pair)))
    if software := [difference for difference in changed if difference not in hardware]:
        notes.append(f"not the same: {'; '.join(software)}")
    solvers = tuple(dict.fromkeys(keys["solver"]))
    ours = tuple(name for name in solvers if not _is_of_plugin(name, (before, after)))
    return Pairing(
        _restricted(before, keys, tolerances),
        _restricted(after, keys, tolerances),
        (*notes, *left_out),
        tuple(sorted(tolerances, reverse=True)),
        f"the machines differ: {'; '.join(hardware)}" if hardware else _load_obstacle(before, after),
        solvers if changed else ours,
        not changed,
    )


def _machines_in_pairs(before: RunFrames, after: RunFrames, problems: set[str]) -> list[tuple[Machine, Machine]]:
    """Return the machines on which each problem was measured in both runs: each of the one with each of the other."""
    measured = [machines_by_problem(run) for run in (before, after)]
    pairs = [
        (one, other)
        for problem in problems
        for one in measured[0].get(problem, [before.info.machine])
        for other in measured[1].get(problem, [after.info.machine])
    ]
    return [pair for place, pair in enumerate(pairs) if pair not in pairs[:place]]


def _common_cases(before: RunFrames, after: RunFrames) -> tuple[pd.DataFrame, list[str]]:
    """Return problem and solver of the cases that both have with equal digests, and what is left out in sentences."""
    digests = [dict(zip(run.cases["problem"], run.cases["digest"], strict=True)) for run in (before, after)]
    changed = [name for name, digest in digests[0].items() if digests[1].get(name, digest) != digest]
    notes = [_listing("the numbers of these problems differ, so they are left out", changed)]
    for what in CASE:
        sets = [dict.fromkeys(run.cases[what]) for run in (before, after)]
        for run, own, other in ((before, sets[0], sets[1]), (after, sets[1], sets[0])):
            notes.append(_listing(f"{what}s of {run.folder} alone", [name for name in own if name not in other]))
    keys = before.cases[CASE].merge(after.cases[CASE])
    return keys[~keys["problem"].isin(changed)], [note for note in notes if note]


def _listing(what: str, names: list[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return f"{what}: {', '.join(names[:MOST_NAMES])}{more}" if names else ""


def _restricted(run: RunFrames, keys: pd.DataFrame, tolerances: Iterable[float]) -> RunFrames:
    points, rounds = (
        frame[frame["tolerance"].isin(tolerances)].merge(keys, on=CASE) for frame in (run.points, run.rounds)
    )
    return replace(run, cases=run.cases.merge(keys, on=CASE), points=points, rounds=rounds)


def _load_obstacle(before: RunFrames, after: RunFrames) -> str:
    """Return why times of two runs on one machine do not compare; empty if they do."""
    if before.rounds.empty or after.rounds.empty:
        return ""
    for run in (before, after):
        share, busy = float((run.rounds["excluded"] != "").mean()), busy_cores(run.info)
        if share > MOST_EXCLUDED:
            return f"something else used the core in {100.0 * share:.0f} % of the rounds of {run.folder}"
        if busy > BUSY:
            return f"other programs used {busy:.1f} cores while {run.folder} was measured"
    speed = float(after.rounds["probe_seconds"].median() / before.rounds["probe_seconds"].median())
    if max(speed, 1.0 / speed) > 1.0 + SAME_SPEED:
        return f"a fixed piece of work took {speed:.2f} times as long on the core while {after.folder} was measured"
    return ""


def _is_of_plugin(solver: str, runs: Iterable[RunFrames]) -> bool:
    """Whether a solver, or a part of it, is of a plugin."""
    names = set(re.findall(r"\w+", solver))
    return any(use.kind == "solver" and use.name in names for run in runs for use in run.info.plugins)
