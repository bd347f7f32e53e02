"""The progress of a study."""

from rich.console import Console

from ..report.progress import ProgressBar
from .plan import Case
from .study import Study


class StudyProgress(ProgressBar):
    """Shows which case is measured; hand it over as ``on_progress``, see ``ProgressBar``."""

    def __init__(self, console: Console, hidden: bool = False) -> None:
        super().__init__(console, hidden)
        self._last: Case | None = None

    def __call__(self, study: Study, case: Case) -> None:
        """Show the case that comes next."""
        self.count(len(study.measured), study.plan.n_runs)
        self.name(f"{case.series}, {case.setting}, to {case.tolerance:.0e}", again=case is self._last)
        self._last = case
