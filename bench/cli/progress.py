"""The progress of a run."""

from ..measure.runner import CaseFinished, Event, PointFinished, ProblemStarted, RunStarted
from ..report.progress import ProgressBar


class RunProgress(ProgressBar):
    """Shows the events of a run; hand it to ``run`` as ``on_event``, see ``ProgressBar``."""

    def __call__(self, event: Event) -> None:
        """Show one event."""
        if isinstance(event, RunStarted):
            self.count(event.done, event.total)
        elif isinstance(event, ProblemStarted):
            self.name(event.problem)
        elif isinstance(event, PointFinished):
            self.name(f"{event.problem}: {event.solver}, {event.tolerance:.1e} is done", again=True)
        elif isinstance(event, CaseFinished):
            self.count(event.done)
