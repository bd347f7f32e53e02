"""The live summary of a simulation on standard error, or occasional plain lines if standard error is not a terminal."""

import math
import time
from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.text import Text

from ..simulation import Simulation

REDRAW_SECONDS = 0.2
"""Wall time between two updates of a terminal [s]; an update takes about a millisecond."""

LINE_SECONDS = 10.0
"""Wall time between two plain lines [s]."""


class LiveSummary:
    """Show the progress of a simulation; use it as a context manager and pass it as ``on_progress``.

    Args:
        console: console on standard error.
        hidden: whether to show nothing.
    """

    def __init__(self, console: Console, hidden: bool = False) -> None:
        self._console = console
        self._hidden = hidden
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._interval = REDRAW_SECONDS if console.is_terminal else LINE_SECONDS
        self._next = time.perf_counter()
        self._shown_time = math.nan
        self._n_shown = 0
        self._n_unsolved = 0

    def __enter__(self) -> Self:
        if self._console.is_terminal and not self._hidden:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def __call__(self, simulation: Simulation) -> None:
        """Show the simulation, at most once per interval."""
        now = time.perf_counter()
        if self._hidden or now < self._next:
            return
        self._next = now + self._interval
        first, second = self._lines(simulation, now)
        if not self._console.is_terminal:
            self._console.print(f"{first}  {second}", soft_wrap=True, highlight=False)
            return
        bar = ProgressBar(total=1.0, completed=_share(simulation), width=min(self._console.width - 1, 78))
        style = "red" if self._n_unsolved else "dim"
        self._live.update(Group(Text(first, no_wrap=True), Text(second, style=style, no_wrap=True), bar), refresh=True)

    def _lines(self, simulation: Simulation, now: float) -> tuple[str, str]:
        """Return two lines of at most 80 columns: the progress with the speed, and the last step."""
        plan, last = simulation.plan, simulation.steps[-1]
        # count new steps only; counting all would become slower with every redraw
        self._n_unsolved += int(simulation.unsolved_from(self._n_shown).sum())
        rate = (simulation.n_steps - self._n_shown) / (now - self._shown_time)
        speed = "" if math.isnan(rate) else f"  {rate:.0f} steps/s"
        self._shown_time, self._n_shown = now, simulation.n_steps
        first = f"{plan.scene.name}  {last['time']:.4f} of {plan.until:g} s  step {simulation.n_steps}{speed}"
        if plan.stepper.locates_switches:
            first += f"  of {last['length']:.0e} s  {len(simulation.switches)} switches"
        unsolved = f"  unsolved {self._n_unsolved}" if self._n_unsolved else ""
        energy = ""
        if plan.scene.potential_energy is not None:
            energy = f"  energy {last['kinetic_energy'] + last['potential_energy']:.4g} J"
        return first, (
            f"contacts {last['contacts']}  iterations {last['iterations']}  residual {last['residual']:.0e}"
            f"{energy}{unsolved}"
        )


def _share(simulation: Simulation) -> float:
    """Return the finished share of the simulated time, from 0 to 1."""
    plan = simulation.plan
    return min((simulation.state.time - plan.scene.start.time) / plan.duration, 1.0)
