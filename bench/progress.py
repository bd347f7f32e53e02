"""The progress bar of a run, on standard error; plain lines where that is no terminal."""

from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from .runner import CaseFinished, Event, ProblemStarted, RunStarted


class RunProgress:
    """Shows the events of a run; use it as a context manager and hand it to ``run`` as ``on_event``."""

    def __init__(self, console: Console, hidden: bool = False) -> None:
        self._console = console
        self._hidden = hidden
        self._bar = Progress(
            TextColumn("{task.description}", table_column=None),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=hidden or not console.is_terminal,
        )
        self._task = self._bar.add_task("starting", total=None)

    def __enter__(self) -> "RunProgress":
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, event: Event) -> None:
        """Show one event."""
        if isinstance(event, RunStarted):
            self._bar.update(self._task, total=event.total, completed=event.done)
        elif isinstance(event, ProblemStarted):
            self._bar.update(self._task, description=event.problem)
            if not self._hidden and not self._console.is_terminal:
                self._console.print(f"measuring {event.problem}")
        elif isinstance(event, CaseFinished):
            self._bar.update(self._task, completed=event.done)
