"""Endings of cases are described in words."""

import pandas as pd
import pytest
from proxbench.bench.report.endings import join_texts, limit_remedies
from proxbench.bench.store.plans import Limits


@pytest.mark.parametrize(
    ("reason", "notes", "expected"),
    [
        ("at 1e-06: too slow", "at 1e-06: 2 answers; not steady", "at 1e-06: too slow; 2 answers; not steady"),
        ("at 1e-06: too slow", "at 1e-04: 2 answers", "at 1e-06: too slow; at 1e-04: 2 answers"),
        ("to 1e-06", "at 1e-06: 2 answers", "to 1e-06; at 1e-06: 2 answers"),
        ("at 1e-06: too slow", "", "at 1e-06: too slow"),
        ("", "at 1e-06: 2 answers", "at 1e-06: 2 answers"),
        ("", "", ""),
    ],
)
def test_reason_and_notes_of_one_point_name_its_tolerance_once(reason: str, notes: str, expected: str) -> None:
    assert join_texts(reason, notes) == expected


def test_cases_that_exceed_a_limit_are_counted_with_the_option_that_changes_it() -> None:
    outcomes = pd.Series(["out of memory", "solved", "out of memory", "timeout"])
    limits = Limits(case_seconds=2.5, memory_bytes=3 * 2**20)
    assert limit_remedies(outcomes, limits) == [
        "2 cases ran out of memory at a limit of 3 MiB; start a new run with a larger --memory.",
        "1 case timed out after 2.5 s; start a new run with a larger --case-seconds.",
    ]
    assert not limit_remedies(outcomes[1:2], limits)
