"""Why a simulation could not go on, as it is stored with the steps before."""

from pathlib import Path

from ..errors import FailedSimulationError
from ..store.fields import Count, Number, Record


class Failure(Record, frozen=True, kw_only=True):
    """A step that failed.

    Attributes:
        step: its number, from 1.
        time: when it began [s].
        solver: what solved the steps.
        reason: what happened, without a full stop.
    """

    step: Count
    time: Number
    solver: str
    reason: str

    @property
    def what(self) -> str:
        """The step, its time and the reason, as a part of a sentence."""
        reason = self.reason.removeprefix(f"{self.solver}: ")  # which errors of solvers in processes of their own name
        return f"step {self.step}, from t = {self.time:.6g} s, failed with {self.solver}: {reason}"

    def error(self, file: Path | None) -> FailedSimulationError:
        """Return the error that says so, and how a simulation stored in ``file`` goes on."""
        kept = "" if file is None else f"; the steps before it are kept, go on with: proxbench simulate --resume {file}"
        return FailedSimulationError(f"{self.what}{kept}{' --solver …' if kept else '.'}")
