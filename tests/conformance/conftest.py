"""Shared fixture: conformance checks copy hard cases instead of building them again."""

from functools import cache

import pytest
from proxbench.bench.conformance import hard_checks, repetition_checks, samples
from proxbench.problems import ContactProblem
from proxbench.problems.hard import hard_case


@cache
def _built_case(name: str) -> ContactProblem:
    return hard_case(name)


def case_copy(name: str) -> ContactProblem:
    """Return a copy of a hard case, in a fraction of the time that it takes to build it."""
    return _built_case(name).fresh()


@pytest.fixture(autouse=True)
def _copied_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (samples, hard_checks, repetition_checks):
        monkeypatch.setattr(module, "hard_case", case_copy)
