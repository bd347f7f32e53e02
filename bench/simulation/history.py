"""Stored records of a simulation: segments of steps with the same settings, and a failed step."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from shlex import quote

from msgspec import structs

from ...problems.motion.stepping.step import NOT_FINITE
from ..errors import FailedSimulationError
from ..store.fields import Count, Number, Record, Tolerance
from .plan import SimulationPlan


class Segment(Record, frozen=True, kw_only=True):
    """Consecutive steps with the same settings.

    Attributes:
        first: index of the first step, from 0. The segment ends where the next one begins.
        stepper: the stepper with its step size.
        solver: the solver.
        tolerance: judged residual that each step must reach.
        max_iterations: largest number of iterations of one solve.
        start: name of the rule for the initial impulses of each solve, such as "warm" or "cold".
    """

    first: Count
    stepper: str
    solver: str
    tolerance: Tolerance
    max_iterations: Count
    start: str

    @property
    def heading(self) -> str:
        """The settings in one line."""
        return f"{self.stepper} · {self.solver} · {self.start}"


def planned_segment(plan: SimulationPlan, first: int) -> Segment:
    """Return the segment that begins at index ``first`` with the settings of ``plan``."""
    record = structs.asdict(plan.record)
    return Segment(first=first, **{name: record[name] for name in Segment.__struct_fields__ if name != "first"})


def extended(segments: tuple[Segment, ...], plan: SimulationPlan, first: int) -> tuple[Segment, ...]:
    """Return ``segments`` extended by the step of index ``first``, which has the settings of ``plan``.

    A new segment begins only if the settings differ from those of the last segment.
    """
    new = planned_segment(plan, first)
    has_same_settings = bool(segments) and structs.replace(new, first=segments[-1].first) == segments[-1]
    return segments if has_same_settings else (*segments, new)


def check_segments(segments: Sequence[Segment], n_steps: int) -> None:
    """Check that stored segments cover ``n_steps`` steps.

    Raises:
        ValueError: if the first segment does not begin at step 0, or a segment is empty or out of order.
    """
    first_steps = [segment.first for segment in segments]
    has_start = first_steps[:1] == [0] if n_steps else not first_steps
    if not has_start or any(following <= first for first, following in pairwise([*first_steps, n_steps])):
        raise ValueError("the segments do not cover the steps")


class Failure(Record, frozen=True, kw_only=True):
    """A step that failed.

    Attributes:
        step: number of the step, from 1.
        time: simulated time at the beginning of the step [s].
        solver: the solver.
        reason: reason for the failure, without a full stop.
    """

    step: Count
    time: Number
    solver: str
    reason: str

    @property
    def description(self) -> str:
        """The step, its time, the solver and the reason, without a full stop."""
        # reasons reported by isolated solvers begin with the name of the solver
        reason = self.reason.removeprefix(f"{self.solver}: ")
        return f"step {self.step}, from t = {self.time:.6g} s, failed with {self.solver}: {reason}"

    def error(self, file: Path | None) -> FailedSimulationError:
        """Return the error to raise, with the command that resumes the simulation if it is stored in ``file``.

        A motion that is not finite may need a shorter step or another solver; other failures may need another solver.
        """
        if file is None:
            return FailedSimulationError(f"{self.description}.")
        remedy, options = "resume with another solver", "--solver …"
        if NOT_FINITE in self.reason:
            remedy, options = "resume with a shorter step or another solver", "--stepper … --solver …"
        remedy = f"{remedy}: proxbench simulate --resume {quote(str(file))} {options}"
        return FailedSimulationError(f"{self.description}; the earlier steps are kept; {remedy}")
