"""Accuracies that only one of two runs reaches."""

import pandas as pd

from ...store.fields import TOLERANCE_ROUNDING
from ...store.frames import CASE, RunFrames
from ...store.outcome import Outcome
from .pairing import Pairing
from .times import reaching_tolerances

SOLVED, UNSOLVED, UNDECIDED = "solved", "unsolved", "undecided"
"""Kinds of changes: reached only in the second run, only in the first run, and undecided."""

SHARED_CORE_SLOWDOWN = 2.0
"""Largest slowdown of a solve on a shared core."""

CHANGES = [*CASE, "accuracy", "change", "reason"]
"""Columns of ``find_solved_changes``."""


def find_solved_changes(pairing: Pairing) -> pd.DataFrame:
    """Return one row for each solver, problem and accuracy that only one of two runs reaches, columns ``CHANGES``.

    A change is undecided if the other run has not measured the point yet. It is also undecided if the other run reached
    a time limit, of a solve or of a case, and a shared core can explain this: all rounds of the point are excluded, the
    limits differ, or the run that reaches the accuracy took more than 1/``SHARED_CORE_SLOWDOWN`` of the limit.
    """
    sides = (pairing.before, pairing.after)
    key = [*CASE, "accuracy"]
    reached = [reaching_tolerances(run, pairing.accuracies).set_index(key)["tolerance"] for run in sides]
    rows = []
    for (own, own_reached), (other, other_reached), change in (
        ((pairing.after, reached[1]), (pairing.before, reached[0]), SOLVED),
        ((pairing.before, reached[0]), (pairing.after, reached[1]), UNSOLVED),
    ):
        for name in own_reached.index.difference(other_reached.index, sort=False):
            is_undecided, reason = _ending(own, other, name[:2], own_reached[name], accuracy=name[2])
            rows.append((*name, UNDECIDED if is_undecided else change, reason))
    return pd.DataFrame(rows, columns=CHANGES)


def _ending(
    own: RunFrames, other: RunFrames, case: tuple[str, str], tolerance: float, accuracy: float
) -> tuple[bool, str]:
    """Return whether the result of ``other``, which misses an accuracy, is undecided, and describe its ending.

    Args:
        own: the run that reaches the accuracy.
        other: the run that misses it.
        case: problem and solver.
        tolerance: tolerance at which ``own`` reaches the accuracy.
        accuracy: the accuracy.
    """
    case_row = _rows_of_case(other.cases, case).iloc[0]
    if case_row["outcome"] != Outcome.MEASURED:
        limits = [run.info.plan.limits.case_seconds for run in (own, other)]
        seconds = float(_rows_of_case(own.cases, case)["wall_seconds"].iloc[0])
        is_explained = limits[0] != limits[1] or seconds * SHARED_CORE_SLOWDOWN > limits[1]
        reason = f"{case_row['outcome']}, {case_row['reason']}"
        return bool(case_row["outcome"] == Outcome.TIMEOUT and is_explained), reason
    points = _rows_of_case(other.points, case)
    finer = points[points["tolerance"] <= accuracy * (1.0 + TOLERANCE_ROUNDING)]
    if finer.empty:
        return not case_row["is_finished"], "not measured"
    point = finer.sort_values("tolerance").iloc[-1]
    reason = f"{point['outcome']}, {point['reason'] or 'judged residual {:.0e}'.format(point['residual'])}"
    limits = [run.info.plan.limits.solve_seconds for run in (own, other)]
    seconds = _rows_of_case(own.points, case).set_index("tolerance")["total_seconds"][tolerance]
    is_explained = bool(point["is_excluded"]) or limits[0] != limits[1] or seconds * SHARED_CORE_SLOWDOWN > limits[1]
    return bool(point["outcome"] == Outcome.TIME_LIMIT and is_explained), reason


def _rows_of_case(frame: pd.DataFrame, case: tuple[str, str]) -> pd.DataFrame:
    return frame[(frame["problem"] == case[0]) & (frame["solver"] == case[1])]
