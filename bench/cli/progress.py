"""The progress of a run."""

from ..measure.runner import Event, PointFinished, ProblemStarted, VisitFinished
from ..report.progress import ProgressBar


class RunProgress(ProgressBar):
    """Shows the events of a run; hand it to ``run`` as ``on_event``, see ``ProgressBar``."""

    def __call__(self, event: Event) -> None:
        """Show one event."""
        if isinstance(event, ProblemStarted):
            self.name(f"{event.problem}{_pass(event)}")
        elif isinstance(event, PointFinished):
            self.name(f"{event.problem}: {event.solver}, {event.tolerance:.1e} is done", again=True)
        elif isinstance(event, VisitFinished):
            self.count(event.done, event.total)


def _pass(event: ProblemStarted) -> str:
    if event.passes == 1:
        return ""
    return f", pass {event.number + 1} of {event.passes}" if event.number < event.passes else ", more rounds"
