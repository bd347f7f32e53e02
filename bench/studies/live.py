"""The progress of a study, on standard error; plain lines where that is no terminal."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from .cases import Case
from .study import Study


class StudyProgress:
    """Shows which case is measured; use it as a context manager and hand it over as ``on_progress``."""

    def __init__(self, console: Console, hidden: bool = False) -> None:
        self._console, self._hidden = console, hidden
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=hidden or not console.is_terminal,
        )
        self._task = self._bar.add_task("starting", total=None)
        self._last: Case | None = None

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, study: Study, case: Case) -> None:
        """Show the case that comes next."""
        text = f"{case.series}, {case.setting}, to {case.tolerance:.0e}"
        self._bar.update(self._task, description=text, total=study.plan.n_runs, completed=len(study.measured))
        if case is not self._last and not self._hidden and not self._console.is_terminal:
            self._console.print(f"measuring {text}", soft_wrap=True, highlight=False, markup=False)
        self._last = case
