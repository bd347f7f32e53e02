"""Tables of a simulation: windows of 0.1 s of simulated time, switching points, periods, and a summary."""

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.console import Console
from rich.text import Text

from ....problems.contact.model import Model
from ....problems.motion.scenes.scene import Observable
from ...report.layout.text import counted, overlap_words, unsolved_words
from ...store.conversion import content_of
from ...store.fields import accuracy_tag
from ..history import planned_segment
from ..simulation import Ending, Simulation, describe_switches
from .switching_table import period_lines, periods_document, plain_table, print_switches

WINDOW_SECONDS = 0.1
"""Simulated time of one row of the table [s]."""


@dataclass(frozen=True)
class Window:
    """Consecutive steps that end in the same ``WINDOW_SECONDS``.

    Attributes:
        time: end of the last step [s].
        steps: number of steps.
        contacts: mean number of active contacts.
        iterations: mean number of iterations of the solver in a step, including those of rejected attempts.
        step_milliseconds: mean wall time of a step [ms]; see ``StepRow.seconds``.
        residual: largest judged residual.
        local_residual: largest local residual.
        unsolved: number of steps not solved to the tolerance, as judged.
        penetration: largest penetration of a state, relative to the length of the scene.
        impact_depth: largest penetration at a midpoint, where contacts are detected, relative to the same length.
        energy: kinetic and potential energy at the end [J]; None if the potential energy is unknown.
        observed: displayed observables at the end, by name.
    """

    time: float
    steps: int
    contacts: float
    iterations: float
    step_milliseconds: float
    residual: float
    local_residual: float
    unsolved: int
    penetration: float
    impact_depth: float
    energy: float | None
    observed: dict[str, float]


def windows(simulation: Simulation) -> Iterator[Window]:
    """Yield a window for each ``WINDOW_SECONDS`` in which a step ends; step sizes need not be equal."""
    steps = simulation.steps
    # a step that ends on the border of two windows up to rounding belongs to the earlier one
    number = np.maximum(np.ceil(steps["time"] / WINDOW_SECONDS - 1e-6), 1.0).astype(np.int64)
    borders = np.flatnonzero(np.diff(number)) + 1
    is_unsolved = simulation.unsolved
    for first, last in zip([0, *borders], [*borders, len(steps)], strict=True):
        if first < last:
            yield _window(simulation, slice(first, last), int(is_unsolved[first:last].sum()))


def summary(simulation: Simulation) -> dict[str, Any]:
    """Return the summary of a simulation as plain values; overlaps are None if a file of an older format lacks them."""
    steps, plan = simulation.steps, simulation.plan
    seconds = simulation.state.time - plan.scene.start.time
    observables = [observable.name for observable in plan.scene.observables if observable.label and len(steps)]
    overlapping = int(simulation.overlapping.sum())
    are_known = overlapping > 0 or not np.isnan(steps["overlap"]).any()

    def largest(name: str) -> float:
        return float(steps[name].max(initial=0.0))

    return {
        "finished": simulation.is_finished,
        "ended": str(simulation.ending),
        "failure": None if simulation.failure is None else simulation.failure.description,
        "steps": simulation.n_steps,
        "simulated_seconds": seconds,
        "wall_seconds": simulation.wall_seconds,
        "step_seconds": float(steps["seconds"].sum()),
        "step_seconds_per_simulated_second": float(steps["seconds"].sum()) / seconds if seconds > 0 else None,
        "iterations": int(steps["iterations"].sum()),
        "unsolved_steps": int(simulation.unsolved.sum()),
        "refuted_steps": int(simulation.refuted.sum()),
        "largest_residual": finite(largest("residual")),
        "largest_residual_time": float(steps["time"][np.argmax(steps["residual"])]) if len(steps) else None,
        "largest_local_residual": finite(largest("local_residual")),
        "hidden_error_steps": int(simulation.has_hidden_errors.sum()),
        "solves": int(steps["solves"].sum()),
        "rejected": int(steps["rejected"].sum()),
        "switches": len(simulation.switches),
        "shortest_step": float(steps["length"].min()) if len(steps) else None,
        "longest_step": float(steps["length"].max()) if len(steps) else None,
        "deepest_penetration": largest("penetration"),
        "deepest_impact": largest("impact_depth"),
        "overlapping_steps": overlapping if are_known else None,
        "largest_overlap": float(steps["overlap"][simulation.overlapping].max(initial=0.0)) if are_known else None,
        "largest_contacts": int(largest("contacts")),
        **{name: steps[name][-1].item() for name in observables},
        **_final_errors(simulation),
    }


def _final_errors(simulation: Simulation) -> dict[str, float]:
    """Return the largest errors of a coordinate and of a velocity at the end; empty if the exact motion is unknown."""
    exact, state = simulation.plan.scene.exact, simulation.state
    if exact is None or not simulation.n_steps:
        return {}
    exact_state = exact(state.time)
    return {
        "position_error": float(np.abs(state.position - exact_state.position).max()),
        "velocity_error": float(np.abs(state.velocity - exact_state.velocity).max()),
    }


def simulation_document(simulation: Simulation) -> dict[str, Any]:
    """Return plan, summary, windows, switching points and periods as JSON values."""
    rows = [_window_document(window) for window in windows(simulation)]
    return {
        "file": None if simulation.file is None else str(simulation.file),
        "plan": content_of(simulation.plan.record),
        "segments": [
            {**content_of(segment), "first": step_slice.start + 1, "last": step_slice.stop}
            for segment, step_slice in simulation.segments_with_steps()
        ],
        "summary": summary(simulation),
        "windows": rows,
        "switches": [
            {"begin": float(row["begin"]), "end": float(row["end"]), **asdict(event)}
            for row, event in zip(simulation.switches, simulation.switch_events, strict=True)
        ],
        "periods": periods_document(simulation),
    }


def _window_document(window: Window) -> dict[str, Any]:
    values = asdict(window)
    observed = values.pop("observed")
    return {name: finite(value) for name, value in {**values, **observed}.items()}


def finite(value: Any) -> Any:
    """Return ``value``, or None if it is not finite, which JSON cannot represent."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_simulation(simulation: Simulation, console: Console) -> None:
    """Print the tables of windows and of switching points, the total, and the unsolved steps."""
    plan = simulation.plan
    segments = simulation.segments or (planned_segment(plan, 0),)
    if len(segments) == 1:
        console.print(Text(f"{plan.scene.name} · {segments[0].heading}", style="bold"))
    else:
        console.print(Text(f"{plan.scene.name} · {len(segments)} segments", style="bold"))
        _print_segments(simulation, console)
    _print_windows(simulation, console)
    if plan.stepper.locates_switches:
        print_switches(simulation, console)
        console.print(Text(describe_switches(simulation.switch_events)))
    for line, style in (*period_lines(simulation), *_closing_lines(simulation)):
        console.print(Text(line, style=style))


def _print_segments(simulation: Simulation, console: Console) -> None:
    """Print the settings of each segment; the iteration limit has a column only if it differs between segments."""
    has_limits = len({segment.max_iterations for segment in simulation.segments}) > 1
    headings = ["max iter."] if has_limits else []
    table = plain_table("steps", "stepper", "solver", "tolerance", *headings, "start", "missed")
    for segment, step_slice in simulation.segments_with_steps():
        missed = int(simulation.unsolved[step_slice].sum())
        limits = [str(segment.max_iterations)] if has_limits else []
        table.add_row(
            Text(f"{step_slice.start + 1}–{step_slice.stop}"),
            *map(Text, (segment.stepper, segment.solver, accuracy_tag(segment.tolerance), *limits, segment.start)),
            Text(str(missed or "–"), style="bold red" if missed else ""),
        )
    console.print(table)


_COLUMNS: dict[str, Callable[[Window], str]] = {
    "t [s]": lambda window: f"{window.time:.3g}" if window.time < 100 else f"{window.time:.1f}",
    "steps": lambda window: str(window.steps),
    "contacts": lambda window: _digits(window.contacts, 4),
    "iter.": lambda window: f"{window.iterations:.1f}",
    "ms/step": lambda window: _digits(window.step_milliseconds, 3),
    "residual": lambda window: f"{window.residual:.0e}",
    "local": lambda window: f"{window.local_residual:.0e}",
    "missed": lambda window: str(window.unsolved or "–"),
    "depth/r": lambda window: f"{window.penetration:.4f}",
    "mid/r": lambda window: f"{window.impact_depth:.4f}",
    "E [J]": lambda window: _energy(window.energy),
}
"""Cells of a window by the head of their column."""


def _observed_cell(observable: Observable) -> Callable[[Window], str]:
    return lambda window: f"{window.observed[observable.name]:{'d' if observable.is_count else '.4g'}}"


def _energy(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if value < 0 else f"{value:.4g}"


def _digits(value: float, number: int) -> str:
    """Return a value with ``number`` significant digits, or all digits before the decimal point if there are more."""
    return f"{value:.{number}g}" if value < 10**number else f"{value:.0f}"


def _print_windows(simulation: Simulation, console: Console) -> None:
    absent = set() if simulation.plan.stepper.locates_switches else {"steps"}
    if simulation.plan.scene.potential_energy is None:
        absent.add("E [J]")
    if not simulation.has_hidden_errors.any():
        absent.add("local")
    columns = {heading: cell for heading, cell in _COLUMNS.items() if heading not in absent}
    for observable in simulation.plan.scene.observables:
        if observable.label:
            columns[observable.head or observable.name] = _observed_cell(observable)
    table = plain_table(*columns)
    for window in windows(simulation):
        styles = {"missed": "bold red"} if window.unsolved else {}
        table.add_row(*(Text(cell(window), style=styles.get(heading, "")) for heading, cell in columns.items()))
    if console.measure(table, options=console.options.update(width=500)).maximum > console.width:
        table.padding = (0, 0, 0, 0)  # narrower columns avoid truncated numbers
    console.print(table)


def _closing_lines(simulation: Simulation) -> Iterator[tuple[str, str]]:
    """Yield the lines below the tables, such as the total and the unsolved steps, each with its style."""
    total = summary(simulation)
    ending = _ending_line(simulation)
    if not total["steps"]:
        if ending is not None and simulation.failure is not None:
            yield ending
        else:
            yield "no step has been taken", ""
        return
    yield (
        f"total  {total['simulated_seconds']:.4g} s in {counted(total['steps'], 'step')}, "
        f"{total['step_seconds']:.3g} s wall: {total['step_seconds_per_simulated_second']:.3g} s per simulated second",
        "bold",
    )
    if simulation.plan.stepper.locates_switches:
        yield (
            f"steps from {total['shortest_step']:.1e} to {total['longest_step']:.1e} s, {total['rejected']} rejected; "
            f"{counted(total['solves'], 'one-step solve')}",
            "",
        )
    if "position_error" in total:
        errors = f"{total['position_error']:.1e} in a coordinate and {total['velocity_error']:.1e} in a velocity"
        yield f"largest error at the end against the exact motion: {errors} (SI units)", "bold"
    if ending:
        yield ending
    if total["overlapping_steps"]:
        yield (
            f"{overlap_words(total['overlapping_steps'])}; largest overlap {total['largest_overlap']:.2g} r",
            "bold yellow",
        )
    if not simulation.plan.stepper.shows_solves:
        yield "the judge confirms that impulses and forces at events are solved to 1e-09 or better", "green"
        return
    yield from _hidden_error_line(simulation)
    tolerances = {accuracy_tag(segment.tolerance) for segment in simulation.segments}
    tolerance = tolerances.pop() if len(tolerances) == 1 else "the tolerance of its segment"
    if not total["unsolved_steps"]:
        yield f"the judge confirms that every step is solved to {tolerance}", "green"
        return
    residual = total["largest_residual"]
    worst = "infinite" if residual is None else f"{residual:.1e}"
    yield (
        f"{unsolved_words(total['unsolved_steps'], total['steps'], tolerance)}; "
        f"largest residual {worst}, at t = {total['largest_residual_time']:.6g} s",
        "bold red",
    )
    missed = simulation.steps["status"][simulation.unsolved]
    for status, count in zip(*np.unique(missed, return_counts=True), strict=True):
        yield f"  the solver reports: {simulation.statuses[status]}, {counted(count, 'time')}", "red"
    solver = simulation.plan.solver
    if solver.model != Model.COULOMB and solver.name == simulation.segments[-1].solver:
        yield f"  the solver uses the {solver.model} model, not Coulomb friction", "red"


def _hidden_error_line(simulation: Simulation) -> Iterator[tuple[str, str]]:
    """Yield the number of steps in which fast contacts hide the errors of others, if any, with its style."""
    hidden = simulation.steps[simulation.has_hidden_errors]
    if not len(hidden):
        return
    worst = hidden[np.argmax(hidden["local_residual"])]
    yield (
        f"fast contacts hide errors of slow ones in {counted(len(hidden), 'step')}: local residual up to "
        f"{worst['local_residual']:.1e}, judged {worst['residual']:.1e}, at t = {worst['time']:.6g} s",
        "bold yellow",
    )


def _ending_line(simulation: Simulation) -> tuple[str, str] | None:
    """Return why the simulation ended early, with a style; None if it reached its duration."""
    scene_ending = simulation.scene_ending
    if scene_ending is not None:
        return scene_ending.sentence, "green" if scene_ending.is_success else "bold yellow"
    if simulation.ending is Ending.FAILED and simulation.failure is not None:
        return simulation.failure.description, "bold red"
    if simulation.ending is Ending.STOPPED:
        return f"stopped before its end at {simulation.plan.duration:g} s", "yellow"
    return None


def _window(simulation: Simulation, step_slice: slice, unsolved: int) -> Window:
    """Return the window of the steps with the indices ``step_slice``, ``unsolved`` of which are unsolved."""
    steps = simulation.steps[step_slice]
    last, scene = steps[-1], simulation.plan.scene
    energy = float(last["kinetic_energy"] + last["potential_energy"])
    largest = ("residual", "local_residual", "penetration", "impact_depth")
    return Window(
        time=float(last["time"]),
        steps=len(steps),
        contacts=float(steps["contacts"].mean()),
        iterations=float(steps["iterations"].mean()),
        step_milliseconds=1e3 * float(steps["seconds"].mean()),
        unsolved=unsolved,
        energy=None if scene.potential_energy is None else energy,
        observed={
            observable.name: last[observable.name].item() for observable in scene.observables if observable.label
        },
        **{name: float(steps[name].max()) for name in largest},
    )
