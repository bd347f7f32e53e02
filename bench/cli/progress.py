"""Progress bars on standard error, or plain lines if standard error is not a terminal."""

import io
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from ..measure.execution.events import (
    Event,
    PointFinished,
    ProblemPassFinished,
    ProblemStarted,
    ReferenceSimulated,
    RunStarted,
)
from ..store.fields import accuracy_tag

LOADING = "loading kernels; compiling them at the first use takes up to a few minutes"
"""Description of a run until the first solver starts."""

ESTIMATE_SECONDS = 3600.0
"""Period from which the remaining time is estimated [s]; it is long because a point of a study takes minutes."""


class ProgressBar(Progress):
    """Show the current work, the progress and the remaining time of a command; a context manager."""

    def __init__(self, hidden: bool = False, console: Console | None = None) -> None:
        console = console or Console(stderr=True)
        super().__init__(
            TextColumn("{task.description}", markup=False),  # names may contain brackets
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("·"),
            TimeRemainingColumn(),
            TextColumn("left"),
            console=console,
            transient=True,
            disable=hidden or not console.is_terminal,
            speed_estimate_period=ESTIMATE_SECONDS,
        )
        self._hidden = hidden
        self._task = self.add_task("starting", total=None)

    def count(self, done: int, total: int | None = None) -> None:
        """Show the number of finished items, and the total number if given."""
        self.update(self._task, completed=done, total=total)

    def count_one(self) -> None:
        """Count one more item as finished."""
        self.advance(self._task)

    def name(self, text: str, bar_only: bool = False) -> None:
        """Show the name of the current work. With ``bar_only``, print no line for it if there is no terminal."""
        self.update(self._task, description=text)
        if not (bar_only or self.console.is_terminal):
            self.print_line(f"measuring {text}")

    def print_line(self, sentence: str, always: bool = False) -> None:
        """Print a line above the bar. If the bar is hidden, print it only with ``always``."""
        if always or not self._hidden:
            self.console.print(sentence, soft_wrap=True, highlight=False, markup=False)


class RunProgress(ProgressBar):
    """Show the events of a run; pass it to ``run`` as ``on_event``.

    On a terminal, the table of the last measured problem appears above the bar.
    """

    _started = RunStarted(Path(), 0, 0)
    _points_done = 0
    _table: Text | None = None

    def get_renderables(self) -> Iterable[RenderableType]:
        """Yield the table and the bar."""
        if self._table is not None:
            yield self._table
        yield from super().get_renderables()

    def __call__(self, event: Event) -> None:
        """Show one event."""
        if isinstance(event, RunStarted):
            self._started, self._points_done = event, event.points_done
            if event.done < event.total:
                self.name(LOADING, bar_only=True)
                if event.points:
                    self.count(event.points_done, event.points)
                    self.refresh()
                if event.work:
                    self.print_line(f"remaining: {event.work}")
        elif isinstance(event, ReferenceSimulated):
            from ..report.studies import motion_warning

            if warning := motion_warning(event.trajectory):
                self.print_line(warning, always=True)
        elif isinstance(event, ProblemStarted):
            self.name(f"{event.problem}{_pass_text(event)}")
        elif isinstance(event, PointFinished):
            self.name(f"{event.problem}: {event.solver}, {accuracy_tag(event.tolerance)} is done", bar_only=True)
            if self._started.points:
                self._points_done += 1
                self.count(min(self._points_done, self._started.points), self._started.points)
        elif isinstance(event, ProblemPassFinished):
            if not self.disable:
                self._table = _problem_table(self._started.run_dir, event.problem, self.console.width)
            self.count(self._started.points or event.done, self._started.points or event.total)


def _problem_table(folder: Path, problem: str, width: int) -> Text:
    """Return the table of one problem of an unfinished run."""
    from ..report.tables import print_unfinished
    from ..store.frames import read_frames

    console = Console(file=io.StringIO(), width=width, force_terminal=True)
    with console.capture() as captured:
        print_unfinished(read_frames(folder, problem).only([problem]), console)
    return Text.from_ansi(captured.get())


def _pass_text(event: ProblemStarted) -> str:
    """Return the number of the pass; empty if there is only one."""
    return "" if event.passes == 1 else f", pass {event.number + 1} of {event.passes}"
