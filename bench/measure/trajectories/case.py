"""Measure a stepper with a solver on a trajectory, in a child process; each round simulates one member.

Members are seeds of the scene, or factors on the step or tolerance of the stepper.
"""

import math
from collections.abc import Sequence
from statistics import median
from typing import Any, NamedTuple

from ....problems.contact.solver import Status
from ....problems.motion.trajectories.problem import TrajectoryProblem
from ...isolation.worker import invalid_answer_fault
from ...store.fields import Count, Number
from ...store.outcome import Outcome
from ...store.plans import Limits
from ...store.records import CaseRecord, Measured, Point, QuantityError, Round
from ..ladder import MAX_REASON_LENGTH, CasePass, LadderCase
from ..points import times_from_rounds
from ..timed_round import TimedRound
from .methods import Method
from .task import TrajectoryRequest, TrajectoryTask


class SimulationRound(TimedRound, frozen=True, kw_only=True):
    """The result of one simulation from its process.

    The simulation takes the place of a solve: ``iterations`` is the number of its one-step solves.

    Attributes:
        steps: number of steps; each is timed separately, without judging and recording.
        unsolved: number of steps that are not solved to the tolerance, as judged.
        overlapping: number of steps after which the projection of positions leaves deeper overlaps than its tolerance.
        values: final values by name; empty if the simulation is incomplete.
        displacement: largest change of a coordinate from the start at any time [m; 1 for quaternions]; 0 if incomplete.
    """

    steps: Count
    unsolved: Count
    overlapping: Count
    values: dict[str, Number]
    displacement: Number = 0.0

    @property
    def n_readings(self) -> int:
        """Number of readings of both clocks."""
        return self.steps

    def __post_init__(self) -> None:
        if self.status is Status.SOLVED and not self.values:
            raise ValueError("a complete simulation has values")


class Member(NamedTuple):
    """The simulation of a member, and its record."""

    run: SimulationRound
    record: Round


class TrajectoryCase(LadderCase[Member]):
    """A stepper with a solver on a problem.

    Attributes:
        problem: the problem, with its reference.
        method: the stepper with its solver.
    """

    def __init__(
        self,
        problem: TrajectoryProblem,
        method: Method,
        limits: Limits,
        stored: CaseRecord | None,
        case_pass: CasePass,
    ) -> None:
        """Store the problem, the method and their previous measurements; limits of a solve apply to one simulation."""
        super().__init__(method.record.values, limits, stored, case_pass)
        self.problem, self.method = problem, method

    def is_pending(self, level: int) -> bool:
        """Return whether the point is missing."""
        return level >= len(self.points)

    def begin(self) -> None:
        """Start the process, and simulate the motion once, so that no compilation is timed."""
        task = TrajectoryTask(self.problem, self.method, self.limits.solve_seconds)
        self._start(task, self.method.solver.compiled_solvers)
        self._ask(TrajectoryRequest.WARM_UP, self.ladder[len(self.points)], self.problem.members[0])

    def measure(self, value: float, number: int) -> Member | None:
        """Simulate one member; return None if the case failed.

        Args:
            value: tolerance or step of the method at this point.
            number: index of the member.
        """
        member, request = self.problem.members[number], TrajectoryRequest.SIMULATE
        result = self._timed_round(SimulationRound, number, request, value, member)
        if result is None:
            return None
        simulated, record, _ = result
        if simulated.values and not set(self.problem.measure.names) <= set(simulated.values):
            self._fail(invalid_answer_fault())
            return None
        return Member(simulated, record)

    def needs_round(self, results: Sequence[Member]) -> bool:
        """Return whether members remain, and the last simulation ended within the time limit."""
        return len(results) < len(self.problem.members) and results[-1].run.status is not Status.TIME_LIMIT

    def point(self, value: float, results: list[Member]) -> Point:
        """Return a point with the errors over all complete members."""
        by_member = dict(zip(self.problem.members, results, strict=False))
        complete = {member: result.run for member, result in by_member.items() if result.run.status is Status.SOLVED}
        failed = [result.run for result in results if result.run.status is not Status.SOLVED]
        errors = self.problem.measure.estimates({member: run.values for member, run in complete.items()})
        counted = [result for member, result in by_member.items() if not errors or member in complete]
        times = times_from_rounds([result.record for result in counted])
        worst = max((estimate.error for estimate in errors.values()), default=math.inf)
        measured = Measured(
            iterations=round(median(result.run.iterations for result in counted)),
            residual=worst,
            model_residual=worst,
            **{**times, "repeats": len(complete)},
            rounds=[result.record for result in results],
            verdict={},
            impulse_error=None,
            errors=[
                QuantityError(quantity=name, error=estimate.error, low=estimate.low, high=estimate.high)
                for name, estimate in errors.items()
            ],
            unsolved_steps=sum(run.unsolved for run in complete.values()),
            overlapping_steps=sum(run.overlapping for run in complete.values()),
            failed_members=len(failed),
        )
        # a point is reached only if more than half of its members are complete
        is_reached = not failed or (errors and len(complete) > len(failed))
        status = Status.SOLVED if is_reached else failed[0].status
        reason = failed[0].message[:MAX_REASON_LENGTH] if failed else ""
        return Point(
            tolerance=value, outcome=Outcome(status.value), status=status.value, reason=reason, measured=measured
        )

    def reason_to_stop(self, point: Point) -> str:
        """Return why finer points are not attempted after one that took too long, or an empty string."""
        if point.outcome is Outcome.TIME_LIMIT:
            return f"{point.tolerance:g} already took longer than {self.limits.solve_seconds:g} s"
        return point.reason if point.outcome is Outcome.NOT_ATTEMPTED else ""

    def identity(self) -> dict[str, Any]:
        """Return the fields of the record that identify problem and method."""
        return {
            "problem": self.problem.name,
            "digest": self.problem.digest,
            "solver": self.method.record.name,
            "model": str(self.method.solver.model),
            "has_iterates": False,
            "n_rows": 0,
            "n_contacts": 0,
        }
