"""Records of the settings of steps (segments), and of a failed step."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from msgspec import structs

from ..errors import FailedSimulationError
from ..store.fields import Count, Number, Record, Tolerance
from .plan import SimulationPlan


class Segment(Record, frozen=True, kw_only=True):
    """Consecutive steps with the same settings.

    Attributes:
        first: index of its first step, from 0; it ends where the next segment begins.
        stepper: the stepper with its step size.
        solver: the solver.
        tolerance: judged residual that each step must reach.
        max_iterations: iteration limit of the solver in one step.
        start: initial impulses of each solve.
    """

    first: Count
    stepper: str
    solver: str
    tolerance: Tolerance
    max_iterations: Count
    start: str

    @property
    def words(self) -> str:
        """The settings in one line, as a header."""
        return f"{self.stepper} · {self.solver} · {self.start}"


def planned_segment(plan: SimulationPlan, first: int) -> Segment:
    """Return the segment that begins at index ``first`` under the settings of ``plan``."""
    record = structs.asdict(plan.record)
    return Segment(first=first, **{name: record[name] for name in Segment.__struct_fields__ if name != "first"})


def extended(segments: tuple[Segment, ...], plan: SimulationPlan, first: int) -> tuple[Segment, ...]:
    """Return ``segments`` with one more step of ``plan``, whose index is ``first``."""
    new = planned_segment(plan, first)
    is_same = bool(segments) and structs.replace(new, first=segments[-1].first) == segments[-1]
    return segments if is_same else (*segments, new)


def check_segments(segments: Sequence[Segment], n_steps: int) -> None:
    """Check that stored segments cover ``n_steps`` steps.

    Raises:
        ValueError: if they do not.
    """
    firsts = [segment.first for segment in segments]
    begins = firsts[:1] == [0] if n_steps else not firsts
    if not begins or any(after <= before for before, after in pairwise([*firsts, n_steps])):
        raise ValueError("the segments do not cover the steps")


class Failure(Record, frozen=True, kw_only=True):
    """A step that failed.

    Attributes:
        step: its number, from 1.
        time: simulated time at its beginning [s].
        solver: the solver.
        reason: reason of the failure, without a full stop.
    """

    step: Count
    time: Number
    solver: str
    reason: str

    @property
    def what(self) -> str:
        """The step, its time and the reason, as a part of a sentence."""
        reason = self.reason.removeprefix(f"{self.solver}: ")  # isolated solvers put their name first
        return f"step {self.step}, from t = {self.time:.6g} s, failed with {self.solver}: {reason}"

    def error(self, file: Path | None) -> FailedSimulationError:
        """Return the error to raise, with the command that resumes a simulation stored in ``file``."""
        kept = "" if file is None else f"; the earlier steps are kept; resume with: proxbench simulate --resume {file}"
        return FailedSimulationError(f"{self.what}{kept}{' --solver …' if kept else '.'}")
