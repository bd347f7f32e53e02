"""First solves in fresh processes, which timed solves are held against: what is cheap to repeat need not be fast.

A process that has only been warmed up, on another problem of the same laws, sizes and sparsity, is copied; the copy
solves the problem once, in units in which a solver takes the same steps and knows no number again (``variants``), and
is gone. With t₁ the time of that first solve and t the median of the timed ones, what caches and clock speed explain is

    t₁ ≤ FACTOR · t + ALLOWANCE.

On a busy machine time passes in which a process does not work, so t₁ is its processor time where that is less. Both are
divided by the slowness of the core.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.catalog.storage import problem_bytes
from ....problems.contact.problem import ContactProblem
from ....solvers.interface import Status, Stop
from ...isolation.child import IN_A_COPY
from ...isolation.worker import NO_ANSWER, Fault, Worker, no_answer, numbers_of
from ...plugins.contestants import Contestant
from ...store.outcome import Outcome, point_outcome, verdicts
from ...store.records import Limits
from .protocol import MeasuringTask, medians_on_free_core, round_fault
from .variants import Variant, another, first_variant, in_other_units

FACTOR = 3.0
"""Times of a first and of a repeated solve may differ by this factor."""

ALLOWANCE = 2e-4
"""What a first solve may take beyond that [s]: pages and caches that only repeated solves find."""

ATTEMPTS = 4
"""Copies, each with units of its own, that must all find the same before a solver is accused."""

ROUND_SECONDS = 0.02
"""Wall time of repeated solves in a copy [s]."""


Found = TypeVar("Found")

THOROUGH = Stop(1e-8, max_iterations=200, max_seconds=0.1)
"""Limits of the solve that processes warm up with, once, so that timed solves and copies find loaded what they need."""


def explains(repeated: float, first: float) -> bool:
    """Whether a first solve [s] takes no longer than repeated ones [s], but for caches and clock speed."""
    return first <= FACTOR * repeated + ALLOWANCE


@dataclass(frozen=True)
class Solve:
    """Timed solves in a copy.

    Attributes:
        status: how the last one ended.
        seconds: preparing and solving together; time or work, whichever is less.
        impulses: of the last one [N s], in the units of the problem, shape (n_rows,).
        is_explained: whether the timed solves of its case explain its time.
    """

    status: Status
    seconds: float
    impulses: FloatArray
    is_explained: bool = True


class Controls:
    """The first solves of one solver on one problem.

    Attributes:
        problem: the problem.
        other: another one of its kinds to warm up on, as the content of a file.
        solver: the solver.
        limits: those of its case.
        short: when a solve stops that warms up.
    """

    def __init__(self, problem: ContactProblem, other: bytes, solver: Contestant, limits: Limits) -> None:
        self.problem, self.other, self.solver, self.limits = problem, other, solver, limits
        self.short = Stop(1e-1, max_iterations=20, max_seconds=limits.solve_seconds)
        self._worker: Worker | None = None
        self._can_copy = True

    def dismiss(self) -> None:
        """Let the process end."""
        if self._worker is not None:
            self._worker.dismiss()

    def close(self) -> None:
        """End the process."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def first_solve(self, stop: Stop, seconds: float, again: Callable[[], float]) -> Solve:
        """Return a first solve that the timed ones explain; in the units of the problem if those in others failed.

        One that does not end SOLVED is returned too.

        Args:
            stop: as of the timed solves, which ended SOLVED.
            seconds: their median.
            again: measures that median once more: the machine may be slower by now.

        Raises:
            Fault: MISBEHAVED if the timed solves explain none, or whatever ends the process.
        """
        slow: list[Solve] = []
        for number in range(ATTEMPTS):
            variant = in_other_units(self.problem, number) if number else first_variant(self.problem)
            solve = self._solve(variant, stop, seconds, again)
            if solve.is_explained and solve.status in (Status.SOLVED, Status.TIME_LIMIT):
                return solve
            slow += [] if solve.is_explained else [solve]
        if len(slow) < ATTEMPTS:
            as_it_is = Variant(self.problem.anonymous(), np.ones(self.problem.n_rows))
            solve = self._solve(as_it_is, stop, seconds, again)
            if solve.is_explained:
                return solve
            slow.append(solve)
        least = min(solve.seconds for solve in slow)
        raise Fault(
            Outcome.MISBEHAVED,
            f"a first solve to {stop.tolerance:g}, in a fresh process, took at least {least:.3g} s, and repeated ones "
            f"{seconds:.3g} s: it repeats answers instead of solving",
        )

    def _solve(self, variant: Variant, stop: Stop, seconds: float, again: Callable[[], float]) -> Solve:
        """Solve once, and find out why if the timed solves do not explain how long that takes."""
        solve = self._in_copy(lambda: self._first(variant, stop))
        if explains(seconds, solve.seconds) or solve.status not in (Status.SOLVED, Status.TIME_LIMIT):
            return solve
        timed = max(seconds, again())
        is_explained = explains(timed, solve.seconds) or self._in_copy(lambda: self._is_loading(variant, stop, timed))
        return replace(solve, is_explained=is_explained)

    def _in_copy(self, work: Callable[[], Found]) -> Found:
        """Do work in copies; in processes of their own from the first time on that a copy fails."""
        try:
            return work()
        except Fault as fault:
            self.close()
            if not self._can_copy:
                raise Fault(fault.outcome, f"in a fresh process {fault.reason}", fault.traceback) from None
            self._can_copy = False
            return self._in_copy(work)

    def _first(self, variant: Variant, stop: Stop) -> Solve:
        answer, rows = self._ask(stop, (variant.data, 0.0))
        n_rows = variant.problem.n_rows
        if len(rows) < n_rows:
            raise no_answer()
        first = min(_medians(answer)[0])
        return Solve(Status(answer["status"]), first, variant.units * rows[len(rows) - n_rows :])

    def _is_loading(self, variant: Variant, stop: Stop, timed: float) -> bool:
        """Whether a first solve is slow because it loads or compiles something on its way.

        Then the same problem is as fast as the timed solves from the second time on, and a first solve of another
        problem after it, which it solves rightly, as fast as repeated ones of that.
        """
        sibling = another(self.problem)
        of_sibling = (problem_bytes(sibling), 0.0), (b"", ROUND_SECONDS)
        answer, rows = self._ask(stop, (variant.data, 0.0), (b"", ROUND_SECONDS), *of_sibling)
        _, second, first_of_sibling, (second_of_sibling, _) = _medians(answer)
        if answer["status"] == Status.SOLVED and not self._is_right(sibling, rows, stop.tolerance):
            return False
        return explains(timed, min(second)) and explains(second_of_sibling, min(first_of_sibling))

    def _is_right(self, problem: ContactProblem, rows: FloatArray, tolerance: float) -> bool:
        """Whether the last of the impulses that came back are what a solver may call a solution."""
        if len(rows) < problem.n_rows:
            raise no_answer()
        impulses, model = rows[len(rows) - problem.n_rows :], self.solver.model
        own, coulomb = verdicts(problem, impulses, model)
        return point_outcome(Status.SOLVED, tolerance, model, own, coulomb) is not Outcome.WRONG

    def _ask(self, stop: Stop, *rounds: tuple[bytes, float]) -> tuple[dict[str, Any], FloatArray]:
        """Let a process that has only warmed up do rounds, and forget them.

        Raises:
            Fault: if what comes back cannot be that.
        """
        if self._worker is None:
            task = MeasuringTask(self.other, self.solver)
            self._worker = Worker(task, self.limits.case_seconds, self.limits.memory_bytes)
            self._worker.ask("warm_up", THOROUGH)
        worker, request = self._worker, ("rounds", (self.short, stop, rounds))
        worker.busy_seconds = 0.0
        began = time.monotonic()
        answer, content = worker.ask(IN_A_COPY, *request) if self._can_copy else worker.ask(request[0], *request[1])
        passed = time.monotonic() - began
        if not self._can_copy:
            self.close()
        times = answer.get("rounds")
        if not isinstance(times, list) or len(times) != len(rounds):
            raise no_answer()
        for one in times:
            fault = round_fault({**answer, **one}, passed) if isinstance(one, dict) else NO_ANSWER
            if fault is not None:
                raise Fault(Outcome.MISBEHAVED, fault)
        return answer, numbers_of(content)


def _medians(answer: dict[str, Any]) -> list[tuple[float, float]]:
    """Return the median time and the median work [s] of each round, as they are on a free core."""
    return [medians_on_free_core(one) for one in answer["rounds"]]
