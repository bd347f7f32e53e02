"""Progress bars on standard error, or plain lines if that is not a terminal."""

import io
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from ..measure.execution.events import (
    CasePassFinished,
    Event,
    PointFinished,
    ProblemStarted,
    ReferenceSimulated,
    RunStarted,
)
from ..store.plans import TrajectoryRecord

LOADING = "loading kernels; the first time they are compiled, for about a minute"
"""Description of a run until the first solver starts."""


class _Bar(Progress):
    """A progress bar below a text."""

    above: Text | None = None

    def get_renderables(self) -> Iterable[RenderableType]:
        """Yield the text and the bar."""
        if self.above is not None:
            yield self.above
        yield from super().get_renderables()


class ProgressBar:
    """Show what a command works on, and how much is done; a context manager."""

    def __init__(self, console: Console, hidden: bool = False) -> None:
        self._console, self._hidden = console, hidden
        self._bar = _Bar(
            TextColumn("{task.description}", markup=False),  # names may have brackets
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=hidden or not console.is_terminal,
        )
        self._task = self._bar.add_task("starting", total=None)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def count(self, done: int, total: int | None = None) -> None:
        """Show the number done, and the total if it is given."""
        self._bar.update(self._task, completed=done, total=total)

    def advance(self) -> None:
        """Count one more as done."""
        self._bar.advance(self._task)

    def name(self, text: str, again: bool = False) -> None:
        """Show the name of the current work; with ``again`` it gets no line of its own."""
        self._bar.update(self._task, description=text)
        if not (again or self._hidden or self._console.is_terminal):
            self._console.print(f"measuring {text}", soft_wrap=True, highlight=False, markup=False)


class RunProgress(ProgressBar):
    """Show the events of a run; pass it to ``run`` as ``on_event``.

    On a terminal, the table of the last measured problem stands above the bar.
    """

    _folder = Path()
    _points = _points_done = 0

    def __call__(self, event: Event) -> None:
        """Show one event."""
        if isinstance(event, RunStarted):
            self._folder = event.run_dir
            self._points, self._points_done = event.points, event.points_done
            if event.done < event.total:
                self._bar.update(self._task, description=LOADING)
                if event.points:
                    self.count(event.points_done, event.points)
                    self._bar.refresh()
                if event.work and not self._hidden:
                    self._console.print(f"to do: {event.work}", soft_wrap=True, highlight=False, markup=False)
        elif isinstance(event, ReferenceSimulated):
            self._warn(event.trajectory)
        elif isinstance(event, ProblemStarted):
            self.name(f"{event.problem}{_pass(event)}")
        elif isinstance(event, PointFinished):
            self.name(f"{event.problem}: {event.solver}, {event.tolerance:.1e} is done", again=True)
            if self._points:
                self._points_done += 1
                self.count(min(self._points_done, self._points), self._points)
        elif isinstance(event, CasePassFinished):
            if not self._bar.disable:
                self._bar.above = _first_look(self._folder, event.problem, self._console.width)
            self.count(self._points or event.done, self._points or event.total)

    def _warn(self, trajectory: TrajectoryRecord) -> None:
        """Warn before the first measurement if errors of the motion would mean nothing, even with a hidden bar."""
        from ..report.studies import motion_warning

        warning = motion_warning(trajectory)
        if warning:
            self._console.print(warning, soft_wrap=True, highlight=False, markup=False)


def _first_look(folder: Path, problem: str, width: int) -> Text:
    """Return the table of one problem of an unfinished run."""
    from ..report.tables import print_first_look
    from ..store.frames import read_frames

    console = Console(file=io.StringIO(), width=width, force_terminal=True)
    with console.capture() as captured:
        print_first_look(read_frames(folder, problem).only([problem]), console)
    return Text.from_ansi(captured.get())


def _pass(event: ProblemStarted) -> str:
    if event.passes == 1:
        return ""
    return f", pass {event.number + 1} of {event.passes}"
