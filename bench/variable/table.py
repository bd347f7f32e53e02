"""What a simulation with variable steps came to: its switching points as a table, its periods, its cost."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...problems.scenes.registry import SCENES
from ...problems.scenes.woodpecker import DESCENT, INCIDENTS, PERIOD
from ..report.text import counted, unsolved_words
from ..simulation.trajectory import SLACK
from .incidents import Cycle, Cycles, Incident, cycles, incidents, relative_deviations, switching_words
from .simulation import VariableSimulation

MOST_ROWS = 30
"""Switching points that are printed where no period is known; the result file has all."""

TRANSIENT = 60
"""Periods after which the woodpecker is taken to be on its limit cycle: 0.839 to this power is 3e-5."""

CONTACTS = {0: "beak", 1: "lower edge", 2: "upper edge"}
"""What the woodpecker's contacts are called; the paper counts them from 1."""


def print_variable(simulation: VariableSimulation, console: Console) -> None:
    """Print switching points, periods and cost."""
    plan = simulation.plan
    head = f"{plan.scene.name} · {plan.stepper.name} · {plan.solver.name}"
    console.print(Text(head, style="bold"))
    motion = cycles(simulation) if plan.scene.name == "woodpecker" else None
    found = incidents(simulation)
    shown = _shown(motion) if motion else None
    if motion is not None and shown is not None:
        console.print(Text(f"complete period {shown + 1} of {len(motion.cycles)}, as table 1 of the paper"))
        console.print(_published_table(motion.cycles[shown]))
    elif found:
        console.print(_plain_table(found, simulation))
    console.print(Text(switching_words(found)))
    lines = [*_period_lines(motion, _is_reference(simulation)), *_cost_lines(simulation)] if motion else []
    for text, style in lines or _cost_lines(simulation):
        console.print(Text(text, style=style))


def variable_document(simulation: VariableSimulation) -> dict[str, Any]:
    """Return plan, cost, switching points and periods as values that JSON can write."""
    motion = cycles(simulation) if simulation.plan.scene.name == "woodpecker" else None
    found = [
        {"begin": float(row["begin"]), "end": float(row["end"]), **asdict(incident)}
        for row, incident in zip(simulation.switches, incidents(simulation), strict=True)
    ]
    periods = None
    if motion is not None:
        periods = {
            "count": motion.count,
            "published": sum(cycle.is_published for cycle in motion.cycles),
            "complete": len(motion.cycles),
            "periods": np.diff(motion.sections).tolist(),
            "descents": (-np.diff(motion.heights)).tolist(),
        }
    return {
        "file": None if simulation.file is None else str(simulation.file),
        "plan": simulation.plan.document(),
        "summary": variable_summary(simulation),
        "incidents": found,
        "periods": periods,
    }


def variable_summary(simulation: VariableSimulation) -> dict[str, Any]:
    """Return what the simulation cost, as plain values."""
    steps, plan = simulation.steps, simulation.plan
    missed = steps["residual"] > SLACK * plan.tolerance
    return {
        "finished": simulation.is_finished,
        "failure": None if simulation.failure is None else simulation.failure.what,
        "simulated_seconds": simulation.state.time - plan.scene.start.time,
        "wall_seconds": simulation.wall_seconds,
        "steps": simulation.n_steps,
        "solves": int(steps["solves"].sum()),
        "rejected": int(steps["rejected"].sum()),
        "incidents": len(simulation.switches),
        "shortest_step": float(steps["length"].min()) if len(steps) else None,
        "longest_step": float(steps["length"].max()) if len(steps) else None,
        "largest_residual": float(steps["residual"].max(initial=0.0)),
        "unsolved_steps": int(missed.sum()),
    }


def _is_reference(simulation: VariableSimulation) -> bool:
    """Whether the options are those that the limit cycle was computed for."""
    scene = simulation.plan.scene
    known = SCENES[scene.name].options
    return all(scene.options[name] == option.default for name, option in known.items() if name != "start")


def _shown(motion: Cycles) -> int | None:
    """Return which complete period is printed, the last one that can be set beside the limit cycle, if any."""
    return max((number for number, cycle in enumerate(motion.cycles) if cycle.is_published), default=None)


def _published_table(cycle: Cycle) -> Table:
    """Return one period in the form of table 1 of the paper, beside the limit cycle."""
    table = _table("row", "law", "contact", "from", "to", "t [s]", "after section [s]", "limit cycle [s]", "off by [s]")
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


def _plain_table(found: list[Incident], simulation: VariableSimulation) -> Table:
    is_toy = simulation.plan.scene.name == "woodpecker"
    table = _table("row", "law", "contact", "from", "to", "t [s]")
    for number, incident in enumerate(found[:MOST_ROWS], start=1):
        words = _words(incident) if is_toy else (incident.law, str(incident.contact), incident.before, incident.after)
        table.add_row(str(number), *words, f"{incident.time:.9f}")
    if len(found) > MOST_ROWS:
        table.add_row("…", f"{len(found) - MOST_ROWS} more", "", "", "", "")
    return table


def _table(*heads: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, 1, 0, 0))
    for head in heads:
        is_text = head in ("law", "contact", "from", "to")
        table.add_column(Text(head), justify="left" if is_text else "right", no_wrap=True)
    return table


def _words(incident: Incident) -> tuple[str, str, str, str]:
    return incident.law, f"{incident.contact + 1} {CONTACTS[incident.contact]}", incident.before, incident.after


def _period_lines(motion: Cycles, is_reference: bool) -> Iterator[tuple[str, str]]:
    """Yield what is to be said of the periods, each line with its style."""
    if not motion.cycles:
        yield "no complete period, from row 1 of table 1 to the next row 1, yet", ""
    else:
        good = sum(cycle.is_published for cycle in motion.cycles)
        yield (
            (
                f"{good} of {counted(len(motion.cycles), 'complete period')}, from row 1 to the next row 1, "
                f"{'has' if good == 1 else 'have'} the twelve switching points of table 1 in its order"
            ),
            "",
        )
    if not motion.count:
        yield "the section, row 2 of table 1, is not met twice yet, so there is no time from section to section", ""
        return
    last = max(1, motion.count - TRANSIENT)
    yield f"period   {motion.mean_period(last):.12f} s  ({_about(last, motion.count)})", ""
    yield f"descent  {motion.mean_descent(last):.12f} m", ""
    if is_reference:
        period, descent = relative_deviations(motion, last)
        yield (
            (f"limit cycle {PERIOD:.12f} s and {DESCENT:.12f} m: off by {period:+.1e} and {descent:+.1e}, relatively"),
            "bold",
        )


def _about(last: int, count: int) -> str:
    """Return which times from section to section a mean is of."""
    some = (
        f"mean of the last {last} of {count}" if last > 1 else f"the last of {count}" if count > 1 else "the only one"
    )
    return f"{some}, from section to section: row 2 to the next row 2"


def _cost_lines(simulation: VariableSimulation) -> Iterator[tuple[str, str]]:
    """Yield what it cost, each line with its style."""
    total = variable_summary(simulation)
    failure = simulation.failure
    if not total["steps"]:
        yield ("no step is taken yet", "") if failure is None else (failure.what, "bold red")
        return
    yield (
        (
            f"total  {total['simulated_seconds']:.6g} s in {counted(total['steps'], 'step')} from "
            f"{total['shortest_step']:.1e} to {total['longest_step']:.1e} s, {total['rejected']} rejected; "
            f"{counted(total['solves'], 'one-step solve')}, "
            f"{total['wall_seconds']:.3g} s wall"
        ),
        "bold",
    )
    if failure is not None:
        yield failure.what, "bold red"
    elif not total["finished"]:
        yield f"stopped before its end at {simulation.plan.until:g} s", "yellow"
    if total["unsolved_steps"]:
        yield (
            (
                f"{unsolved_words(total['unsolved_steps'], total['steps'], simulation.plan.tolerance)}; "
                f"largest residual {total['largest_residual']:.1e}"
            ),
            "bold red",
        )
    else:
        yield f"every one-step inclusion of them is solved to {simulation.plan.tolerance:.0e}, by the judge", "green"
