"""Switching points as a table, and the periods of the woodpecker beside its known limit cycle."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ....problems.motion.scenes.registry import SCENES
from ....problems.motion.scenes.woodpecker import DESCENT, INCIDENTS, PERIOD
from ....problems.motion.trajectories.limit_cycle import Cycle, Cycles, Incident, cycles, relative_deviations
from ...report.layout.text import counted
from ..trajectory import Simulation

MOST_ROWS = 30
"""Switching points that are printed where no period is known; the result file has all."""

TRANSIENT = 60
"""Periods after which the woodpecker is taken to be on its limit cycle: 0.839 to this power is 3e-5."""

_OF_WORDS = ("law", "contact", "from", "to")
"""Heads of columns of words."""

_LEFT = {*_OF_WORDS, "stepper", "solver", "start"}
"""Heads of columns that stand on the left."""

_HEADS = ("row", *_OF_WORDS, "t [s]")

CONTACTS = {0: "beak", 1: "lower edge", 2: "upper edge"}
"""What the woodpecker's contacts are called; the paper counts them from 1."""


def print_switches(simulation: Simulation, console: Console) -> None:
    """Print the switching points: those of a period beside the limit cycle, or else the first ones."""
    motion = _motion(simulation)
    found = [] if motion is None else [number for number, cycle in enumerate(motion.cycles) if cycle.is_published]
    if motion is not None and found:
        shown = found[-1]  # the last one that can be set beside the limit cycle
        console.print(Text(f"complete period {shown + 1} of {len(motion.cycles)}, as table 1 of the paper"))
        console.print(_published_table(motion.cycles[shown]))
    elif len(simulation.switches):
        console.print(_switches_table(simulation.incidents, is_toy=motion is not None))


def periods_document(simulation: Simulation) -> dict[str, Any] | None:
    """Return the periods as values that JSON can write, None where none are known."""
    motion = _motion(simulation)
    if motion is None:
        return None
    return {
        "count": motion.count,
        "published": sum(cycle.is_published for cycle in motion.cycles),
        "complete": len(motion.cycles),
        "periods": np.diff(motion.sections).tolist(),
        "descents": (-np.diff(motion.heights)).tolist(),
    }


def period_lines(simulation: Simulation) -> Iterator[tuple[str, str]]:
    """Yield what is to be said of the periods, each line with its style."""
    motion = _motion(simulation)
    if motion is None:
        return
    if not motion.cycles:
        yield "no complete period, from row 1 of table 1 to the next row 1, yet", ""
    else:
        good = sum(cycle.is_published for cycle in motion.cycles)
        many = f"{good} of {counted(len(motion.cycles), 'complete period')}, from row 1 to the next row 1, "
        yield f"{many}{'has' if good == 1 else 'have'} the twelve switching points of table 1 in its order", ""
    if not motion.count:
        yield "the section, row 2 of table 1, is not met twice yet, so there is no time from section to section", ""
        return
    last = max(1, motion.count - TRANSIENT)
    yield f"period   {motion.mean_period(last):.12f} s  ({_about(last, motion.count)})", ""
    yield f"descent  {motion.mean_descent(last):.12f} m", ""
    scene, known = simulation.plan.scene, SCENES["woodpecker"].options
    # other options have another limit cycle
    if all(scene.options[name] == option.default for name, option in known.items() if name != "start"):
        period, descent = relative_deviations(motion, last)
        off = f"off by {period:+.1e} and {descent:+.1e}, relatively"
        yield f"limit cycle {PERIOD:.12f} s and {DESCENT:.12f} m: {off}", "bold"


def _about(last: int, count: int) -> str:
    """Return which times from section to section a mean is of."""
    one = f"the last of {count}" if count > 1 else "the only one"
    some = f"mean of the last {last} of {count}" if last > 1 else one
    return f"{some}, from section to section: row 2 to the next row 2"


def _motion(simulation: Simulation) -> Cycles | None:
    """Return the periods of the woodpecker, None for other scenes and where no switching points are looked for."""
    if simulation.plan.scene.name != "woodpecker" or not simulation.plan.stepper.locates_switches:
        return None
    return cycles(simulation.incidents, simulation.times, simulation.trajectory[:, 0])


def _published_table(cycle: Cycle) -> Table:
    """Return one period in the form of table 1 of the paper, beside the limit cycle."""
    table = plain_table(*_HEADS, "after section [s]", "limit cycle [s]", "off by [s]")
    rows = zip(cycle.incidents, INCIDENTS, cycle.deviations, strict=True)
    for number, (incident, reference, deviation) in enumerate(rows, start=1):
        table.add_row(
            str(number),
            *_words(incident),
            f"{incident.time:.9f}",
            f"{incident.time - cycle.section:+.9f}",
            f"{reference[0]:+.9f}",
            f"{deviation:+.1e}",
        )
    return table


def _switches_table(found: list[Incident], is_toy: bool) -> Table:
    table = plain_table(*_HEADS)
    for number, incident in enumerate(found[:MOST_ROWS], start=1):
        words = _words(incident) if is_toy else (incident.law, str(incident.contact), incident.before, incident.after)
        table.add_row(str(number), *words, f"{incident.time:.9f}")
    if len(found) > MOST_ROWS:
        table.add_row("…", f"{len(found) - MOST_ROWS} more", "", "", "", "")
    return table


def plain_table(*heads: str) -> Table:
    """Return a table without rows; words stand on the left of their columns, numbers on the right."""
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, 1, 0, 0))
    for head in heads:  # as text: a string would be read as markup
        table.add_column(Text(head), justify="left" if head in _LEFT else "right", no_wrap=True)
    return table


def _words(incident: Incident) -> tuple[str, str, str, str]:
    return incident.law, f"{incident.contact + 1} {CONTACTS[incident.contact]}", incident.before, incident.after
