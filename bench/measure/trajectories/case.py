"""Measure a stepper with a solver on a trajectory, in a child process; a round is one member."""

import time
from collections.abc import Collection, Sequence
from statistics import median
from typing import Any, NamedTuple

import msgspec
import numpy as np

from ....problems.contact.solver import Status
from ....problems.motion.trajectories.problem import TrajectoryProblem
from ...isolation.worker import Fault, no_answer
from ...store.fields import Count, Number
from ...store.outcome import Outcome
from ...store.plans import Limits
from ...store.records import CaseRecord, Measured, Point, QuantityError
from ..contacts.timed_round import TOLERATED_SECONDS, TOLERATED_SHARE
from ..ladder import MAX_REASON_LENGTH, LadderCase
from ..points import quartiles
from .methods import Method
from .task import TrajectoryTask


class Simulated(msgspec.Struct, frozen=True):
    """The result of one simulation, as its process reports it.

    Attributes:
        status: status at the end.
        reason: why it is incomplete, in words.
        wall: wall time of its steps [s], without judging and recording.
        solves: number of solved one-step inclusions, including those of rejected attempts.
        unsolved: number of steps that are not solved to the tolerance, as judged.
        values: final values by name; empty if it is incomplete.
    """

    status: Status
    reason: str
    wall: Number
    solves: Count
    unsolved: Count
    values: dict[str, Number]


def simulated(answer: dict[str, Any], seconds: float, names: Collection[str]) -> Simulated:
    """Return the answer of a process to "simulate".

    Args:
        answer: the answer.
        seconds: wall time as measured outside the process [s].
        names: names of the values of a complete simulation; if empty, any names.

    Raises:
        Fault: if the answer is invalid.
    """
    try:
        read = msgspec.convert(answer, Simulated)
    except msgspec.ValidationError:
        raise no_answer() from None
    if read.status is Status.SOLVED and not (read.values and set(names) <= set(read.values)):
        raise no_answer()
    if not 0.0 <= read.wall <= seconds:
        clock = f"the clock in its process counted {read.wall:g} s of steps in {seconds:g} s of wall time"
        raise Fault(Outcome.MISBEHAVED, clock)
    return read


class Member(NamedTuple):
    """A simulated member of a problem.

    Attributes:
        number: number of the member.
        simulated: the result of its process.
        is_preempted: whether another process ran on its core for more than a tolerable part of the time.
    """

    number: float
    simulated: Simulated
    is_preempted: bool


class TrajectoryCase(LadderCase[Member]):
    """A stepper with a solver on a problem.

    Attributes:
        problem: the problem, with its reference.
        method: the stepper with its solver.
    """

    def __init__(
        self, problem: TrajectoryProblem, method: Method, limits: Limits, stored: CaseRecord | None = None
    ) -> None:
        """Store what to measure.

        Args:
            problem: the problem.
            method: the stepper with its solver.
            limits: limits of the case; those of a solve apply to one simulation.
            stored: previous measurements.
        """
        super().__init__(method.record.values, limits, stored)
        self.problem, self.method = problem, method

    def is_left(self, level: int) -> bool:
        """Return whether the point is missing."""
        return level >= len(self.points)

    def begin(self) -> None:
        """Start the process and simulate the beginning of the motion, so that kernels are compiled."""
        self._start(TrajectoryTask(self.problem, self.method, self.limits.solve_seconds))
        self._ask("warm_up", self.ladder[len(self.points)], self.problem.members[0])

    def measure(self, value: float, number: int) -> Member | None:
        """Simulate one member; return None if the case failed."""
        if self._worker is None:
            return None
        worker, member = self._worker, self.problem.members[number]
        began, waited = time.monotonic(), worker.waited_seconds()
        found = self._ask("simulate", value, member)
        if found is None:
            return None
        try:
            run = simulated(found[0], time.monotonic() - began, self.problem.measure.names)
        except Fault as fault:
            self._fail(fault)
            return None
        lost = worker.waited_seconds() - waited
        return Member(member, run, lost > TOLERATED_SHARE * run.wall + TOLERATED_SECONDS)

    def needs_round(self, answers: Sequence[Member]) -> bool:
        """Return whether members are left, and the last one ended within the time limit."""
        return len(answers) < len(self.problem.members) and answers[-1].simulated.status is not Status.TIME_LIMIT

    def point(self, value: float, answers: list[Member]) -> Point:
        """Compute the error over the members."""
        runs = {answer.number: answer.simulated for answer in answers}
        good = {member: run for member, run in runs.items() if run.status is Status.SOLVED}
        failed = [run for run in runs.values() if run.status is not Status.SOLVED]
        errors = self.problem.measure.estimates({member: run.values for member, run in good.items()})
        counted = list(good.values()) if errors else list(runs.values())
        undisturbed = [one.simulated.wall for one in answers if one.simulated in counted and not one.is_preempted]
        wall = quartiles(np.array(undisturbed or [run.wall for run in counted]))
        worst = max((one.error for one in errors.values()), default=np.inf)
        measured = Measured(
            iterations=round(median(run.solves for run in counted)),
            residual=worst,
            model_residual=worst,
            prepare_seconds=quartiles(np.zeros(1)),
            solve_seconds=wall,
            total_seconds=wall,
            repeats=len(good),
            is_excluded=not undisturbed,
            verdict={},
            impulse_error=None,
            errors=[
                QuantityError(quantity=name, error=one.error, low=one.low, high=one.high)
                for name, one in errors.items()
            ],
            unsolved_steps=sum(run.unsolved for run in good.values()),
            failed_members=len(failed),
        )
        # if most members are incomplete, the point is not reached
        is_reached = not failed or (errors and len(good) > len(failed))
        status = Status.SOLVED if is_reached else failed[0].status
        reason = failed[0].reason[:MAX_REASON_LENGTH] if failed else ""
        return Point(
            tolerance=value, outcome=Outcome(status.value), status=status.value, reason=reason, measured=measured
        )

    def end_after(self, point: Point) -> str:
        """Return why finer points are not attempted after one that took too long; empty otherwise."""
        if point.outcome is Outcome.TIME_LIMIT:
            return f"{point.tolerance:g} already took longer than {self.limits.solve_seconds:g} s"
        return point.reason if point.outcome is Outcome.NOT_ATTEMPTED else ""

    def identity(self) -> dict[str, Any]:
        """Return problem and method."""
        return {
            "problem": self.problem.name,
            "digest": self.problem.digest,
            "solver": self.method.record.name,
            "model": str(self.method.solver.model),
            "has_iterates": False,
            "n_rows": 0,
            "n_contacts": 0,
        }
