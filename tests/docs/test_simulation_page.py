"""The pages about simulations show the output of the program, and the options of steppers."""

import inspect
import io
import re
from pathlib import Path

import pytest
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.simulation import Simulation
from proxbench.bench.simulation.view.table import print_simulation
from proxbench.problems.motion.scenes.registry import SCENES, make_scene
from proxbench.problems.motion.scenes.woodpecker import SWITCH_EVENTS
from proxbench.problems.motion.stepping.registry import STEPPERS
from proxbench.problems.motion.stepping.switch_search import SEARCHES
from rich.console import Console

HOW_TO = Path(__file__).resolve().parents[2] / "docs" / "how-to"
PAGE = "\n".join(
    (HOW_TO / name).read_text(encoding="utf-8") for name in ("simulate-a-scene.md", "locate-switching-points.md")
)


def options_table() -> dict[str, list[str]]:
    """Return the cells of each option in the table of the page."""
    found = re.findall(r"^\| `(\w+)` \| (.+) \| (.+) \| (.+) \|$", PAGE, re.MULTILINE)
    return {name: cells for name, *cells in found}


VARIABLE = ("Extrapolated", "StepDoubling")


@pytest.mark.parametrize("column", range(len(VARIABLE)), ids=VARIABLE)
def test_every_option_of_a_variable_stepper_is_listed_with_its_default(column: int) -> None:
    kind = STEPPERS[VARIABLE[column]]
    defaults = {name: repr(option.default) for name, option in inspect.signature(kind).parameters.items()}
    shown = {name: cells[1 + column] for name, cells in options_table().items()}
    assert {name: default for name, default in shown.items() if default != "–"} == defaults


@pytest.mark.parametrize("name", [name for name in STEPPERS if name not in VARIABLE])
def test_every_other_stepper_and_its_options_are_named(name: str) -> None:
    assert f"| `{name}" in PAGE
    assert all(option in PAGE for option in inspect.signature(STEPPERS[name]).parameters)


def test_every_search_and_the_longest_steps_are_named() -> None:
    table = options_table()
    assert re.findall(r"`'(\w+)'`", table["search"][0]) == list(SEARCHES)
    assert "`None`: 0.002 for the funnel and the pile, 0.02 for other scenes" in table["max_step"][0]
    longest_steps = {name: make_scene(name).longest_step for name in SCENES}
    assert longest_steps == {name: 2e-3 if name in ("funnel", "pile") else 2e-2 for name in SCENES}


def test_the_columns_of_a_pour_are_those_that_are_printed() -> None:
    simulation = Simulation(make_simulation_plan("funnel", {"balls": 1}))
    console = Console(file=io.StringIO(), width=120)
    print_simulation(simulation, console)
    head = console.file.getvalue().splitlines()[2]  # type: ignore[attr-defined]
    (shown,) = (line for line in PAGE.splitlines() if line.startswith(" t [s]"))
    only_if_hidden = "local"  # shown if a step has fast contacts that hide the violations of others
    assert only_if_hidden in shown.split()
    assert [word for word in shown.split() if word != only_if_hidden] == head.split()


def test_the_sample_of_the_woodpecker_is_its_limit_cycle() -> None:
    rows = re.findall(
        r"^ +(\d+)  (\w+) +(\d) \w+(?: edge)? +(\w+) +(\w+) .* ([+-][\d.]+) +[+-]\d\.\de[+-]\d\d$", PAGE, re.M
    )
    shown = [(law, int(contact) - 1, before, after, time) for _, law, contact, before, after, time in rows]
    assert [int(number) for number, *_ in rows] == [*range(1, len(SWITCH_EVENTS) + 1)]
    assert shown == [(one.law, one.contact, one.before, one.after, f"{one.time:+.9f}") for one in SWITCH_EVENTS]
    assert """"woodpecker(start='cycle')" --duration 0.35""" in PAGE
    assert "\ntotal  0.35 s in " in PAGE
