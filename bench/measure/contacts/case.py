"""One solver on one contact problem, as it is measured from outside."""

import hashlib
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from msgspec.structs import replace

from ....problems.arrays import FloatArray
from ....problems.contact.judge import Verdict
from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ....solvers.interface import Status, Stop
from ...isolation.worker import LARGEST_CONTENT, Fault, no_answer
from ...plugins.contestants import Contestant
from ...plugins.remote_solver import are_iterations
from ...store.impulses import Impulses, number_of, worst
from ...store.outcome import Outcome, claim_reason, late_reason, point_outcome, verdicts
from ...store.records import MOST_ANSWERS, CaseRecord, Curve, Limits, Measured, Point, Round
from ..ladder import LONGEST_REASON, LadderCase
from ..pace import free_probe_seconds, free_share, slowness
from ..points import joined, marked_together, times_of, with_impulses_at_the_finest
from .clock_account import ClockAccount
from .control import THOROUGH, Controls, Solve, explains
from .protocol import TIMED, MeasuringTask, medians_on_free_core, round_fault
from .variants import another_data
from .verdicts import RememberedVerdicts

DIFFERENT = " different answers"
"""What stands behind their number in a reason."""

ROUND_SECONDS = 0.005
"""Wall time of a round at least; every round has at least one timed solve."""

ROUNDS = 2
"""Rounds of a point in a pass."""

ENOUGH_SECONDS = 0.02
"""Time on the clock of a round after which no other one follows in the same pass."""


@dataclass(frozen=True)
class Visit:
    """One pass over the cases of a problem.

    Attributes:
        session: number of the session of the run.
        number: number of the pass in it; points with as many rounds before this pass have been in it already.
        points: solver and level of the points that are measured; all that have fewer rounds if None.
        verdicts: those of the run.
    """

    session: int = 0
    number: int = 0
    points: Collection[tuple[str, int]] | None = None
    verdicts: RememberedVerdicts = field(default_factory=RememberedVerdicts)


RESTS = 20
"""Rests in which processes that a solver has started may end, before it is refused for them."""


class Case(LadderCase):
    """A solver on a problem; the ladder is that of its tolerances.

    Attributes:
        problem: the problem.
        solver: the solver.
        visit: the pass that it is in.
    """

    def __init__(
        self,
        problem: ContactProblem,
        solver: Contestant,
        limits: Limits,
        ladder: Sequence[float],
        problem_data: bytes,
        stored: CaseRecord | None = None,
        visit: Visit = Visit(),
    ) -> None:
        """Note what to measure, and what is measured already."""
        super().__init__(ladder, limits, stored)
        self.problem, self.solver, self.visit, self._data = problem, solver, visit, problem_data
        self._observed = next(filter(None, map(_known_contradiction, self.points)), None)
        self._controls = Controls(problem, another_data(problem), solver, limits)
        self._clock = ClockAccount(problem)
        self._slowness: list[float] = []
        self.is_solvable = None if problem.answer is None else problem.answer.solvable

    @property
    def rounds(self) -> Sequence[int]:
        """Two, apart from each other; of solves that take long, the first one is enough."""
        return range(ROUNDS)

    def is_left(self, level: int) -> bool:
        """Whether a point is missing, or another round of it belongs to this pass."""
        if level >= len(self.points):
            return True
        if self.visit.points is not None and (self.solver.name, level) not in self.visit.points:
            return False
        point = self.points[level]
        if point.is_repeated:
            return self.visit.points is not None or point.n_passes <= self.visit.number
        return (point.is_marred or point.outcome is Outcome.NOT_ATTEMPTED) and not self._end_before(level)

    def begin(self) -> None:
        """Start the process, warm up on another problem of the same kinds, and take the convergence curve of this one.

        A solver that refuses either is recorded with its reason.
        """
        self._start(MeasuringTask(self._controls.other, self.solver))
        requests = (("supports",), ("warm_up", THOROUGH), ("problem", self._data), ("supports",))
        if any(self._ask(request, *arguments) is None for request, *arguments in requests):
            return
        seen = None if self._curve.iteration else self._ask("observe", self._stop(self.ladder[-1]))
        if seen:
            self._curve = self._judged_curve(*seen)
            self._observed = _contradicted_count(seen[0])

    def dismiss(self) -> None:
        """Let its processes end."""
        self._controls.dismiss()
        super().dismiss()

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
        """Whether the solver says that it solved, and soon: a failing solve is not repeated."""
        return bool(answer["status"] == Status.SOLVED) and float(np.sum(answer["times"])) < ENOUGH_SECONDS

    def point(self, value: float, answers: list[dict[str, Any]]) -> Point:
        """Judge the impulses of all solves, of which the worst count; what does not end solved ends the ladder."""
        last = answers[-1]
        times = np.array([pair for answer in answers for pair in answer["times"]])
        status = Status(last["status"])
        outcome, own, coulomb, different, claims, kept = self._judged(value, status, answers)
        reason = last["message"][:LONGEST_REASON] or ("" if status is Status.SOLVED else status.sentence)
        late = late_reason(float(np.median(times[:, 1])), self.limits.solve_seconds)
        if outcome is Outcome.SOLVED and late:
            outcome, reason = Outcome.TIME_LIMIT, late
        iterations, known = self._counted(last["iterations"]), self.problem.answer
        found = [] if known is None else [known.impulse_error(impulses) for impulses in different]
        errors = [error for error in found if error is not None]
        rounds = [self._round(answer, turn) for turn, answer in enumerate(answers)]
        hashes = [hashlib.sha256(claim).hexdigest()[:16] for claim in claims][:MOST_ANSWERS]
        measured = Measured(
            iterations=iterations,
            claimed_iterations=None if iterations == last["iterations"] else last["iterations"],
            residual=coulomb.residual,
            model_residual=own.residual,
            **times_of(rounds),
            rounds=rounds,
            answers=len(hashes),
            hashes=hashes,
            verdict=coulomb.numbers(),
            impulses=kept,
            impulse_error=max(errors, default=None),
        )
        point = Point(tolerance=value, outcome=outcome, status=status.value, reason=reason, measured=measured)
        return self._with_answers_said(point)

    def joined(self, before: Point, now: Point) -> Point:
        """Return a point with the rounds of both; the worse end, the worse answer and all hashes count."""
        return self._with_answers_said(joined(before, now))

    def end_after(self, point: Point) -> str:
        """Return that a point did not end solved in time, if so: finer ones will not."""
        if point.outcome is Outcome.NOT_ATTEMPTED:
            return point.reason
        is_ended = point.status != Status.SOLVED or point.outcome is Outcome.TIME_LIMIT
        return f"{point.tolerance:g} already ended {point.outcome.value}" if is_ended else ""

    def _round(self, answer: dict[str, Any], turn: int) -> Round:
        """Return the times of the answer to "round", as they are on a free core: first quartiles of its solves.

        The first solves of a round find caches cold.
        """
        times, work, probes = (np.array(answer[name]) for name in TIMED)
        totals, met = times.sum(axis=1), probes / free_probe_seconds()
        self._slowness += met.tolist()
        met = slowness(met, float(np.mean(self._slowness)), totals)
        free = times * free_share(totals, work, met)[:, None]
        prepare, solve = (float(np.quantile(column, 0.25)) for column in free.T)
        wall = float(totals.sum())
        return Round(
            session=self.visit.session,
            number=self.visit.number,
            turn=turn,
            prepare_seconds=prepare,
            solve_seconds=solve,
            total_seconds=float(np.quantile(free.sum(axis=1), 0.25)),
            repeats=len(times),
            cpu=float(work.sum()) / wall if wall > 0.0 else 1.0,
            slowness=float(np.median(met)),
        )

    def _with_answers_said(self, point: Point) -> Point:
        """Return a point that says so if a solver that declares no randomness answers differently."""
        measured = point.measured
        if measured is None or measured.answers < 2 or self.solver.is_randomised:
            return point
        count = f"{'at least ' if measured.answers == MOST_ANSWERS else ''}{measured.answers}"
        said = point.reason.partition(DIFFERENT)[2].partition("; ")[2] if DIFFERENT in point.reason else point.reason
        reason = f"{count}{DIFFERENT} in {measured.repeats} solves{said and '; '}{said}"
        return replace(point, reason=reason)

    def add_point(self, level: int, answers: list[dict[str, Any]]) -> None:
        """Keep one point of the ladder, once a first solve in a fresh process confirms what was timed.

        In later rounds this is done again where one is faster than that first solve explains.
        """
        super().add_point(level, answers)
        self.points = marked_together(with_impulses_at_the_finest(self.points))
        point = self.points[level]
        measured = point.measured
        if measured is None or not point.is_repeated or point.outcome is Outcome.WRONG or not self.problem.n_rows:
            return
        seconds, value = point.rounds[-1].total_seconds, self.ladder[level]
        if measured.first_seconds is not None and explains(seconds, measured.first_seconds):
            return
        try:
            first = self._controls.first_solve(self._stop(value), seconds, partial(self._median_again, value))
        except Fault as fault:
            self._fail(fault)
            return
        self.points[level] = self._confirmed(
            replace(point, measured=replace(measured, first_seconds=first.seconds)), first
        )

    def _confirmed(self, point: Point, first: Solve) -> Point:
        """Return a point as a first solve leaves it: its answer counts as all others do, but for want of time."""
        if first.status is Status.TIME_LIMIT or point.measured is None:
            return point
        model, tolerance = self.solver.model, point.tolerance
        own, coulomb = verdicts(self.problem, first.impulses, model)
        outcome = point_outcome(first.status, tolerance, model, own, coulomb)
        if outcome in (Outcome.SOLVED, Outcome.RELAXED):
            return point
        reason = claim_reason(outcome, tolerance, model, own.residual) or f"it ends {outcome.value}"
        worse = {
            "residual": max(point.measured.residual, coulomb.residual, key=number_of),
            "model_residual": max(point.measured.model_residual, own.residual, key=number_of),
            "impulses": worst([*point.measured.impulses, Impulses.of(first.impulses, own, coulomb)]),
        }
        return replace(
            point,
            outcome=outcome,
            status=first.status.value,
            reason=f"in a first solve in a fresh process, {reason}",
            measured=replace(point.measured, **worse),
        )

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
        return medians_on_free_core(answer)[0]

    def _judged(
        self, tolerance: float, status: Status, answers: list[dict[str, Any]]
    ) -> tuple[Outcome, Verdict, Verdict, list[FloatArray], list[bytes], list[Impulses]]:
        """Return outcome, worst verdicts under the solver's own model and Coulomb's law, answers, claims, what is kept.

        All solves but the last one claim to have solved; times are those of all, so the residuals are the worst of all.
        """
        rows = [impulses for answer in answers for impulses in answer["impulses"]]
        different = {impulses.tobytes(): impulses for impulses in rows}
        judge, model = self.visit.verdicts, self.solver.model
        judged = {key: judge.of(self.problem, impulses, model) for key, impulses in different.items()}
        claims = list(dict.fromkeys(one.tobytes() for one in (rows if status is Status.SOLVED else rows[:-1])))
        outcomes = {point_outcome(Status.SOLVED, tolerance, model, *judged[key]) for key in claims}
        outcome = Outcome(status.value)
        if Outcome.WRONG in outcomes:
            outcome = Outcome.WRONG
        elif status is Status.SOLVED and Outcome.RELAXED in outcomes:
            outcome = Outcome.RELAXED
        under_model, under_coulomb = (max(judged, key=lambda key: judged[key][law].residual) for law in (0, 1))
        kept = worst(Impulses.of(different[key], *judged[key]) for key in dict.fromkeys((under_coulomb, under_model)))
        own, coulomb = judged[under_model][0], judged[under_coulomb][1]
        return outcome, own, coulomb, list(different.values()), claims, kept

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


def _known_contradiction(point: Point) -> tuple[int, int] | None:
    """Return the observed and the claimed iterations of a stored point; None where they agree."""
    measured = point.measured
    if measured is None or measured.claimed_iterations is None:
        return None
    return measured.iterations, measured.claimed_iterations


def _contradicted_count(answer: dict[str, Any]) -> tuple[int, int] | None:
    """Return how often the observer was called and the iterations that the solver claims; None where they agree."""
    calls, claimed = answer.get("calls"), answer.get("claimed")
    if type(calls) is not int or type(claimed) is not int or min(calls, claimed) < 0 or calls in (0, claimed):
        return None
    return calls, claimed
