"""Measurement of cases over ladders of tolerances or steps, level by level.

All cases of one problem exist at the same time, each in its own process. Untimed work runs in parallel. Timed rounds
alternate between the cases, one at a time, so that a drift of the machine affects all cases equally. A point of the
ladder may be measured in several passes, each with new processes.
"""

import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from ...problems.arrays import FloatArray
from ...problems.representation import counted
from ..isolation.worker import MAX_CONTENT_BYTES, Fault, Task, Worker, invalid_answer_fault, numbers_of
from ..store.outcome import Outcome
from ..store.plans import Limits
from ..store.records import CaseRecord, Curve, Point, Round
from .measuring_core import MeasuringCore
from .points import joined
from .timed_round import TimedRound

MAX_REASON_LENGTH = 2000
"""Largest number of characters of a solver's message that a record keeps."""

MAX_PARALLEL_STARTS = 4
"""Largest number of cases that start at the same time."""

INTERRUPT_SECONDS = 0.05
"""Interval at which starting cases are asked to end after an interrupt [s]."""

MAX_DOUBTED_ROUNDS = 2
"""Number of rounds with impossible processor times that prove misbehaviour, over all points of a case in a pass.

If a virtual machine is paused, its clocks may count the pause differently, which disturbs one round.
"""

CHANGED_CORES = "it changed the cores that its process may use"
"""Reason of a case whose process is no longer pinned to its cores, or used more of them."""

RoundResult = TypeVar("RoundResult")
"""The result of one round of a level."""

Timed = TypeVar("Timed", bound=TimedRound)
"""The kind of a round."""


@dataclass(frozen=True)
class CasePass:
    """One pass over the cases of a problem.

    Attributes:
        session: number of the session of the run, from 0.
        number: number of the pass in the session, from 0; points that already have more passes are skipped.
    """

    session: int = 0
    number: int = 0


class LadderCase(ABC, Generic[RoundResult]):
    """A case with its process, its ladder, and its record.

    Attributes:
        core: the measuring core.
        ladder: values of the ladder, from coarse to fine.
        limits: limits of time, memory and iterations.
        case_pass: the current pass.
        outcome: MEASURED, or why the case failed.
        points: the finished points of the ladder.
        is_solvable: whether the problem has a solution under Coulomb's law; None if unknown.
        is_built_in: whether its process measures a built-in solver and runs no code of plugins.
    """

    is_solvable: bool | None = None
    is_built_in: bool = False

    def __init__(self, ladder: Sequence[float], limits: Limits, stored: CaseRecord | None, case_pass: CasePass) -> None:
        """Store the plan of the case and its previous measurements."""
        self.core = MeasuringCore(None)
        self.ladder, self.limits, self.case_pass = ladder, limits, case_pass
        self.outcome = Outcome.MEASURED
        self.points: list[Point] = []
        self._curve = Curve()
        self._reason = self._traceback = self._output = ""
        self._worker: Worker | None = None
        self._n_doubted = 0
        self._is_dismissed = False
        self._seconds, self._seconds_before, self._memory = 0.0, 0.0, 0
        if stored is not None:
            self.points, self._curve = list(stored.points), stored.curve
            self._seconds = self._seconds_before = stored.wall_seconds
            self._memory = stored.peak_memory_bytes

    @abstractmethod
    def is_pending(self, level: int) -> bool:
        """Return whether a level must be measured, or recorded as not attempted."""

    @abstractmethod
    def begin(self) -> None:
        """Start the process, and do the work that precedes all levels."""

    @abstractmethod
    def measure(self, value: float, number: int) -> RoundResult | None:
        """Run round ``number``, from 0, at a value of the ladder; return its result, or None if the case failed."""

    @abstractmethod
    def needs_round(self, results: Sequence[RoundResult]) -> bool:
        """Return whether the level needs another round after the rounds with these results (at least one)."""

    @abstractmethod
    def point(self, value: float, results: list[RoundResult]) -> Point:
        """Return the point at a value of the ladder from the results of its rounds."""

    @abstractmethod
    def reason_to_stop(self, point: Point) -> str:
        """Return why finer points are not attempted after this one; an empty string if they are attempted."""

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """Return the fields of the record that identify problem and solver."""

    @property
    def threads(self) -> int:
        """Number of threads that the solver of the case may use."""
        return 1

    def pin_to_core(self, core: MeasuringCore) -> None:
        """Pin the process to one core per thread; fail the case if the run may not use as many cores."""
        self.core = core
        if self._worker is not None and core.number is not None and self.threads > len(core.allowed):
            allowed = counted(len(core.allowed), "core")
            reason = f"it needs {self.threads} threads, but this run may use only {allowed}"
            self._fail(Fault(Outcome.UNSUPPORTED, reason))
        if self._worker is not None:
            core.pin(self._worker.process, self.threads)

    def is_open(self, level: int) -> bool:
        """Return whether a level can be measured: the process runs, and no coarser point ends the ladder."""
        return self._worker is not None and self.outcome is Outcome.MEASURED and not self._reason_to_stop_before(level)

    def add_point(self, level: int, results: list[RoundResult]) -> None:
        """Add the measurements of one level."""
        point = self.point(self.ladder[level], results)
        if level < len(self.points):
            self.points[level] = joined(self.points[level], point)
        else:
            self.points.append(point)

    def skip_point(self, level: int) -> None:
        """Record a level as not attempted, unless it is the first one or already has a point."""
        if level == len(self.points) > 0:
            reason, value = self._reason_to_stop_before(level) or self._reason, self.ladder[level]
            self.points.append(Point(tolerance=value, outcome=Outcome.NOT_ATTEMPTED, status="", reason=reason))

    def finish(self) -> None:
        """Do the work that follows all levels."""

    def dismiss(self) -> None:
        """Ask the process to end without waiting for it; the case has not failed."""
        self._is_dismissed = True
        if self._worker is not None:
            self._worker.dismiss()

    def end(self) -> None:
        """End the process and keep its output if the case failed."""
        if self._worker is not None:
            self._update_costs()
            if self.outcome is not Outcome.MEASURED:
                self._output = self._worker.output()
            self._worker.close()
            self._worker = None

    def record(self) -> CaseRecord:
        """Return the record of the case."""
        self._update_costs()
        return CaseRecord(
            **self.identity(),
            outcome=self.outcome,
            reason=self._reason,
            traceback=self._traceback,
            stderr=self._output,
            wall_seconds=self._seconds,
            peak_memory_bytes=self._memory,
            curve=self._curve,
            points=list(self.points),
        )

    def _reason_to_stop_before(self, level: int) -> str:
        """Return why the point before a level ends the ladder; empty if it does not."""
        return self.reason_to_stop(self.points[level - 1]) if level > 0 else ""

    def _start(self, task: Task, solvers: Sequence[str] = ()) -> None:
        """Start the process, in which the kernels of ``solvers`` are loaded; fail the case if it cannot be started."""
        try:
            self._worker = Worker(task, self.limits.case_seconds, self.limits.memory_bytes, solvers)
        except Fault as fault:
            self._fail(fault)

    def _ask(
        self, request: str, *arguments: Any, largest: int = MAX_CONTENT_BYTES
    ) -> tuple[dict[str, Any], FloatArray] | None:
        """Return the answer of the process; if there is none, or the solver declines, fail the case and return None."""
        if self._worker is None:
            return None
        try:
            answer, content = self._worker.ask(request, *arguments, largest=largest)
            values = numbers_of(content)
        except Fault as fault:
            self._fail(fault)
            return None
        reason = answer.get("unsupported_reason", "")
        if not isinstance(reason, str):
            self._fail(invalid_answer_fault())
        elif reason:
            self._fail(Fault(Outcome.UNSUPPORTED, reason[:MAX_REASON_LENGTH]))
        return None if reason else (answer, values)

    def _timed_round(
        self, kind: type[Timed], number: int, request: str, *arguments: Any
    ) -> tuple[Timed, Round, FloatArray] | None:
        """Run round ``number`` between two probes of the core, again while its processor time is impossible.

        Return it with its record and numbers, or None if the case failed.
        """
        doubt = ""
        while self._n_doubted < MAX_DOUBTED_ROUNDS and self._worker is not None:
            process, used, probe = self._worker.process, self._worker.processor_seconds(), self.core.probe()
            began = time.monotonic()
            answer = self._ask(request, *arguments)
            passed = time.monotonic() - began
            if answer is None:
                return None
            try:
                timed = kind.read(answer[0], passed, self.is_built_in)
            except Fault as fault:
                self._fail(fault)
                return None
            doubt = "" if self.core.has_pinned(process, self.threads) else CHANGED_CORES
            if doubt:
                break
            probes, turn = (probe, self.core.probe()), (self.case_pass.session, self.case_pass.number, number)
            record = timed.record(*turn, max(probes), self.core.is_steady(*probes))
            doubt = self._doubt(timed, record, self._worker.processor_seconds() - used)
            if not doubt:
                return timed, record, answer[1]
            self._n_doubted += 1
        if doubt:
            self._fail(Fault(Outcome.MISBEHAVED, doubt))
        return None

    def _doubt(self, timed: TimedRound, record: Round, processor_seconds: float) -> str:
        """Return a clause if the processor time of a round is impossible; empty if it is possible.

        ``processor_seconds`` is that of the process and its descendants, as the system counts it [s].
        """
        used = timed.threads_used(self.threads)
        if self.core.number is None or not timed.exceeds(used):
            return ""
        if timed.exceeds(self.threads):
            return CHANGED_CORES
        return f"it takes more processor time than {counted(used, 'thread')} could"

    def _update_costs(self) -> None:
        """Read the wall time and the peak memory of the process."""
        if self._worker is not None:
            self._seconds = self._seconds_before + self._worker.busy_seconds
            self._memory = max(self._memory, self._worker.peak_memory_bytes)

    def _fail(self, fault: Fault) -> None:
        """End the case with the outcome of a fault, unless it was dismissed."""
        if not self._is_dismissed:
            self.outcome, self._reason, self._traceback = fault.outcome, fault.reason, fault.traceback
        self.end()


StoreCase = Callable[[LadderCase[Any], float], None]
"""A function that stores a case after a level, given by its value."""


def measure_ladder(
    cases: Sequence[LadderCase[Any]], store: StoreCase = lambda case, value: None, core: MeasuringCore | None = None
) -> None:
    """Measure the remaining levels of each case in one pass.

    Args:
        cases: cases of one problem.
        store: called with a case and the value of a level after each level.
        core: the measuring core; no pinning if None.
    """
    core = MeasuringCore(None) if core is None else core
    levels = range(max((len(case.ladder) for case in cases), default=0))
    try:
        _begin([case for case in cases if any(map(case.is_pending, range(len(case.ladder))))])
        with core.pinned(max((case.threads for case in cases), default=1)):
            for case in cases:
                case.pin_to_core(core)
            for level in levels:
                pending = [case for case in cases if level < len(case.ladder) and case.is_pending(level)]
                _measure_level(pending, level, store)
            for case in cases:
                case.finish()
    finally:
        for case in cases:
            case.dismiss()
        for case in cases:
            case.end()


def _begin(cases: Sequence[LadderCase[Any]]) -> None:
    """Start cases in parallel, at most ``MAX_PARALLEL_STARTS`` and at most one per core at a time.

    On an exception, end the cases and raise it.
    """
    n_parallel = min(MAX_PARALLEL_STARTS, os.cpu_count() or 1)
    with ThreadPoolExecutor(n_parallel) as pool:
        futures = [pool.submit(case.begin) for case in cases]
        try:
            for future in futures:
                future.result()
        except BaseException:
            for future in futures:
                future.cancel()
            # repeated, because a case that is about to start has no process to end yet
            while wait(futures, timeout=INTERRUPT_SECONDS).not_done:
                for case in cases:
                    case.dismiss()
            raise


def _measure_level(cases: Sequence[LadderCase[Any]], level: int, store: StoreCase) -> None:
    """Measure one level of all cases, with alternating rounds, and store each case after its last round."""
    results: list[list[Any]] = [[] for _ in cases]
    pending = list(range(len(cases)))
    while pending:
        for index in list(pending):
            case, results_of_case = cases[index], results[index]
            result = case.measure(case.ladder[level], len(results_of_case)) if case.is_open(level) else None
            if result is not None:
                results_of_case.append(result)
            if result is None or not case.needs_round(results_of_case):
                pending.remove(index)
                _store_level(case, level, results_of_case, store)


def _store_level(case: LadderCase[Any], level: int, results: list[Any], store: StoreCase) -> None:
    """Store the measurements of one level, or that it was not attempted."""
    if case.is_open(level) and results:
        case.add_point(level, results)
    else:
        case.skip_point(level)
    store(case, case.ladder[level])
