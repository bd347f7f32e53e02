"""Every cheat of the catalogue ends as the table in decision 14 says, and honest solvers as they should."""

from pathlib import Path

import pytest
from catalogue import CHEATS, LADDER, NOT_CAUGHT, Cheat, table
from cheating_solvers import Honest
from proxbench.bench.store.notes import notes_of
from proxbench.bench.store.outcome import FAULTS, Outcome

DECISION = Path(__file__).parents[3] / "docs" / "decisions" / "0014-nothing-spoils-a-run.md"

LEAST = 24
"""Cheats that the suite has at least."""


TRIES = 3
"""Runs of a cheat, of which one must end as the table says: rounds in which other tests use the core do not count."""


@pytest.mark.parametrize("name", CHEATS)
def test_a_cheat_ends_as_the_table_says(name: str, tmp_path: Path) -> None:
    cheat = CHEATS[name]
    outcome, _, words = cheat.verdict.partition(": ")
    for number in range(TRIES):
        folder = tmp_path / str(number)
        folder.mkdir()
        case = cheat.tried(folder)
        if outcome in (case.outcome, *(point.outcome for point in case.points)):
            break
    if outcome in (*FAULTS, Outcome.UNSUPPORTED):
        assert case.outcome == outcome, case.reason
        assert words in case.reason
        assert case.points == []
    else:
        assert outcome in [point.outcome for point in case.points], case.reason
        texts = [f"{point.reason}; {notes_of(case, point)}" for point in case.points]
        assert words in ("gains nothing", "not caught") or any(words in text for text in texts), texts


def test_answers_on_disk_are_noticed_in_the_second_run_too(tmp_path: Path) -> None:
    cases = [CHEATS["OnDisk"].tried(tmp_path) for _ in range(2)]
    assert [case.outcome for case in cases] == [Outcome.MISBEHAVED, Outcome.MISBEHAVED]


@pytest.mark.parametrize("problem", ["hard-sticking-box", "funnel-100", "funnel-1000"])
def test_an_honest_solver_is_accused_of_nothing(problem: str, tmp_path: Path) -> None:
    case = Cheat("solves", "solved", lambda folder: Honest(), problem).tried(tmp_path)
    assert [point.outcome for point in case.points] == [Outcome.SOLVED] * len(LADDER), case.reason
    assert [point.reason for point in case.points] == [""] * len(LADDER)


def test_the_decision_shows_the_whole_suite_and_what_is_missed() -> None:
    assert len(CHEATS) >= LEAST
    assert table() in DECISION.read_text(encoding="utf-8")
    assert not any(cheat.verdict == NOT_CAUGHT for cheat in CHEATS.values())
