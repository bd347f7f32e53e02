"""One solver on one contact problem, as it is measured from outside."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...solvers.interface import Status, Stop
from ..isolation.worker import Fault
from ..plugins.contestants import Contestant
from ..store.outcome import Outcome, point_outcome, verdicts
from ..store.records import Curve, Limits, Measured, Point
from .ladder import LONGEST_REASON, LadderCase, quartiles
from .protocol import MeasuringTask, round_fault

ROUNDS = 5
"""Rounds for each point of the ladder; every round has at least one timed solve."""

ROUND_SECONDS = 0.02
"""Wall time of a round at least, so that a point is measured for at least 0.1 s."""


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

    def begin(self) -> None:
        """Start the process, ask whether the solver supports the problem, warm up, and take the convergence curve."""
        self._start(MeasuringTask(self._data, self.solver))
        short = Stop(1e-1, max_iterations=20, max_seconds=self.limits.solve_seconds)
        if self._ask("supports") is not None and self._ask("warm_up", short) is not None:
            seen = self._ask("observe", self._stop(self.ladder[-1]))
            if seen:
                self._curve = self._judged_curve(*seen)

    def measure(self, value: float, number: int) -> dict[str, Any] | None:
        """Do one round of timed solves; return its raw answer with the impulses, or None if the case failed."""
        n_rows = self.problem.n_rows
        began = time.monotonic()
        found = self._ask("round", self._stop(value), ROUND_SECONDS, largest=n_rows * 8)
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

    def goes_on(self, answer: dict[str, Any]) -> bool:
        """Whether the solver says that it solved: a failing solve is not repeated."""
        return bool(answer["status"] == Status.SOLVED)

    def point(self, value: float, answers: list[dict[str, Any]]) -> Point:
        """Judge the last impulses; a solve that does not end solved ends the ladder."""
        last = answers[-1]
        times = np.array([pair for answer in answers for pair in answer["times"]])
        status, impulses = Status(last["status"]), last["impulses"]
        own, coulomb = verdicts(self.problem, impulses, self.solver.model)
        measured = Measured(
            iterations=last["iterations"],
            residual=coulomb.residual,
            model_residual=own.residual,
            prepare_seconds=quartiles(times[:, 0]),
            solve_seconds=quartiles(times[:, 1]),
            total_seconds=quartiles(times.sum(axis=1)),
            repeats=len(times),
            verdict=coulomb.numbers(),
            impulse_error=None if self.problem.answer is None else self.problem.answer.impulse_error(impulses),
        )
        if status is not Status.SOLVED:
            self._ended_by = f"{value:g} already ended {status.value}"
        return Point(
            tolerance=value,
            outcome=point_outcome(status, value, self.solver.model, own, coulomb),
            status=status.value,
            reason=last["message"][:LONGEST_REASON] or ("" if status is Status.SOLVED else status.sentence),
            measured=measured,
        )

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
