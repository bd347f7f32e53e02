"""Every cheat of the catalogue ends as the table in decision 14 says, and honest solvers as they should."""

from pathlib import Path

import pytest
from catalogue import LADDER, VERDICTS, make_cheat, measured
from cheating_solvers import ANSWERS, Honest
from proxbench.bench.store.notes import notes_of
from proxbench.bench.store.outcome import FAULTS, Outcome
from tampering_solvers import CHANGES

TRIES = 3
"""Runs of a cheat, of which one must end as the table says: rounds in which other tests use the core do not count."""

NAMED = "named"
"""Verdict on a cheat that is accused or noted, as most of its control solves are undisturbed or preempted."""

FAMILIES = {"OnBox", "Answering", "Tampering", "Changing", "Hiding"}
"""Classes that are no cheats of their own."""


@pytest.mark.parametrize("name", VERDICTS)
def test_a_cheat_ends_as_the_table_says(name: str, tmp_path: Path) -> None:
    outcome, _, words = VERDICTS[name].partition(": ")
    for number in range(TRIES):
        folder = tmp_path / str(number)
        folder.mkdir()
        case = measured(make_cheat(name, folder))
        texts = [f"{point.reason}; {notes_of(case, point)}" for point in case.points]
        is_named = outcome == NAMED and any(words in text for text in [case.reason, *texts])
        if is_named or outcome in (case.outcome, *(point.outcome for point in case.points)):
            break
    if outcome == NAMED:
        assert is_named, [case.reason, *texts]
    elif outcome in (*FAULTS, Outcome.UNSUPPORTED):
        assert case.outcome == outcome, case.reason
        assert words in case.reason
        assert case.points == []
    else:
        assert outcome in [point.outcome for point in case.points], case.reason
        assert words in ("gains nothing", "") or any(words in text for text in texts), texts


@pytest.mark.parametrize("problem", ["hard-sticking-box", "funnel-100", "funnel-1000"])
def test_an_honest_solver_is_accused_of_nothing(problem: str) -> None:
    case = measured(Honest(), problem)
    assert [point.outcome for point in case.points] == [Outcome.SOLVED] * len(LADDER), case.reason
    assert [point.reason for point in case.points] == [""] * len(LADDER)


def subclasses(kind: type) -> set[str]:
    return {kind.__name__}.union(*map(subclasses, kind.__subclasses__()))


def test_the_table_has_every_cheat() -> None:
    assert VERDICTS.keys() == (subclasses(Honest) - {"Honest"} - FAMILIES) | ANSWERS.keys() | CHANGES.keys()
