"""Cases measured level by level of their ladders, in rounds that alternate between them.

All cases of one problem live at the same time, each in its process. What is not timed, they do side by side; then they
work one at a time, so that a drift of the machine hits all alike. A point of the ladder may be measured in several
passes, each with processes of its own.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, Generic, TypeVar

from ...problems.arrays import FloatArray
from ..isolation.worker import MAX_CONTENT_BYTES, Fault, Task, Worker, no_answer, numbers_of
from ..store.outcome import Outcome
from ..store.plans import Limits
from ..store.records import CaseRecord, Curve, Point
from .measuring_core import MeasuringCore
from .points import joined

MAX_REASON_LENGTH = 2000
"""Characters that are kept of what a solver says in words."""

MAX_PARALLEL_STARTS = 4
"""Cases that begin at the same time, on a machine with as many cores."""

INTERRUPT_SECONDS = 0.05
"""Time after which cases that begin are told again to end [s]."""

Answer = TypeVar("Answer")
"""What one round of a level gives."""


class LadderCase(ABC, Generic[Answer]):
    """A case as it is measured from outside: its process, its ladder, and the record it becomes.

    Attributes:
        core: where it is timed.
        ladder: values to measure at, from coarse to fine.
        limits: time, memory and iterations.
        outcome: MEASURED, until something else comes of it.
        points: the finished points of the ladder, as they are stored.
        is_solvable: whether its problem has a solution under Coulomb's law, None where that is not known.
    """

    is_solvable: bool | None = None

    def __init__(self, ladder: Sequence[float], limits: Limits, stored: CaseRecord | None = None) -> None:
        """Note what to measure, and what is measured already."""
        self.core = MeasuringCore(None)
        self.ladder, self.limits = ladder, limits
        self.outcome = Outcome.MEASURED
        self.points: list[Point] = []
        self._curve = Curve()
        self._reason = self._traceback = self._output = ""
        self._worker: Worker | None = None
        self._is_dismissed = False
        self._seconds, self._seconds_before, self._memory = 0.0, 0.0, 0
        if stored is not None:
            self.points, self._curve = list(stored.points), stored.curve
            self._seconds = self._seconds_before = stored.wall_seconds
            self._memory = stored.peak_memory_bytes

    @abstractmethod
    def is_left(self, level: int) -> bool:
        """Whether a level is to be measured, or to be noted as not attempted."""

    @abstractmethod
    def begin(self) -> None:
        """Start the process, and do there what is done once."""

    @abstractmethod
    def measure(self, value: float, number: int) -> Answer | None:
        """Do one round by its number, from 0; return its answer, or None if the case failed."""

    @abstractmethod
    def needs_round(self, answers: Sequence[Answer]) -> bool:
        """Whether another round of the same level follows those with these answers, at least one."""

    @abstractmethod
    def point(self, value: float, answers: list[Answer]) -> Point:
        """Return a point of the ladder from its rounds."""

    @abstractmethod
    def end_after(self, point: Point) -> str:
        """Return why nothing finer than a point is tried; empty if it is."""

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """Return what its record says of problem and solver."""

    def occupy(self, core: MeasuringCore) -> None:
        """Let the process run on a core alone from now on."""
        self.core = core
        if self._worker is not None:
            core.pin(self._worker.process)

    def is_open(self, level: int) -> bool:
        """Whether a level can be measured: the process lives, and no coarser point ends the ladder."""
        return self._worker is not None and self.outcome is Outcome.MEASURED and not self._end_before(level)

    def add_point(self, level: int, answers: list[Answer]) -> None:
        """Keep what was measured of one level."""
        point = self.point(self.ladder[level], answers)
        if level < len(self.points):
            self.points[level] = joined(self.points[level], point)
        else:
            self.points.append(point)

    def skip_point(self, level: int) -> None:
        """Note a level that was not attempted, because a coarser one did not end solved."""
        if level == len(self.points) > 0:
            reason, value = self._end_before(level) or self._reason, self.ladder[level]
            self.points.append(Point(tolerance=value, outcome=Outcome.NOT_ATTEMPTED, status="", reason=reason))

    def finish(self) -> None:
        """Do what is done once after all levels."""

    def dismiss(self) -> None:
        """Let the process end, without waiting for it: the case has not failed if it answers no more."""
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
        """Return the case as it is stored."""
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

    def _end_before(self, level: int) -> str:
        return self.end_after(self.points[level - 1]) if level > 0 else ""

    def _start(self, task: Task) -> None:
        try:
            self._worker = Worker(task, self.limits.case_seconds, self.limits.memory_bytes)
        except Fault as unsent:
            self._fail(unsent)

    def _ask(
        self, request: str, *arguments: Any, largest: int = MAX_CONTENT_BYTES
    ) -> tuple[dict[str, Any], FloatArray] | None:
        """Return the answer of the process; None, with the case failed, if there is none or the solver refuses."""
        if self._worker is None:
            return None
        try:
            answer, content = self._worker.ask(request, *arguments, largest=largest)
            numbers = numbers_of(content)
        except Fault as fault:
            self._fail(fault)
            return None
        refusal = answer.get("refusal", "")
        if not isinstance(refusal, str):
            self._fail(no_answer())
        elif refusal:
            self._fail(Fault(Outcome.UNSUPPORTED, refusal[:MAX_REASON_LENGTH]))
        return None if refusal else (answer, numbers)

    def _update_costs(self) -> None:
        if self._worker is not None:
            self._seconds = self._seconds_before + self._worker.busy_seconds
            self._memory = max(self._memory, self._worker.peak_memory_bytes)

    def _fail(self, fault: Fault) -> None:
        if not self._is_dismissed:
            self.outcome, self._reason, self._traceback = fault.outcome, fault.reason, fault.traceback
        self.end()


Keep = Callable[[LadderCase[Any], float], None]


def measure_ladder(
    cases: Sequence[LadderCase[Any]],
    keep: Keep = lambda case, value: None,
    core: MeasuringCore | None = None,
) -> None:
    """Measure the levels that are left of each case, once.

    Args:
        cases: of one problem.
        keep: called with a case and the value of a level after each of them.
        core: where they are timed; wherever the system puts them if None.
    """
    core = MeasuringCore(None) if core is None else core
    levels = range(max((len(case.ladder) for case in cases), default=0))
    try:
        _begin([case for case in cases if any(map(case.is_left, range(len(case.ladder))))])
        with core.occupied():
            for case in cases:
                case.occupy(core)
            for level in levels:
                left = [case for case in cases if level < len(case.ladder) and case.is_left(level)]
                _measure_level(left, level, keep)
            for case in cases:
                case.finish()
    finally:
        for case in cases:
            case.dismiss()
        for case in cases:
            case.end()


def _begin(cases: Sequence[LadderCase[Any]]) -> None:
    """Begin cases, as many at a time as there are cores; on an interrupt let them end at once, and raise it."""
    at_once = min(MAX_PARALLEL_STARTS, os.cpu_count() or 1)
    with ThreadPoolExecutor(at_once) as pool:
        begun = [pool.submit(case.begin) for case in cases]
        try:
            for one in begun:
                one.result()
        except BaseException:
            for one in begun:
                one.cancel()
            while wait(begun, timeout=INTERRUPT_SECONDS).not_done:  # one that is about to start has no process yet
                for case in cases:
                    case.dismiss()
            raise


def _measure_level(cases: Sequence[LadderCase[Any]], level: int, keep: Keep) -> None:
    """Measure one level of all cases in turn, round after round, and keep each as soon as its rounds are over."""
    answers: list[list[Any]] = [[] for _ in cases]
    left = list(range(len(cases)))
    while left:
        for index in list(left):
            case, found = cases[index], answers[index]
            answer = case.measure(case.ladder[level], len(found)) if case.is_open(level) else None
            if answer is not None:
                found.append(answer)
            if answer is None or not case.needs_round(found):
                left.remove(index)
                _keep_level(case, level, found, keep)


def _keep_level(case: LadderCase[Any], level: int, answers: list[Any], keep: Keep) -> None:
    """Keep what was measured of one level, or that it was not."""
    if case.is_open(level) and answers:
        case.add_point(level, answers)
    else:
        case.skip_point(level)
    keep(case, case.ladder[level])
