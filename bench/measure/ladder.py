"""Cases measured level by level of their ladders, in rounds that alternate between them.

All cases of one problem live at the same time, each in its process, and work one at a time, so that a drift of the
machine hits all alike.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from ...problems.arrays import FloatArray
from ..isolation.worker import LARGEST_CONTENT, Fault, Task, Worker, no_answer, numbers_of
from ..store.outcome import Outcome
from ..store.records import CaseRecord, Curve, Limits, Point, Quartiles

LONGEST_REASON = 2000
"""Characters that are kept of what a solver says in words."""


class LadderCase(ABC):
    """A case as it is measured from outside: its process, its ladder, and the record it becomes.

    Attributes:
        ladder: values to measure at, from coarse to fine.
        limits: time, memory and iterations.
        outcome: MEASURED, until something else comes of it.
        points: the finished points of the ladder, as they are stored.
        keeps_points: whether it is stored after each point, and goes on from there.
        is_solvable: whether its problem has a solution under Coulomb's law, None where that is not known.
    """

    keeps_points: ClassVar[bool] = False
    is_solvable: bool | None = None

    def __init__(self, ladder: Sequence[float], limits: Limits) -> None:
        self.ladder, self.limits = ladder, limits
        self.outcome = Outcome.MEASURED
        self.points: list[Point] = []
        self._curve = Curve()
        self._reason = self._traceback = self._output = self._ended_by = ""
        self._worker: Worker | None = None
        self._seconds, self._seconds_before, self._memory = 0.0, 0.0, 0

    @property
    @abstractmethod
    def rounds(self) -> int:
        """Rounds of each level."""

    @abstractmethod
    def begin(self) -> None:
        """Start the process, and do there what is done once."""

    @abstractmethod
    def measure(self, value: float, number: int) -> dict[str, Any] | None:
        """Do one round, from 0; return its answer, or None if the case failed."""

    @abstractmethod
    def goes_on(self, answer: dict[str, Any]) -> bool:
        """Whether another round of the same level follows one with this answer."""

    @abstractmethod
    def point(self, value: float, answers: list[dict[str, Any]]) -> Point:
        """Return a point of the ladder from its rounds; note in ``_ended_by`` if the ladder ends with it."""

    @abstractmethod
    def identity(self) -> dict[str, Any]:
        """Return what its record says of problem and solver."""

    @property
    def is_open(self) -> bool:
        """Whether there is more of the ladder to measure."""
        return self._worker is not None and self.outcome is Outcome.MEASURED and not self._ended_by

    def add_point(self, value: float, answers: list[dict[str, Any]]) -> None:
        """Keep one point of the ladder."""
        self.points.append(self.point(value, answers))

    def skip_point(self, value: float) -> None:
        """Note a point that was not attempted, because a coarser one did not end solved."""
        reason = self._ended_by or self._reason
        self.points.append(Point(tolerance=value, outcome=Outcome.NOT_ATTEMPTED, status="", reason=reason))

    def end(self) -> None:
        """End the process and keep its output if the case failed."""
        if self._worker is not None:
            self._note_costs()
            if self.outcome is not Outcome.MEASURED:
                self._output = self._worker.output()
            self._worker.close()
            self._worker = None

    def record(self) -> CaseRecord:
        """Return the case as it is stored."""
        self._note_costs()
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

    def _start(self, task: Task) -> None:
        try:
            self._worker = Worker(task, self.limits.case_seconds, self.limits.memory_bytes)
        except Fault as unsent:
            self._fail(unsent)

    def _ask(
        self, request: str, *arguments: Any, largest: int = LARGEST_CONTENT
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
            self._fail(Fault(Outcome.UNSUPPORTED, refusal[:LONGEST_REASON]))
        return None if refusal else (answer, numbers)

    def _note_costs(self) -> None:
        if self._worker is not None:
            self._seconds = self._seconds_before + self._worker.busy_seconds
            self._memory = max(self._memory, self._worker.peak_memory_bytes)

    def _fail(self, fault: Fault) -> None:
        self.outcome, self._reason, self._traceback = fault.outcome, fault.reason, fault.traceback
        self.end()


def measure_ladder(cases: Sequence[LadderCase], keep: Callable[[LadderCase], None] = lambda case: None) -> None:
    """Measure the levels that each case has not measured yet.

    Args:
        cases: of one problem.
        keep: called after each point of a case that keeps its points.
    """
    try:
        for case in cases:
            case.begin()
        for level in range(max((len(case.ladder) for case in cases), default=0)):
            left = [case for case in cases if len(case.points) <= level < len(case.ladder)]
            _measure_level(left, level)
            for case in left:
                if case.keeps_points:
                    keep(case)
    finally:
        for case in cases:
            case.end()


def _measure_level(cases: Sequence[LadderCase], level: int) -> None:
    """Measure one level of all cases in turn, round after round."""
    answers: dict[int, list[dict[str, Any]]] = {}
    for number in range(max((case.rounds for case in cases), default=0)):
        for index, case in enumerate(cases):
            before = answers.get(index)
            if not case.is_open or number >= case.rounds or (number and not (before and case.goes_on(before[-1]))):
                continue
            answer = case.measure(case.ladder[level], number)
            if answer is not None:
                answers.setdefault(index, []).append(answer)
    for index, case in enumerate(cases):
        if case.is_open and index in answers:
            case.add_point(case.ladder[level], answers[index])
        elif case.points:
            case.skip_point(case.ladder[level])


def quartiles(values: FloatArray) -> Quartiles:
    """Return least, quartiles and median of times [s]."""
    low, first, median, third = map(float, np.quantile(values, (0.0, 0.25, 0.5, 0.75)))
    return Quartiles(min=low, q1=first, median=median, q3=third)
