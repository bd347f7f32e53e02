"""A plan carried out on an executor: each problem is a task, and what comes back is stored as it comes.

A task that is lost with its worker is given to another one; one that is done twice gives the same cases, and the later
ones count. So a worker that dies loses what it was measuring, and nothing else.
"""

from collections.abc import Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait

from msgspec.structs import replace

from ....problems.errors import first_line
from ....problems.exchange.plugins import registered
from ....problems.exchange.storage import packed_problem
from ...errors import BenchError
from ...plugins.contestants import Contestant
from ...plugins.problems import problem_of
from ...store.records import CaseRecord, RunRecord, Session, with_sessions
from ...store.store import Store
from ..passes import shuffled
from .events import CaseFinished, CasePassFinished, OnEvent
from .part import MeasuredPart, Part, measure_part
from .progress import Contestants, Progress

MOST_WAITING = 2**28
"""Bytes of problems that an executor has at a time, unless one alone has more."""

ATTEMPTS = 3
"""Workers that may be lost with a task, or fail at it, before it is given up."""


class Dispatch(Progress):
    """A plan as far as it is carried out on an executor; the machine of this process measures nothing."""

    def __init__(
        self,
        contestants: Contestants,
        store: Store,
        record: RunRecord,
        on_event: OnEvent,
        executor: Executor,
        mix: bool = False,
    ) -> None:
        """Note what to carry out, where to store it, what to call as it goes on, what measures, and what may mix."""
        super().__init__(contestants, store, record, on_event, mix)
        self._executor = executor
        self._n_before = len(record.sessions)
        self._lost: dict[str, BaseException] = {}

    def _measure(self) -> None:
        """Give each unfinished problem to the executor, and store what comes back.

        Raises:
            BenchError: if problems were lost with their workers, or refused by them, too often; all else is stored.
        """
        plan = self._record.plan
        left = [name for name in shuffled(plan.problems, plan.seed, 0) if not self._is_finished(name)]
        attempts, n_done = dict.fromkeys(left, ATTEMPTS), len(plan.problems) - len(left)
        running: dict[Future[MeasuredPart], str] = {}
        sizes: dict[str, int] = {}
        try:
            while left or running:
                self._submit(left, running, sizes)
                for future in _results_first(wait(running, return_when=FIRST_COMPLETED).done):
                    name, fault = running.pop(future), _fault(future)
                    if fault is None:
                        self._keep_part(name, future.result())
                        n_done += 1
                        self._on_event(CasePassFinished(name, n_done, len(plan.problems)))
                        continue
                    attempts[name] -= 1
                    if attempts[name]:
                        left.append(name)
                    else:
                        self._lost[name] = fault
        finally:
            for future in running:
                future.cancel()
        self._refuse_losses()

    def _submit(self, left: list[str], running: dict[Future[MeasuredPart], str], sizes: dict[str, int]) -> None:
        """Give the executor as many problems as it may have; all are lost if it takes none any more."""
        while left and (not running or sum(sizes[name] for name in running.values()) < MOST_WAITING):
            part = self._part(left[0])
            sizes[left[0]] = len(part.problem)
            try:
                running[self._executor.submit(measure_part, part)] = left[0]
            except (RuntimeError, OSError) as broken:
                self._lost |= dict.fromkeys(left, broken)
                left.clear()
            else:
                left.pop(0)

    def _refuse_losses(self) -> None:
        if self._lost:
            count = f"{len(self._lost)} of {len(self._record.plan.problems)} problems"
            why, folder = first_line(next(iter(self._lost.values()))), self._store.folder
            raise BenchError(
                f"{count} could not be measured ({why}); the others are kept; resume with: "
                f"proxbench run --resume {folder}"
            )

    def _part(self, name: str) -> Part:
        record, plan = self._record, self._record.plan
        problem = problem_of(self._store, record, name)
        own = replace(
            record,
            plan=replace(plan, problems=[name], families={name: plan.family(name)}, left_out=[], shard=""),
            carried={name: problem.digest},
            sessions=record.sessions[: self._n_before],
        )
        contestants = tuple(one for one in self._contestants if isinstance(one, Contestant))
        cases = tuple(self._cases[name].values())
        return Part(own, cases, packed_problem(problem), contestants, tuple(registered()), self._mix)

    def _keep_part(self, name: str, part: MeasuredPart) -> None:
        """Store the cases of a problem, and what is known of the machine that measured them."""
        plan, place = self._record.plan, self._place_of(part.session)
        finished = {solver for solver, case in self._cases[name].items() if plan.has_finished(case)}
        places = [*range(self._n_before), place]
        for case in self._unfinished(name, part):
            self._put(with_sessions(case, places))
            if plan.has_finished(case):
                self._done += case.solver not in finished
                total = len(plan.problems) * len(plan.solvers)
                self._on_event(CaseFinished(name, case.solver, case.outcome, self._done, total))

    def _unfinished(self, name: str, part: MeasuredPart) -> Iterator[CaseRecord]:
        """Yield the cases of a part that were not finished before, or that its machine measured anew."""
        plan, known = self._record.plan, self._cases[name]
        finished = {solver for solver, case in known.items() if plan.has_finished(case)}
        return (case for case in part.cases if part.is_anew or case.solver not in finished)

    def _place_of(self, session: Session) -> int:
        """Return the number of the session of a machine, to which what was measured there now is added."""
        sessions = self._record.sessions
        for place, known in enumerate(sessions[self._n_before :], self._n_before):
            if known.host == session.host:
                busy = [*known.busy_cores, *session.busy_cores]
                joined = replace(known, finished=session.finished, busy_cores=busy)
                self._note(replace(self._record, sessions=[*sessions[:place], joined, *sessions[place + 1 :]]))
                return place
        self._note(replace(self._record, sessions=[*sessions, session]))
        return len(sessions)

    def _forget_other_machines(self) -> None:
        """Forget nothing: the machine of a worker is known there."""

    def _note(self, record: RunRecord) -> None:
        """Store the record of the run, whose sessions are those of the workers."""
        self._record = record
        self._store.write_run(record)


def _results_first(done: Collection[Future[MeasuredPart]]) -> list[Future[MeasuredPart]]:
    """Return futures with those that have results first: an error of another one must not cost them."""
    return sorted(done, key=lambda future: future.cancelled() or future.exception() is not None)


def _fault(future: Future[MeasuredPart]) -> BaseException | None:
    """Return why a task has no result; None if it has."""
    return CancelledError("it was cancelled") if future.cancelled() else future.exception()
