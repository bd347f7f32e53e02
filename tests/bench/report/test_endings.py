"""Endings of cases as texts."""

import pytest
from proxbench.bench.report.endings import join_texts


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
