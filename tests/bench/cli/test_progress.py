"""Progress is a plain line for each thing that is measured, where there is no terminal to draw a bar on."""

import io
from pathlib import Path

import pytest
from proxbench.bench.cli.progress import RunProgress
from proxbench.bench.measure.runner import CaseFinished, Event, ProblemStarted, RunStarted
from proxbench.bench.study.live import StudyProgress
from proxbench.bench.study.study import Study
from rich.console import Console

from ..study.conftest import fixed_case, toy_case, toy_plan

EVENTS: list[Event] = [
    RunStarted(Path("run"), 2, 0),
    ProblemStarted("hard[1]-" + 100 * "x"),
    CaseFinished("hard", "SORprox", "solved", 1, 2),
]


@pytest.mark.parametrize("hidden", [False, True])
def test_a_run_names_each_problem_in_one_line(hidden: bool) -> None:
    text = io.StringIO()
    with RunProgress(Console(file=text, width=80), hidden) as shown:
        for event in EVENTS:
            shown(event)
    assert text.getvalue() == ("" if hidden else f"measuring hard[1]-{100 * 'x'}\n")


def test_a_study_names_a_case_once_for_members_that_follow_each_other() -> None:
    text = io.StringIO()
    first, second = fixed_case(100, members=(0.99, 1.0)), toy_case()
    study = Study(toy_plan(first, second))
    with StudyProgress(Console(file=text)) as shown:
        for case in (first, first, second):
            shown(study, case)
    lines = text.getvalue().splitlines()
    assert [line.split(",")[0] for line in lines] == [f"measuring {first.series}", f"measuring {second.series}"]


def test_a_terminal_shows_the_name_and_how_many_are_done() -> None:
    text = io.StringIO()
    with RunProgress(Console(file=text, force_terminal=True, width=200)) as shown:
        for event in EVENTS:
            shown(event)
    assert "hard[1]" in text.getvalue()
    assert "1/2" in text.getvalue()
