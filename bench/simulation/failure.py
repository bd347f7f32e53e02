"""Why a simulation could not go on, as it is stored with the steps before."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import FailedSimulationError


@dataclass(frozen=True)
class Failure:
    """A step that failed.

    Attributes:
        step: its number, from 1.
        time: when it began [s].
        solver: what solved the steps.
        reason: what happened, without a full stop.
    """

    step: int
    time: float
    solver: str
    reason: str

    @property
    def what(self) -> str:
        """The step, its time and the reason, as a part of a sentence."""
        return f"step {self.step}, from t = {self.time:.6g} s, failed with {self.solver}: {self.reason}"

    def error(self, file: Path | None) -> FailedSimulationError:
        """Return the error that says so, and how a simulation stored in ``file`` goes on."""
        kept = "" if file is None else f"; the steps before it are kept, go on with: proxbench simulate --resume {file}"
        return FailedSimulationError(f"{self.what}{kept}{' --solver …' if kept else '.'}")

    def document(self) -> dict[str, Any]:
        """Return the failure as plain values, from which ``failure_from`` makes it again."""
        return asdict(self)


def failure_from(stored: Mapping[str, Any] | None) -> Failure | None:
    """Return the failure that was stored, None if there was none.

    Raises:
        TypeError, ValueError, KeyError: if it is no such document.
    """
    if stored is None:
        return None
    return Failure(int(stored["step"]), float(stored["time"]), str(stored["solver"]), str(stored["reason"]))
