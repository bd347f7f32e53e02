"""One case as it is measured from outside: its process, its ladder, and the record it becomes."""

import time
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Residual
from ...problems.contact.problem import ContactProblem
from ...solvers.interface import Status, Stop
from ..isolation.worker import LARGEST_CONTENT, Fault, Worker, numbers_of
from ..store.outcome import Outcome, point_outcome, verdicts
from ..store.records import CaseRecord, Curve, Limits, Measured, Point, Quartiles
from .contestants import Contestant
from .protocol import MeasuringTask, round_fault

LONGEST_REASON = 2000
"""Characters that are kept of what a solver says in words."""


@dataclass
class Case:
    """A solver on a problem.

    Attributes:
        problem: the problem.
        solver: the solver.
        limits: time, memory and iterations.
        outcome: MEASURED, until something else comes of it.
        points: the finished points of the ladder, as they are stored.
    """

    problem: ContactProblem
    solver: Contestant
    limits: Limits
    outcome: Outcome = Outcome.MEASURED
    points: list[Point] = field(default_factory=list)
    _reason: str = ""
    _traceback: str = ""
    _output: str = ""
    _curve: Curve = field(default_factory=Curve)
    _worker: Worker | None = None
    _seconds: float = 0.0
    _memory: int = 0
    _ended_by: str = ""

    def begin(self, problem_data: bytes, finest: float) -> None:
        """Start the process, ask whether the solver supports the problem, warm up, and take the convergence curve."""
        limits = self.limits
        try:
            task = MeasuringTask(problem_data, self.solver)
            self._worker = Worker(task, limits.case_seconds, limits.memory_bytes)
        except Fault as unsent:
            self._fail(unsent)
            return
        found = self._ask("supports")
        if found is None:
            return
        refusal = found[0].get("refusal")
        if not isinstance(refusal, str):
            self._fail(Fault(Outcome.MISBEHAVED, "its process sent something that is no answer"))
        elif refusal:
            self._fail(Fault(Outcome.UNSUPPORTED, refusal[:LONGEST_REASON]))
        else:
            short = Stop(1e-1, max_iterations=20, max_seconds=limits.solve_seconds)
            if self._ask("warm_up", short) is not None and (seen := self._ask("observe", self._stop(finest))):
                self._curve = self._judged_curve(*seen)

    @property
    def is_open(self) -> bool:
        """Whether there is more of the ladder to measure."""
        return self._worker is not None and self.outcome is Outcome.MEASURED and not self._ended_by

    def measure(self, tolerance: float, seconds: float) -> dict[str, Any] | None:
        """Do one round of timed solves; return its raw answer with the impulses, or None if the case failed."""
        n_rows = self.problem.n_rows
        began = time.monotonic()
        found = self._ask("round", self._stop(tolerance), seconds, largest=n_rows * 8)
        if found is None:
            return None
        answer, impulses = found
        fault = round_fault(answer, time.monotonic() - began)
        if fault is None and len(impulses) != n_rows:
            fault = f"it returned {len(impulses)} numbers, not {n_rows}"
        if fault is not None:
            self._fail(Fault(Outcome.MISBEHAVED, fault))
            return None
        return {**answer, "impulses": impulses}

    def add_point(self, tolerance: float, rounds: list[dict[str, Any]]) -> None:
        """Judge and keep one point of the ladder from its rounds."""
        last = rounds[-1]
        times = np.array([pair for answer in rounds for pair in answer["times"]])
        status, impulses = Status(last["status"]), last["impulses"]
        own, coulomb = verdicts(self.problem, impulses, self.solver.model)
        outcome = point_outcome(status, tolerance, self.solver.model, own, coulomb)
        measured = Measured(
            iterations=last["iterations"],
            residual=coulomb.residual,
            model_residual=own.residual,
            prepare_seconds=_quartiles(times[:, 0]),
            solve_seconds=_quartiles(times[:, 1]),
            total_seconds=_quartiles(times.sum(axis=1)),
            repeats=len(times),
            verdict={key: value for key, value in asdict(coulomb).items() if key != "model"},
            impulse_error=self._impulse_error(impulses),
        )
        reason = last["message"][:LONGEST_REASON] or ("" if status is Status.SOLVED else status.sentence)
        self.points.append(
            Point(tolerance=tolerance, outcome=outcome, status=status.value, reason=reason, measured=measured)
        )
        if status is not Status.SOLVED:
            self._ended_by = f"{tolerance:g} already ended {status.value}"

    def skip_point(self, tolerance: float) -> None:
        """Note a point that was not attempted, because a coarser one did not end solved."""
        reason = self._ended_by or self._reason
        self.points.append(Point(tolerance=tolerance, outcome=Outcome.NOT_ATTEMPTED, status="", reason=reason))

    def end(self) -> None:
        """End the process and keep its output if the case failed."""
        if self._worker is not None:
            self._seconds, self._memory = self._worker.busy_seconds, self._worker.peak_memory_bytes
            if self.outcome is not Outcome.MEASURED:
                self._output = self._worker.output()
            self._worker.close()
            self._worker = None

    def record(self) -> CaseRecord:
        """Return the case as it is stored."""
        return CaseRecord(
            problem=self.problem.name,
            digest=self.problem.digest,
            solver=self.solver.name,
            model=str(self.solver.model),
            has_iterates=self.solver.has_iterates,
            n_rows=self.problem.n_rows,
            n_contacts=self.problem.n_contacts,
            outcome=self.outcome,
            reason=self._reason,
            traceback=self._traceback,
            stderr=self._output,
            wall_seconds=self._seconds,
            peak_memory_bytes=self._memory,
            curve=self._curve,
            points=self.points,
        )

    def _stop(self, tolerance: float) -> Stop:
        return Stop(tolerance, self.limits.max_iterations, self.limits.solve_seconds)

    def _judged_curve(self, answer: dict[str, Any], iterates: FloatArray) -> Curve:
        """Return the judged residual of every iterate shown: the judge runs where no plugin can reach it."""
        iterations = answer.get("iterations")
        if not isinstance(iterations, list) or len(iterations) * self.problem.n_rows != len(iterates):
            self._fail(Fault(Outcome.MISBEHAVED, "its process sent something that is no answer"))
            return self._curve
        residual, problem = Residual(self.problem), self.problem
        rows = iterates.reshape(len(iterations), problem.n_rows)
        return Curve(
            iteration=[int(iteration) for iteration in iterations],
            residual=[float(residual(impulses, problem.relative_velocity(impulses))) for impulses in rows],
        )

    def _ask(
        self, request: str, *arguments: Any, largest: int = LARGEST_CONTENT
    ) -> tuple[dict[str, Any], FloatArray] | None:
        assert self._worker is not None
        try:
            answer, content = self._worker.ask(request, *arguments, largest=largest)
            return answer, numbers_of(content)
        except Fault as fault:
            self._fail(fault)
            return None

    def _fail(self, fault: Fault) -> None:
        self.outcome, self._reason, self._traceback = fault.outcome, fault.reason, fault.traceback
        self.end()

    def _impulse_error(self, impulses: FloatArray) -> float | None:
        return None if self.problem.answer is None else self.problem.answer.impulse_error(impulses)


def _quartiles(values: FloatArray) -> Quartiles:
    low, first, median, third = map(float, np.quantile(values, (0.0, 0.25, 0.5, 0.75)))
    return Quartiles(min=low, q1=first, median=median, q3=third)
