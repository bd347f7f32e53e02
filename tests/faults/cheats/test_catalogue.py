"""Every cheat of the catalogue ends as the table in decision 14 states, and honest solvers are not accused."""

from pathlib import Path
from typing import Any

import pytest
from catalogue import LADDER, VERDICTS, make_cheat, measured
from cheating_solvers import ANSWERS, Honest
from proxbench.bench.store.notes import notes_of
from proxbench.bench.store.outcome import FAULTS, Outcome
from proxbench.bench.store.records import CaseRecord
from tampering_solvers import CHANGES

TRIES = 8
"""Number of runs of a cheat; one of them must end as the table states. In half of the runs, copies reveal nothing: they
are random, and the first one that the solver does not solve ends their comparison."""

SPREAD = 1.15
"""Largest ratio of two times of the same work at which the machine is steady enough to reveal the gain of a cheat."""

COMPARED = (
    "first solves",
    "copies of the problem",
    "it repeats answers instead of solving",
    "reach the time limit",
)
"""Words of the verdicts that compare the times of undisturbed solves."""

ALONE = (*COMPARED, "its own clock explains", "gains nothing", "it changed the cores")
"""Words of the verdicts that depend on times, or on cores that no other program uses."""

NAMED = "named"
"""Verdict on a cheat that is either accused or noted, depending on whether its control solves are preempted."""

FAMILIES = {"OnBox", "Answering", "Tampering", "Changing", "Hiding"}
"""Base classes that are not cheats themselves."""


ONE_OF_EACH_KIND = {
    *("WhateverUnits", "Miscounting", "WhateverOrder", "Carrying", "SlowClock", "OtherCoresMeanwhile"),
    *("WhenCollecting", "KnowsCopies", "Choosy", "AheadInBareThread", "Orphaning", "ReplacingSorted"),
    *("SometimesZero", "Lazy", "LateInPrepare", "Hopeless"),
}
"""One cheat for each rule that detects cheats; the other cheats are weekly."""


def with_marks(name: str) -> Any:
    """Return a cheat as a parameter."""
    marks = [pytest.mark.alone] if VERDICTS[name].endswith(ALONE) else []
    return pytest.param(name, marks=marks if name in ONE_OF_EACH_KIND else [*marks, pytest.mark.weekly])


@pytest.mark.parametrize("name", [with_marks(name) for name in VERDICTS])
def test_each_cheat_gets_the_verdict_in_the_table(name: str, tmp_path: Path) -> None:
    outcome, _, words = VERDICTS[name].partition(": ")
    differences, is_judged = [], words not in COMPARED
    for number in range(TRIES):
        folder = tmp_path / str(number)
        folder.mkdir()
        cheat = make_cheat(name, folder)
        differences.append(difference(measured(cheat), outcome, words))
        if not differences[-1]:
            return
        is_judged = is_judged or is_steady(cheat.tried_on)
    if not is_judged:
        pytest.skip("the times of an honest solver varied as well")
    pytest.fail("\n".join(differences))


def is_steady(problem: str) -> bool:
    """Return whether first solves of an honest solver take as long as its repeated ones, at every tolerance."""
    known = [point.measured for point in measured(Honest(), problem).points if point.measured is not None]
    firsts = [(found.total_seconds.min, found.first_seconds) for found in known if not found.is_excluded]
    return bool(firsts) and all(first and max(first) < SPREAD * least for least, first in firsts)


def difference(case: CaseRecord, outcome: str, words: str) -> str:
    """Return how a case ends if it does not end with ``outcome`` and ``words``; empty if it does."""
    outcomes = [point.outcome for point in case.points]
    texts = [f"{point.reason}; {notes_of(case, point)}" for point in case.points]
    if outcome == NAMED:
        is_as_told = any(words in text for text in [case.reason, *texts])
    elif outcome in (*FAULTS, Outcome.UNSUPPORTED):
        is_as_told = case.outcome == outcome and words in case.reason and not case.points
    else:
        is_as_told = outcome in outcomes and (words in ("gains nothing", "") or any(words in text for text in texts))
    return "" if is_as_told else f"{case.outcome}: {case.reason}; {[*map(str, outcomes)]}; {texts}"


@pytest.mark.alone
@pytest.mark.parametrize(
    "problem",
    [
        pytest.param("hard-sticking-box", marks=pytest.mark.weekly),
        "funnel-100",
        pytest.param("funnel-1000", marks=pytest.mark.weekly),
    ],
)
def test_an_honest_solver_is_judged_solved_without_remarks(problem: str) -> None:
    case = measured(Honest(), problem)
    assert [point.outcome for point in case.points] == [Outcome.SOLVED] * len(LADDER), case.reason
    assert [point.reason for point in case.points] == [""] * len(LADDER)


def subclasses(kind: type) -> set[str]:
    return {kind.__name__}.union(*map(subclasses, kind.__subclasses__()))


def test_the_table_has_every_cheat() -> None:
    assert VERDICTS.keys() == (subclasses(Honest) - {"Honest"} - FAMILIES) | ANSWERS.keys() | CHANGES.keys()
