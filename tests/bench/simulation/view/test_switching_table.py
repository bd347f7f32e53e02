"""The printed summary states numbers of periods, sections and switching points, in the singular or plural."""

import io

import numpy as np
import pytest
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.simulation import LAW_STATES, LAWS, SWITCH, Simulation
from proxbench.bench.simulation.step_row import step_columns
from proxbench.bench.simulation.view.table import print_simulation
from proxbench.problems.motion.scenes.woodpecker import DESCENT, PERIOD, SWITCH_EVENTS
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.step import LawStates
from rich.console import Console


def pecking(periods: float, residual: float = 0.0, first: int = 0, extra: tuple[int, ...] = ()) -> Simulation:
    """Return a motion along the limit cycle from row ``first`` + 1; periods in ``extra`` have one more switch."""
    simulation = Simulation(make_simulation_plan("woodpecker", duration=(periods + 2.0) * PERIOD))
    rows = []
    count = round(periods * len(SWITCH_EVENTS))
    for number in range(first, first + count):
        period, row = divmod(number, len(SWITCH_EVENTS))
        one = SWITCH_EVENTS[row]
        time, states = one.time + 0.05 + period * PERIOD, (LAW_STATES.index(one.before), LAW_STATES.index(one.after))
        switch = (time, time, LAWS.index(one.law), one.contact, *states)
        rows += [switch] * (2 if period in extra and row == 6 else 1)
    steps = np.zeros(len(rows) + 1, dtype=step_columns(simulation.plan.scene))
    steps["time"], steps["length"] = [*(row[0] for row in rows), simulation.plan.until], 1e-3
    steps["residual"][0] = residual
    states = [State(time, np.array([-DESCENT / PERIOD * time, 0.0, 0.0]), np.zeros(3)) for time in steps["time"]]
    simulation.kept_states.restore(states, [True] * len(states), 0)
    simulation.restore(steps, states[-1], np.array(rows, dtype=SWITCH), LawStates())
    return simulation


def printed(simulation: Simulation) -> str:
    console = Console(file=io.StringIO(), width=120)
    print_simulation(simulation, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert isinstance(text, str)
    return text


def test_the_table_says_which_period_it_shows_and_the_mean_which_times_it_is_of() -> None:
    text = printed(pecking(2.25))
    assert "complete period 2 of 2, as in table 1 of the paper\n" in text
    assert (
        "2 of 2 complete periods, from row 1 to the next row 1, have the 12 switching points of table 1 of the paper"
        in text
    )
    assert "(the last of 2, from section to section: row 2 to the next row 2)" in text
    assert "27 switching points at 21 instants\n" in text


def test_a_single_time_between_sections_is_not_called_a_mean() -> None:
    text = printed(pecking(1.25))
    assert "complete period 1 of 1" in text
    assert "(the only one, from section to section: row 2 to the next row 2)" in text


def test_there_may_be_more_times_between_sections_than_complete_periods() -> None:
    text = printed(pecking(2 + 1 / 12, first=1))  # from row 2 to row 2 of the period after the next
    assert "1 of 1 complete period, from row 1 to the next row 1, has the 12" in text
    assert "(the last of 2, from section to section" in text


def test_the_mean_leaves_out_the_transient() -> None:
    assert "(mean of the last 3 of 63, from section to section" in printed(pecking(63.25))


def test_a_period_of_other_switching_points_is_not_shown() -> None:
    text = printed(pecking(3.25, extra=(2,)))
    assert "complete period 2 of 3, as in table 1 of the paper\n" in text
    assert "2 of 3 complete periods, from row 1 to the next row 1, have" in text
    assert "40 switching points at 30 instants" in text


@pytest.mark.parametrize(
    ("periods", "complete"), [(0.5, "no complete period yet, from row 1"), (1 + 1 / 12, "1 of 1 complete period,")]
)
def test_complete_periods_and_times_from_section_to_section_are_distinguished(periods: float, complete: str) -> None:
    text = printed(pecking(periods))
    assert complete in text
    assert "was not crossed twice, so there is no time from section to section" in text


def test_message_about_one_unsolved_step_is_singular() -> None:
    assert "1 of 13 steps is not solved to 1e-12; largest residual 1.0e-03" in printed(pecking(1.0, residual=1e-3))


def test_motion_without_switching_points_has_no_table() -> None:
    text = printed(pecking(0.0))
    assert "no switching points\n" in text
    assert "law" not in text.replace("laws", "")
