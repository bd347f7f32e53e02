"""Without a terminal, progress is one plain line per measured item."""

import io
from pathlib import Path

import pytest
from proxbench.bench.cli.progress import RunProgress
from proxbench.bench.measure.execution.events import (
    CaseFinished,
    Event,
    PointFinished,
    ProblemPassFinished,
    ProblemStarted,
    RunStarted,
)
from rich.console import Console

REFERENCE = Path(__file__).parents[3] / "results" / "reference.bundle"

EVENTS: list[Event] = [
    RunStarted(Path("run"), 2, 0),
    ProblemStarted("hard[1]-" + 100 * "x"),
    PointFinished("hard[1]", "SORprox", 1e-2),
    CaseFinished("hard", "SORprox", "solved", 1, 2),
    ProblemPassFinished("hard", 1, 2),
]


@pytest.mark.parametrize("hidden", [False, True])
def test_a_run_names_each_problem_in_one_line(hidden: bool) -> None:
    text = io.StringIO()
    with RunProgress(hidden, Console(file=text, width=80)) as shown:
        for event in EVENTS:
            shown(event)
    assert text.getvalue() == ("" if hidden else f"measuring hard[1]-{100 * 'x'}\n")


def test_a_terminal_shows_the_name_of_what_is_measured() -> None:
    text = io.StringIO()
    with RunProgress(console=Console(file=text, force_terminal=True, width=200)) as shown:
        shown(ProblemStarted("hard[1]"))
    assert "hard[1]" in text.getvalue()


@pytest.mark.slow
def test_a_terminal_shows_how_many_are_done_and_the_table_of_the_last_problem() -> None:
    text = io.StringIO()
    with RunProgress(console=Console(file=text, force_terminal=True, width=120)) as shown:
        shown(RunStarted(REFERENCE, 8, 0))
        shown(ProblemPassFinished("funnel-100", 1, 8))
    assert "1/8" in text.getvalue()
    assert "funnel-100 · 122 contacts" in text.getvalue()
    assert "SafeguardedSORprox" in text.getvalue()
    assert "funnel-1000" not in text.getvalue()


def test_a_study_shows_its_work_and_counts_its_points_from_the_start() -> None:
    text = io.StringIO()
    with RunProgress(console=Console(file=text, force_terminal=True, width=120)) as shown:
        shown(RunStarted(Path("run"), 2, 0, points=7, points_done=2, work="7 points, 35 simulations"))
        shown(ProblemStarted("bouncing_ball"))
        shown(PointFinished("bouncing_ball", "Moreau with SORprox", 1e-3))
    assert "remaining: 7 points, 35 simulations" in text.getvalue()
    assert "3/7" in text.getvalue()
    assert "/?" not in text.getvalue().split("remaining")[1]


def test_remaining_time_is_estimated_for_points_that_take_minutes() -> None:
    now = [0.0]
    shown = RunProgress(console=Console(file=io.StringIO(), force_terminal=True, width=160))
    shown.get_time = lambda: now[0]
    shown(RunStarted(Path("run"), 2, 0, points=5, work="5 points, 5 simulations"))
    for minutes in (0.0, 5.0, 10.0):
        now[0] = 60.0 * minutes
        shown(PointFinished("bouncing_ball", "Moreau with SORprox", 1e-3))
    assert shown.tasks[0].time_remaining == 600.0
