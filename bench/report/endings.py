"""Endings of cases as texts."""

from typing import Any

import pandas as pd

from ...problems.contact.solver import Status
from ..store.frames import RunFrames
from ..store.outcome import Outcome, claim_reason
from .accuracy import accuracy_tag

CASE = ["problem", "solver"]
"""Columns that identify a case."""


def attempted_points(frames: RunFrames) -> pd.DataFrame:
    """Return the points of a run that were attempted."""
    attempted: pd.DataFrame = frames.points[frames.points["total_seconds"].notna()]
    return attempted


def case_endings(frames: RunFrames) -> pd.DataFrame:
    """Return the ending of each case, in the order of the cases.

    Columns: outcome (the fault of the case, else the worst of its ladder), reason, and notes (of the finest point with
    notes).
    """
    attempted = attempted_points(frames)
    ladders = dict(iter(attempted.groupby(CASE, sort=False)))
    rows = []
    for case in frames.cases.to_dict("records"):
        ladder = ladders.get((case["problem"], case["solver"]), attempted.iloc[:0])
        noted = ladder[ladder["notes"] != ""]
        notes = "" if noted.empty else f"{_prefix(noted.iloc[-1])}{noted['notes'].iloc[-1]}"
        rows.append((*_ending(case, ladder), notes))
    return pd.DataFrame(rows, columns=["outcome", "reason", "notes"], index=frames.cases.index)


def join_texts(reason: str, notes: str) -> str:
    """Join the reason and the notes of a case or point, and omit the tolerance of the notes if the reason has it."""
    prefix, separator, rest = notes.partition(": ")
    has_prefix = separator and reason.startswith(f"{prefix}: ")
    return "; ".join(filter(None, (reason, rest if has_prefix else notes)))


def _prefix(point: "pd.Series[Any]") -> str:
    """Return the beginning of a text about a point, which gives its tolerance."""
    return f"at {accuracy_tag(point['tolerance'])}: "


def _ending(case: dict[Any, Any], ladder: pd.DataFrame) -> tuple[str, str]:
    """Return the outcome of a case with its attempted points, and the reason."""
    if case["outcome"] != Outcome.MEASURED:
        return str(case["outcome"]), str(case["reason"])
    for outcome in (Outcome.WRONG, Outcome.RELAXED):
        if len(claims := ladder[ladder["outcome"] == outcome]):
            first = claims.iloc[0]
            if first["status"] == Status.INFEASIBLE:
                return outcome.value, str(first["reason"])
            return outcome.value, claim_reason(outcome, first["tolerance"], case["model"], first["model_residual"])
    if not case["is_tried"]:
        reached = f"below {accuracy_tag(ladder['tolerance'].iloc[-1])}" if len(ladder) else "yet"
        return Outcome.UNFINISHED.value, f"not measured {reached}"
    if ladder.empty:
        return str(case["outcome"]), str(case["reason"])
    last = ladder.iloc[-1]
    if last["outcome"] == Outcome.SOLVED:
        return Outcome.SOLVED.value, f"to {accuracy_tag(last['tolerance'])}"
    return str(last["outcome"]), f"{_prefix(last)}{last['reason']}"
