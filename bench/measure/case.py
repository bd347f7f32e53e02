"""One solver on one contact problem, as it is measured from outside."""

import time
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from msgspec.structs import replace

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Verdict
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...solvers.interface import Status, Stop
from ..isolation.worker import LARGEST_CONTENT, Fault, no_answer
from ..plugins.contestants import Contestant
from ..plugins.remote_solver import are_iterations
from ..store.outcome import Outcome, claim_reason, late_reason, point_outcome, verdicts
from ..store.records import Curve, Limits, Measured, Point
from .clock_account import ClockAccount
from .control import Controls, Solve
from .ladder import LONGEST_REASON, LadderCase, quartiles
from .protocol import MeasuringTask, round_fault
from .variants import another_data

ROUNDS = 5
"""Rounds for each point of the ladder; every round has at least one timed solve."""

ROUND_SECONDS = 0.02
"""Wall time of a round at least, so that a point is measured for at least 0.1 s."""


RESTS = 20
"""Rests in which processes that a solver has started may end, before it is refused for them."""


class Case(LadderCase):
    """A solver on a problem; the ladder is that of its tolerances.

    Attributes:
        problem: the problem.
        solver: the solver.
    """

    rounds = ROUNDS

    def __init__(
        self,
        problem: ContactProblem,
        solver: Contestant,
        limits: Limits,
        ladder: Sequence[float],
        problem_data: bytes,
    ) -> None:
        super().__init__(ladder, limits)
        self.problem, self.solver, self._data = problem, solver, problem_data
        self._observed: tuple[int, int] | None = None
        self._controls = Controls(problem, another_data(problem), solver, limits)
        self._clock = ClockAccount(problem)
        self.is_solvable = None if problem.answer is None else problem.answer.solvable

    def begin(self) -> None:
        """Start the process, warm up on another problem of the same kinds, and take the convergence curve of this one.

        A solver that refuses either is recorded with its reason.
        """
        self._start(MeasuringTask(self._controls.other, self.solver))
        requests = (("supports",), ("warm_up", self._controls.short), ("problem", self._data), ("supports",))
        if any(self._ask(request, *arguments) is None for request, *arguments in requests):
            return
        seen = self._ask("observe", self._stop(self.ladder[-1]))
        if seen:
            self._curve = self._judged_curve(*seen)
            self._observed = _contradicted_count(seen[0])

    def end(self) -> None:
        """End its processes."""
        self._controls.close()
        super().end()

    def _ask(
        self, request: str, *arguments: Any, largest: int = LARGEST_CONTENT
    ) -> tuple[dict[str, Any], FloatArray] | None:
        """Return the answer of the process, once nothing that it has started runs any more."""
        found = super()._ask(request, *arguments, largest=largest)
        for _ in range(RESTS):
            if found is None or self._worker is None or not self._worker.n_started():
                return found
            found = super()._ask("rest") and found
        left = 0 if self._worker is None else self._worker.n_started()
        if left:
            self._fail(Fault(Outcome.MISBEHAVED, f"it leaves {left} {'process' if left == 1 else 'processes'} running"))
        return None if left else found

    def _fail(self, fault: Fault) -> None:
        """End the case; of one that misbehaved, what was measured before means nothing."""
        super()._fail(fault)
        if fault.outcome is Outcome.MISBEHAVED:
            self.points = []

    def measure(self, value: float, number: int) -> dict[str, Any] | None:
        """Do one round of timed solves; return its raw answer with the impulses, or None if the case failed."""
        began, worked = time.monotonic(), self._worker.processor_seconds() if self._worker else 0.0
        found = self._ask("round", self._stop(value), ROUND_SECONDS)
        if found is None:
            return None
        answer, numbers = found
        passed = time.monotonic() - began
        worked = (self._worker.processor_seconds() if self._worker else 0.0) - worked
        fault = round_fault(answer, passed) or self._clock.fault(answer["times"], passed, worked)
        n_rows = self.problem.n_rows
        if fault is None and n_rows:
            count = len(answer["times"])
            if not n_rows <= len(numbers) <= n_rows * count or len(numbers) % n_rows:
                fault = f"it returned {len(numbers)} numbers for {count} solves of {n_rows} rows each"
        if fault is not None:
            self._fail(Fault(Outcome.MISBEHAVED, fault))
            return None
        return {**answer, "impulses": numbers.reshape(-1, n_rows) if n_rows else np.zeros((1, 0))}

    def goes_on(self, answer: dict[str, Any]) -> bool:
        """Whether the solver says that it solved: a failing solve is not repeated."""
        return bool(answer["status"] == Status.SOLVED)

    def point(self, value: float, answers: list[dict[str, Any]]) -> Point:
        """Judge the impulses of all solves, of which the worst count; what does not end solved ends the ladder."""
        last = answers[-1]
        times = np.array([pair for answer in answers for pair in answer["times"]])
        status = Status(last["status"])
        outcome, own, coulomb, different = self._judged(value, status, answers)
        reason = last["message"][:LONGEST_REASON] or ("" if status is Status.SOLVED else status.sentence)
        late = late_reason(float(np.median(times[:, 1])), self.limits.solve_seconds)
        if outcome is Outcome.SOLVED and late:
            outcome, reason = Outcome.TIME_LIMIT, late
        if len(different) > 1 and not self.solver.is_randomised:
            reason = f"{len(different)} different answers in {len(times)} solves{reason and '; '}{reason}"
        iterations, known = self._counted(last["iterations"]), self.problem.answer
        found = [] if known is None else [known.impulse_error(impulses) for impulses in different]
        errors = [error for error in found if error is not None]
        measured = Measured(
            iterations=iterations,
            claimed_iterations=None if iterations == last["iterations"] else last["iterations"],
            residual=coulomb.residual,
            model_residual=own.residual,
            prepare_seconds=quartiles(times[:, 0]),
            solve_seconds=quartiles(times[:, 1]),
            total_seconds=quartiles(times.sum(axis=1)),
            repeats=len(times),
            answers=len(different),
            verdict=coulomb.numbers(),
            impulse_error=max(errors, default=None),
        )
        if status is not Status.SOLVED or outcome is Outcome.TIME_LIMIT:
            self._ended_by = f"{value:g} already ended {outcome.value}"
        return Point(tolerance=value, outcome=outcome, status=status.value, reason=reason, measured=measured)

    def add_point(self, value: float, answers: list[dict[str, Any]]) -> None:
        """Keep one point of the ladder, once a first solve in a fresh process confirms what was timed."""
        super().add_point(value, answers)
        point = self.points[-1]
        if point.outcome not in (Outcome.SOLVED, Outcome.RELAXED) or point.measured is None or not self.problem.n_rows:
            return
        try:
            first = self._controls.first_solve(
                self._stop(value), point.measured.total_seconds.median, partial(self._median_again, value)
            )
        except Fault as fault:
            self._fail(fault)
            return
        outcome, reason = self._of_first_solve(value, first)
        if outcome not in (Outcome.SOLVED, Outcome.RELAXED):
            self.points[-1] = replace(point, outcome=outcome, reason=reason)
            self._ended_by = f"{value:g} already ended {outcome.value}"

    def _of_first_solve(self, tolerance: float, first: Solve) -> tuple[Outcome, str]:
        """Return the outcome of a first solve, and the same in words; want of time is none, where times agree."""
        if first.status is Status.TIME_LIMIT:
            return Outcome.SOLVED, ""
        own, coulomb = verdicts(self.problem, first.impulses, self.solver.model)
        outcome = point_outcome(first.status, tolerance, self.solver.model, own, coulomb)
        reason = claim_reason(outcome, tolerance, self.solver.model, own.residual) or f"it ends {outcome.value}"
        return outcome, f"in a first solve in a fresh process, {reason}"

    def _median_again(self, value: float) -> float:
        """Return the median time [s] of one more round at a level.

        Raises:
            Fault: if there is none.
        """
        if self._worker is None:
            raise no_answer()
        began = time.monotonic()
        answer, _ = self._worker.ask("round", self._stop(value), ROUND_SECONDS)
        fault = round_fault(answer, time.monotonic() - began)
        if fault is not None:
            raise Fault(Outcome.MISBEHAVED, fault)
        return float(np.median(np.array(answer["times"]).sum(axis=1)))

    def _judged(
        self, tolerance: float, status: Status, answers: list[dict[str, Any]]
    ) -> tuple[Outcome, Verdict, Verdict, list[FloatArray]]:
        """Return the outcome, the worst verdicts under the solver's own model and Coulomb's law, and the answers.

        All solves but the last one claim to have solved; times are those of all, so the residuals are the worst of all.
        """
        rows = [impulses for answer in answers for impulses in answer["impulses"]]
        different = {impulses.tobytes(): impulses for impulses in rows}
        judged = {key: verdicts(self.problem, impulses, self.solver.model) for key, impulses in different.items()}
        claims = {impulses.tobytes() for impulses in (rows if status is Status.SOLVED else rows[:-1])}
        outcomes = {point_outcome(Status.SOLVED, tolerance, self.solver.model, *judged[key]) for key in claims}
        outcome = Outcome(status.value)
        if Outcome.WRONG in outcomes:
            outcome = Outcome.WRONG
        elif status is Status.SOLVED and Outcome.RELAXED in outcomes:
            outcome = Outcome.RELAXED
        own, coulomb = (max(found, key=_residual) for found in zip(*judged.values(), strict=True))
        return outcome, own, coulomb, list(different.values())

    def _counted(self, claimed: int) -> int:
        """Return the iterations of a solve that claims ``claimed``.

        Where the observed solve showed another number than the solver claimed of it, claims are corrected by their
        ratio; a solver that claims none has those of the observed solve.
        """
        if self._observed is None:
            return claimed
        observed, claimed_then = self._observed
        return round(claimed * observed / claimed_then) if claimed and claimed_then else observed

    def identity(self) -> dict[str, Any]:
        """Return problem and solver."""
        return {
            "problem": self.problem.name,
            "digest": self.problem.digest,
            "solver": self.solver.name,
            "model": str(self.solver.model),
            "has_iterates": self.solver.has_iterates,
            "n_rows": self.problem.n_rows,
            "n_contacts": self.problem.n_contacts,
        }

    def _stop(self, tolerance: float) -> Stop:
        return Stop(tolerance, self.limits.max_iterations, self.limits.solve_seconds)

    def _judged_curve(self, answer: dict[str, Any], iterates: FloatArray) -> Curve:
        """Return the judged residual of every iterate shown: the judge runs where no plugin can reach it."""
        iterations: Any = answer.get("iterations")
        if not are_iterations(iterations) or len(iterations) * self.problem.n_rows != len(iterates):
            self._fail(no_answer())
            return self._curve
        residual, problem = Residual(self.problem), self.problem
        rows = iterates.reshape(len(iterations), problem.n_rows)
        return Curve(
            iteration=iterations,
            residual=[float(residual(impulses, problem.relative_velocity(impulses))) for impulses in rows],
        )


def _contradicted_count(answer: dict[str, Any]) -> tuple[int, int] | None:
    """Return how often the observer was called and the iterations that the solver claims; None where they agree."""
    calls, claimed = answer.get("calls"), answer.get("claimed")
    if type(calls) is not int or type(claimed) is not int or min(calls, claimed) < 0 or calls in (0, claimed):
        return None
    return calls, claimed


def _residual(verdict: Verdict) -> float:
    return verdict.residual
