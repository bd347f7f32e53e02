"""Endings of cases as texts."""

from typing import Any

import pandas as pd

from ...problems.contact.solver import Status
from ..store.fields import accuracy_tag
from ..store.frames import CASE, RunFrames
from ..store.outcome import Outcome, claim_reason
from ..store.plans import Limits
from .layout.text import counted

_POINT_COLUMNS = ["tolerance", "outcome", "reason", "status", "model_residual", "notes"]
"""Columns of a point on which the ending of its case depends."""


def attempted_points(frames: RunFrames) -> pd.DataFrame:
    """Return the points of a run that were attempted."""
    attempted: pd.DataFrame = frames.points[frames.points["total_seconds"].notna()]
    return attempted


def case_endings(frames: RunFrames) -> pd.DataFrame:
    """Return the ending of each case, in the order of the cases.

    Columns: outcome (of the case if it failed, else wrong or relaxed if a point is, else unfinished or that of the
    finest attempted point), reason, and notes (of the finest point with notes).
    """
    ladders: dict[tuple[str, str], list[dict[Any, Any]]] = {}
    for point in attempted_points(frames)[[*CASE, *_POINT_COLUMNS]].to_dict("records"):  # a data frame per case is slow
        ladders.setdefault((point["problem"], point["solver"]), []).append(point)
    rows = []
    for case in frames.cases[[*CASE, "outcome", "reason", "model", "is_tried"]].to_dict("records"):
        ladder = ladders.get((case["problem"], case["solver"]), [])
        last = next((point for point in reversed(ladder) if point["notes"] != ""), None)
        rows.append((*_ending(case, ladder), f"{_prefix(last)}{last['notes']}" if last else ""))
    return pd.DataFrame(rows, columns=["outcome", "reason", "notes"], index=frames.cases.index)


def join_texts(reason: str, notes: str) -> str:
    """Join the reason and the notes of a case or point, and omit the tolerance of the notes if the reason has it."""
    prefix, separator, notes_without_prefix = notes.partition(": ")
    has_prefix = separator and reason.startswith(f"{prefix}: ")
    return "; ".join(filter(None, (reason, notes_without_prefix if has_prefix else notes)))


def limit_remedies(outcomes: "pd.Series[str]", limits: Limits) -> list[str]:
    """Return a sentence for each limit that cases of a run exceeded, with the option that changes it."""
    sentences = {
        Outcome.OUT_OF_MEMORY: (f"ran out of memory at a limit of {limits.memory_bytes / 2**20:g} MiB", "--memory"),
        Outcome.TIMEOUT: (f"timed out after {limits.case_seconds:g} s", "--case-seconds"),
    }
    counts = outcomes.value_counts()
    return [
        f"{counted(int(counts[outcome]), 'case')} {text}; start a new run with a larger {option}."
        for outcome, (text, option) in sentences.items()
        if outcome in counts
    ]


def _prefix(point: dict[Any, Any]) -> str:
    """Return the beginning of a text about a point, which gives its tolerance."""
    return f"at {accuracy_tag(point['tolerance'])}: "


def _ending(case: dict[Any, Any], ladder: list[dict[Any, Any]]) -> tuple[str, str]:
    """Return the outcome of a case and the reason, from its attempted points."""
    if case["outcome"] != Outcome.MEASURED:
        return str(case["outcome"]), str(case["reason"])
    for outcome in (Outcome.WRONG, Outcome.RELAXED):
        first = next((point for point in ladder if point["outcome"] == outcome), None)
        if first is not None:
            if first["status"] == Status.INFEASIBLE:
                return outcome.value, str(first["reason"])
            return outcome.value, claim_reason(outcome, first["tolerance"], case["model"], first["model_residual"])
    if not case["is_tried"]:
        reached = f"below {accuracy_tag(ladder[-1]['tolerance'])}" if ladder else "yet"
        return Outcome.UNFINISHED.value, f"not measured {reached}"
    if not ladder:
        return str(case["outcome"]), str(case["reason"])
    last = ladder[-1]
    if last["outcome"] == Outcome.SOLVED:
        return Outcome.SOLVED.value, f"to {accuracy_tag(last['tolerance'])}"
    return str(last["outcome"]), f"{_prefix(last)}{last['reason']}"
