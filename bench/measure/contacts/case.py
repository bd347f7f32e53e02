"""Measure one solver on one contact problem; the solver runs in a child process."""

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Literal

import numpy as np
from msgspec.structs import replace

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ....problems.contact.solver import Status, Stop
from ....problems.exchange.files.problem_file import problem_bytes
from ....problems.exchange.sequences import NO_PREDECESSORS, Predecessors
from ....problems.representation import counted
from ...isolation.worker import MAX_CONTENT_BYTES, Fault, invalid_answer_fault
from ...plugins.remote_solver import are_iterations
from ...plugins.solver_specs import SolverSpec
from ...store.notes import is_explained
from ...store.outcome import IN_FIRST_SOLVE, ON_COPY, Outcome, late_reason
from ...store.plans import Limits
from ...store.records import MAX_ANSWERS, CaseRecord, Curve, Measured, ObservedSolve, Point, Round
from ..ladder import MAX_REASON_LENGTH, CasePass, LadderCase
from ..measuring_core import MeasuringCore
from ..points import keep_finest_impulses, times_from_rounds
from ..timed_round import TimedRound
from .answers import judge_answers, judge_control_solves
from .case_process import MeasuringRequest, MeasuringTask
from .clock_account import ClockAccount
from .control import WARM_UP_STOP, Controls, ControlSolve
from .iterations import contradicting_solve, is_contradicted, iteration_fields
from .starts import Starts
from .variants import perturbed_copy

ROUND_SECONDS = 0.005
"""Least wall time of a round [s]; every round has at least one timed solve."""

ROUNDS = 2
"""Number of counted rounds that a point needs in a pass."""

ENOUGH_SECONDS = 0.02
"""Wall time of a counted round from which one round per pass suffices [s]."""

MAX_EXCLUDED = 3
"""Largest number of excluded rounds of a point in a pass."""

MAX_EXCLUDED_SECONDS = 0.2
"""Wall time of the excluded rounds of a point in a pass after which no other round follows [s]."""

MAX_RESTS = 20
"""Largest number of pauses in which processes of a solver may end; a solver misbehaved if one runs afterwards."""


@dataclass(frozen=True)
class MeasuredRound:
    """A round with its answers.

    Attributes:
        timed: the timed solves.
        record: the record of the round.
        impulses: the distinct answers [N s], shape (n, n_rows).
    """

    timed: TimedRound
    record: Round
    impulses: FloatArray


class Case(LadderCase[MeasuredRound]):
    """A solver on a problem, measured at a ladder of tolerances.

    Attributes:
        problem: the problem.
        solver: the solver.
    """

    def __init__(
        self,
        problem: ContactProblem,
        solver: SolverSpec,
        limits: Limits,
        ladder: Sequence[float],
        *,
        problem_data: bytes,
        stored: CaseRecord | None,
        case_pass: CasePass,
        before: Predecessors = NO_PREDECESSORS,
    ) -> None:
        """Store the plan of the case and its previous measurements.

        ``problem_data`` is a file content of the problem without its name, and ``before`` the steps of a warm start.
        """
        super().__init__(ladder, limits, stored, case_pass)
        self.problem, self.solver, self._data = problem, solver, problem_data
        self.is_built_in = solver.is_built_in
        self._observed: dict[float, ObservedSolve | None] = {}
        self._is_contradicted = any(is_contradicted(point.measured) for point in self.points)
        self._controls = Controls(problem, warm_up_data(problem), solver, limits)
        self._before = before
        self._starts = Starts(before.steps if solver.starts_warm else (), problem, self._controls)
        self._clock = ClockAccount(problem)
        self._copy_level = int(np.random.default_rng().integers(len(ladder)))  # unpredictable for a solver
        self._threads_used = 0 if stored is None else stored.threads_used
        self.is_solvable = None if problem.answer is None else problem.answer.solvable

    def is_pending(self, level: int) -> bool:
        """Return whether a point is missing, or needs another round in this pass."""
        if level >= len(self.points):
            return True
        point = self.points[level]
        if point.is_repeated:
            return point.n_passes <= self.case_pass.number
        return (point.is_late_under_load or point.outcome is Outcome.NOT_ATTEMPTED) and not self._reason_to_stop_before(
            level
        )

    def begin(self) -> None:
        """Start the process, warm up on a copy of the problem, and measure the convergence curve of the problem.

        If the solver does not support the copy or the problem, the case records its reason.
        """
        if self.solver.starts_warm and not self._before.steps:
            self._fail(Fault(Outcome.UNSUPPORTED, self._before.missing))
            return
        self._start(MeasuringTask(self._controls.warm_up, self.solver), self.solver.compiled_solvers)
        requests = (
            (MeasuringRequest.SUPPORTS,),
            (MeasuringRequest.WARM_UP, WARM_UP_STOP),
            (MeasuringRequest.PROBLEM, self._data),
            (MeasuringRequest.SUPPORTS,),
        )
        if any(self._ask(request, *arguments) is None for request, *arguments in requests):
            return
        if not self._curve.iteration:
            self._observe(self._stop(self.ladder[-1]))
        self._ask(MeasuringRequest.COMPARE)

    def _observe(self, stop: Stop) -> None:
        """Measure the convergence curve, and compare its iterates with the reported iterations."""
        try:
            result = self._ask(MeasuringRequest.OBSERVE, stop, self._starts.impulses(stop))
        except Fault as fault:
            self._fail(fault)
            return
        if result:
            self._curve = self._judged_curve(*result)
            self._is_contradicted = contradicting_solve(result[0]) is not None

    def pin_to_core(self, core: MeasuringCore) -> None:
        """Pin the processes of the case to a core from now on."""
        super().pin_to_core(core)
        self._controls.pin_to_core(core)

    def finish(self) -> None:
        """Compare the state of the process with that before the solver was created."""
        self._ask(MeasuringRequest.COMPARE)

    def dismiss(self) -> None:
        """Ask the processes of the case to end."""
        self._controls.dismiss()
        super().dismiss()

    def end(self) -> None:
        """End the processes of the case."""
        self._controls.close()
        super().end()

    def _ask(
        self, request: str, *arguments: Any, largest: int = MAX_CONTENT_BYTES
    ) -> tuple[dict[str, Any], FloatArray] | None:
        """Return the answer, after the processes that the solver started have ended; None if the case failed.

        The programs of ``Executable`` solvers may keep running.
        """
        answer, n_allowed = super()._ask(request, *arguments, largest=largest), self.solver.n_processes
        for _ in range(MAX_RESTS):
            if answer is None or self._worker is None or self._worker.n_started() <= n_allowed:
                return answer
            answer = super()._ask(MeasuringRequest.REST) and answer
        n_left = 0 if self._worker is None else self._worker.n_started() - n_allowed
        if n_left:
            self._fail(Fault(Outcome.MISBEHAVED, f"it leaves {counted(n_left, 'process', 'processes')} running"))
        return None if n_left else answer

    def _fail(self, fault: Fault) -> None:
        """End the case, and discard the measurements of a solver that misbehaved."""
        super()._fail(fault)
        if fault.outcome is Outcome.MISBEHAVED:
            self.points = []

    def measure(self, value: float, number: int) -> MeasuredRound | None:
        """Run round ``number`` of timed solves to the tolerance ``value``; return None if the case failed."""
        stop = self._stop(value)
        try:
            start = self._starts.impulses(stop)
            if number == 0:
                self._observe_again(stop, start)
            result = self._timed_round(TimedRound, number, MeasuringRequest.ROUND, stop, ROUND_SECONDS, start)
            if result is None:
                return None
            timed, record, values = result
            self._threads_used = max(self._threads_used, timed.threads_used(self.threads))
            return MeasuredRound(timed, record, self._answers(timed, values))
        except Fault as fault:
            self._fail(fault)
            return None

    def _doubt(self, timed: TimedRound, record: Round, processor_seconds: float) -> str:
        """Return why the processor time of a round is impossible, or which part its own clock does not explain."""
        doubt = super()._doubt(timed, record, processor_seconds)
        if doubt or record.excluded:
            return doubt
        return self._clock.fault(timed, processor_seconds) or ""

    def _answers(self, timed: TimedRound, values: FloatArray) -> FloatArray:
        """Return the distinct answers of a round [N s], shape (n, n_rows).

        Raises:
            Fault: MISBEHAVED, if the number of values or of their iterations is wrong.
        """
        n_rows, count, n_answers = self.problem.n_rows, len(timed.totals), len(timed.answer_iterations)
        if n_rows and (not n_rows <= len(values) <= n_rows * count or len(values) % n_rows):
            reason = f"it returned {len(values)} numbers for {count} solves of {n_rows} rows each"
            raise Fault(Outcome.MISBEHAVED, reason)
        if not 1 <= n_answers <= count or n_answers * n_rows != len(values):
            raise invalid_answer_fault()
        return values.reshape(n_answers, n_rows)

    def needs_round(self, results: Sequence[MeasuredRound]) -> bool:
        """Return whether a point needs another round, because too few are counted; a failed solve is not repeated."""
        last = results[-1]
        excluded = [result.record.wall_seconds for result in results if result.record.excluded]
        if len(excluded) >= MAX_EXCLUDED or sum(excluded) > MAX_EXCLUDED_SECONDS or last.timed.status != Status.SOLVED:
            return False
        n_needed = ROUNDS if last.record.wall_seconds < ENOUGH_SECONDS else 1
        return len(results) - len(excluded) < n_needed

    def point(self, value: float, results: list[MeasuredRound]) -> Point:
        """Judge the impulses of all solves, and return the point with the worst verdict."""
        last = results[-1].timed
        rows = [impulses for result in results for impulses in result.impulses]
        counts = [count for result in results for count in result.timed.answer_iterations]
        judged = judge_answers(self.problem, self.solver.model, value, last.status, rows, iterations=counts)
        outcome = judged.outcome
        reason = last.message[:MAX_REASON_LENGTH] or ("" if last.status is Status.SOLVED else last.status.sentence)
        totals = np.concatenate([result.timed.totals for result in _counted(results)])
        late = late_reason(float(np.median(totals)), self.limits.solve_seconds)
        if outcome is Outcome.SOLVED and late:
            outcome, reason = Outcome.TIME_LIMIT, late
        rounds = [result.record for result in results]
        hashes = [hashlib.sha256(claim).hexdigest()[:16] for claim in judged.claims][:MAX_ANSWERS]
        measured = Measured(
            **iteration_fields(judged.iterations, self._observed.get(value)),
            residual=judged.coulomb.residual,
            model_residual=judged.own.residual,
            **times_from_rounds(rounds),
            rounds=rounds,
            answers=len(hashes),
            hashes=hashes,
            verdict=judged.coulomb.numeric_fields(),
            impulses=judged.worst_impulses,
            impulse_error=judged.impulse_error(self.problem),
        )
        return Point(tolerance=value, outcome=outcome, status=last.status.value, reason=reason, measured=measured)

    def reason_to_stop(self, point: Point) -> str:
        """Return why finer points are not attempted after an unsolved or late one; empty if they are attempted."""
        if point.outcome is Outcome.NOT_ATTEMPTED:
            return point.reason
        has_ended = point.status != Status.SOLVED or point.outcome is Outcome.TIME_LIMIT
        return f"{point.tolerance:g} already ended {point.outcome.value}" if has_ended else ""

    def add_point(self, level: int, results: list[MeasuredRound]) -> None:
        """Add one point of the ladder, and check its times by first solves in fresh processes.

        In later passes, check them only if the new rounds do not explain the time of the earlier first solves. At one
        random level, compare them with solves of copies as well, unless the solver starts warm.
        """
        super().add_point(level, results)
        self.points = keep_finest_impulses(self.points)
        point = self.points[level]
        measured = point.measured
        needs_control = point.is_repeated and point.outcome is not Outcome.WRONG and self.problem.n_rows
        if measured is None or not needs_control:
            return
        seconds = float(np.median([result.timed.undisturbed_seconds for result in _counted(results)]))
        try:
            if level == self._copy_level and not self.solver.starts_warm:  # no start suits a copy
                point = self._compared_with_copies(point, measured, seconds)
            is_controlled = measured.first_seconds and is_explained(seconds, min(measured.first_seconds))
            if point.outcome is not Outcome.WRONG and not is_controlled:
                point = self._compared_with_first_solves(point, seconds)
        except Fault as fault:
            self._fail(fault)
            return
        self.points[level] = point

    def _compared_with_copies(self, point: Point, measured: Measured, seconds: float) -> Point:
        """Solve copies of the problem; return the point with their times, after judging their answers."""
        stop = self._stop(point.tolerance)
        copies = self._controls.copies(stop, seconds, partial(self._measure_again, stop))
        point = replace(point, measured=_with_times(measured, "copy", copies))
        return judge_control_solves(self.problem, self.solver.model, point, copies, ON_COPY)

    def _compared_with_first_solves(self, point: Point, seconds: float) -> Point:
        """Run first solves of a point; return the point with their times, after judging their answers."""
        stop, measured = self._stop(point.tolerance), point.measured
        start = self._starts.impulses(stop)
        first_solves = self._controls.first_solves(stop, seconds, partial(self._measure_again, stop), start)
        if measured is not None:
            point = replace(point, measured=_with_times(measured, "first", first_solves))
        return judge_control_solves(self.problem, self.solver.model, point, first_solves, IN_FIRST_SOLVE)

    def _measure_again(self, stop: Stop) -> float:
        """Return the median time of one more round [s].

        Raises:
            Fault: if the process gives no valid answer.
        """
        if self._worker is None:
            raise invalid_answer_fault()
        began = time.monotonic()
        answer, _ = self._worker.ask(MeasuringRequest.ROUND, stop, ROUND_SECONDS, self._starts.impulses(stop))
        return TimedRound.read(answer, time.monotonic() - began, self.is_built_in).undisturbed_seconds

    def _observe_again(self, stop: Stop, start: FloatArray | None) -> None:
        """Observe a solve to the tolerance of ``stop`` if the solver contradicted itself before."""
        result = self._ask(MeasuringRequest.OBSERVE, stop, start) if self._is_contradicted else None
        self._observed[stop.tolerance] = None if result is None else contradicting_solve(result[0])

    @property
    def threads(self) -> int:
        """Number of threads that the solver declares."""
        return self.solver.threads

    def identity(self) -> dict[str, Any]:
        """Return the fields of the record that identify problem and solver."""
        return {
            "problem": self.problem.name,
            "digest": self.problem.digest,
            "start": self._starts.digest,
            "solver": self.solver.name,
            "model": str(self.solver.model),
            "has_iterates": self.solver.has_iterates,
            "is_randomised": self.solver.is_randomised,
            "threads": self.threads,
            "threads_used": self._threads_used,
            "n_rows": self.problem.n_rows,
            "n_contacts": self.problem.n_contacts,
        }

    def _stop(self, tolerance: float) -> Stop:
        return Stop(tolerance, self.limits.max_iterations, self.limits.solve_seconds)

    def _judged_curve(self, answer: dict[str, Any], iterates: FloatArray) -> Curve:
        """Return the judged residuals of the observed iterates; fail the case if the answer is invalid."""
        iterations: Any = answer.get("iterations")
        if not are_iterations(iterations) or len(iterations) * self.problem.n_rows != len(iterates):
            self._fail(invalid_answer_fault())
            return self._curve
        residual, problem = Residual(self.problem), self.problem
        rows = iterates.reshape(len(iterations), problem.n_rows)
        return Curve(iteration=iterations, residual=[residual.judged(problem, impulses) for impulses in rows])


def _counted(results: list[MeasuredRound]) -> list[MeasuredRound]:
    """Return the rounds that are not excluded, or all rounds if all are excluded."""
    return [result for result in results if not result.record.excluded] or results


def _with_times(measured: Measured, kind: Literal["first", "copy"], solves: Sequence[ControlSolve]) -> Measured:
    """Return measurements with the times of undisturbed first solves or copies, each with that of repeated solves."""
    counted_solves = [solve for solve in solves if solve.is_first and solve.is_counted]
    times = {
        f"{kind}_seconds": [solve.seconds for solve in counted_solves],
        f"{kind}_repeated_seconds": [solve.repeated for solve in counted_solves],
    }
    return replace(measured, **{name: [*getattr(measured, name), *new] for name, new in times.items()})


@lru_cache(maxsize=4)
def warm_up_data(problem: ContactProblem) -> bytes:
    """Return the file content of a perturbed copy to warm up on, the same for all cases of a problem."""
    return problem_bytes(perturbed_copy(problem))
