"""A table of switching points, and a comparison of periods with the known limit cycle of a scene."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ....problems.motion.trajectories.limit_cycle import Cycle, CycleSequence, SwitchEvent, find_cycles
from ...report.layout.text import counted
from ..simulation import Simulation

MAX_ROWS = 30
"""Largest number of printed switching points without known periods; the result file contains all."""

_TEXT_HEADS = ("law", "contact", "from", "to")
"""Heads of text columns."""

_LEFT = {*_TEXT_HEADS, "stepper", "solver", "start"}
"""Heads of left-aligned columns."""

_HEADS = ("row", *_TEXT_HEADS, "t [s]")
"""Heads of the columns of every table of switching points."""


def print_switches(simulation: Simulation, console: Console) -> None:
    """Print the switching points: those of a period with the limit cycle, or else the first ones."""
    motion = _motion(simulation)
    published = [] if motion is None else [number for number, cycle in enumerate(motion.cycles) if cycle.is_published]
    if motion is not None and published:
        last = published[-1]  # the last period that is comparable with the limit cycle
        console.print(Text(f"complete period {last + 1} of {len(motion.cycles)}, as in {motion.known.source}"))
        console.print(_published_table(motion.cycles[last], simulation.plan.scene.contact_names))
    elif len(simulation.switches):
        console.print(_switches_table(simulation.switch_events, simulation.plan.scene.contact_names))


def periods_document(simulation: Simulation) -> dict[str, Any] | None:
    """Return the periods as JSON values; None without a known limit cycle."""
    motion = _motion(simulation)
    if motion is None:
        return None
    return {
        "count": motion.count,
        "published": motion.published_count,
        "complete": len(motion.cycles),
        "periods": np.diff(motion.sections).tolist(),
        "descents": (-np.diff(motion.heights)).tolist(),
    }


def period_lines(simulation: Simulation) -> Iterator[tuple[str, str]]:
    """Yield the lines about periods, each with its style."""
    motion = _motion(simulation)
    if motion is None:
        return
    known = motion.known
    section = f"row {known.section + 1}"
    if not motion.cycles:
        yield f"no complete period yet, from row 1 of {known.source} to the next row 1", ""
    else:
        n_published = motion.published_count
        count_text = (
            f"{n_published} of {counted(len(motion.cycles), 'complete period')}, from row 1 to the next row 1, "
        )
        points = f"the {len(known.switch_events)} switching points of {known.source} in its order"
        yield f"{count_text}{'has' if n_published == 1 else 'have'} {points}", ""
    if not motion.count:
        yield f"the section, {section}, was not crossed twice, so there is no time from section to section", ""
        return
    last = max(1, motion.count - known.transient)
    periods_text = f"{_periods_text(last, motion.count)}, from section to section: {section} to the next {section}"
    yield f"period   {motion.mean_period(last):.12f} s  ({periods_text})", ""
    yield f"descent  {motion.mean_descent(last):.12f} m", ""
    if known.matches_scene_options:
        period, descent = motion.relative_deviations(last)
        deviations = f"relative errors {period:+.1e} and {descent:+.1e}"
        yield f"limit cycle {known.period:.12f} s and {known.descent:.12f} m: {deviations}", "bold"


def _periods_text(last: int, count: int) -> str:
    """Return the periods of a mean, in words."""
    single = f"the last of {count}" if count > 1 else "the only one"
    return f"mean of the last {last} of {count}" if last > 1 else single


def _motion(simulation: Simulation) -> CycleSequence | None:
    """Return the periods; None for scenes without a known limit cycle, or without located switching points."""
    known = simulation.plan.scene.limit_cycle
    if known is None or not simulation.plan.stepper.locates_switches:
        return None
    return find_cycles(known, simulation.switch_events, simulation.times, simulation.trajectory[:, 0])


def _published_table(cycle: Cycle, names: Sequence[str]) -> Table:
    """Return one period in the form of the published table, with the limit cycle."""
    table = plain_table(*_HEADS, "after section [s]", "limit cycle [s]", "off by [s]")
    rows = zip(cycle.switch_events, cycle.known.switch_events, cycle.deviations, strict=True)
    for number, (event, reference, deviation) in enumerate(rows, start=1):
        table.add_row(
            str(number),
            *_switch_cells(event, names),
            f"{event.time:.9f}",
            f"{event.time - cycle.section:+.9f}",
            f"{reference.time:+.9f}",
            f"{deviation:+.1e}",
        )
    return table


def _switches_table(switches: list[SwitchEvent], names: Sequence[str]) -> Table:
    """Return a table of the first ``MAX_ROWS`` switching points."""
    table = plain_table(*_HEADS)
    for number, event in enumerate(switches[:MAX_ROWS], start=1):
        table.add_row(str(number), *_switch_cells(event, names), f"{event.time:.9f}")
    if len(switches) > MAX_ROWS:
        table.add_row("…", f"{len(switches) - MAX_ROWS} more", "", "", "", "")
    return table


def plain_table(*headings: str) -> Table:
    """Return a table without rows; words are aligned to the left, numbers to the right."""
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, 1, 0, 0))
    for heading in headings:  # a string would be parsed as markup
        table.add_column(Text(heading), justify="left" if heading in _LEFT else "right", no_wrap=True)
    return table


def _switch_cells(event: SwitchEvent, names: Sequence[str]) -> tuple[str, str, str, str]:
    """Return the law and contact that switch; contacts with names are counted from 1."""
    contact = f"{event.contact + 1} {names[event.contact]}" if names else str(event.contact)
    return event.law, contact, event.before, event.after
