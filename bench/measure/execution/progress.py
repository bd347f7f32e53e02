"""A plan carried out in this process: in passes over all problems, stored point by point.

Each pass takes problems and solvers in another order and measures one or two rounds of each point, so that a program
that runs for a while hits few rounds of any of them. When the planned passes are over, points that are still uncertain
are measured again.
"""

import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from msgspec.structs import replace

from ....problems.exchange.catalog import is_available
from ....problems.exchange.storage import problem_bytes
from ...errors import InterruptedRunError
from ...generate import generate
from ...isolation.fork_server import load_server
from ...plugins.contestants import Contestant
from ...plugins.problems import carry, problem_of
from ...store.conversion import content_of, record_of
from ...store.outcome import Outcome
from ...store.records import CaseRecord, RunRecord, Session
from ...store.store import Store
from ..contacts.case import Case, CasePass
from ..contacts.verdicts import RememberedVerdicts
from ..ladder import LadderCase, measure_ladder
from ..machine import this_machine
from ..measuring_core import MeasuringCore
from ..passes import EXTRA_SHARE, shuffled, uncertain
from ..refutation import refuted
from ..trajectories.case import TrajectoryCase
from ..trajectories.methods import Method
from ..trajectories.problems import referenced, trajectory_of
from ..trajectories.workload import compute_workload
from .events import (
    CaseFinished,
    CasePassFinished,
    OnEvent,
    PointFinished,
    ProblemStarted,
    ReferenceSimulated,
    RunStarted,
)

Contestants = Sequence[Contestant] | Sequence[Method]


class Progress:
    """A plan as far as it is carried out.

    Attributes:
        begun_anew: problems of which another machine had measured some cases, which were left out.
    """

    def __init__(
        self, contestants: Contestants, store: Store, record: RunRecord, on_event: OnEvent, mix: bool = False
    ) -> None:
        """Note what to carry out, where to store it, what to call as it goes on, and whether machines may mix."""
        self._contestants, self._store, self._record, self._on_event = contestants, store, record, on_event
        self._mix = mix
        self.begun_anew: list[str] = []
        self._session = Session(started=_now(), machine=this_machine())
        self._core = MeasuringCore(None)
        self._verdicts = RememberedVerdicts()
        self._cases: dict[str, dict[str, CaseRecord]] = {name: {} for name in record.plan.problems}
        self._done = 0

    def complete(self, stored: Mapping[tuple[str, str], CaseRecord]) -> None:
        """Measure what is not among the stored cases, by problem and solver; leave a finished run as it is."""
        plan = self._record.plan
        for (problem, solver), case in stored.items():
            if problem in self._cases:
                self._cases[problem][solver] = case
        count = len(plan.problems) * len(plan.solvers)
        self._done = sum(plan.has_finished(case) for case in stored.values())
        if self._done < count:
            self._note(self._record)
        self._on_event(self._started(count))
        try:
            self._generate()
            self._forget_other_problems()
            self._forget_other_machines()
            if self._done < count:
                self._measure()
        except KeyboardInterrupt:
            raise InterruptedRunError(self._store.folder) from None
        self._store.restore()

    def _started(self, count: int) -> RunStarted:
        plan = self._record.plan
        if not plan.trajectories:
            return RunStarted(self._store.folder, count, self._done)
        methods = [one for one in self._contestants if isinstance(one, Method)]
        work = compute_workload(methods, plan.trajectories)
        measured = sum(len(case.points) for cases in self._cases.values() for case in cases.values())
        return RunStarted(self._store.folder, count, self._done, work.points, measured, work.words)

    def _measure(self) -> None:
        """Measure what is left, and then more of what is uncertain, in a session of its own."""
        load_server()
        self._core = MeasuringCore.claim()
        self._session = replace(self._session, core=self._core.number)
        self._note(self._record)
        try:
            began = time.monotonic()
            self._measure_passes()
            if not self._record.plan.trajectories:
                self._measure_more((time.monotonic() - began) * EXTRA_SHARE)
        finally:
            self._core.release()
        self._session = replace(self._session, finished=_now())
        self._note(self._record)

    def _measure_passes(self) -> None:
        """Measure each point in each planned pass."""
        plan, session = self._record.plan, len(self._record.sessions)
        for number in range(plan.passes):
            names = plan.problems if plan.trajectories else shuffled(plan.problems, plan.seed, number)
            for index, name in enumerate(names):
                if not self._is_finished(name):
                    self._measure_pass(name, CasePass(session, number, verdicts=self._verdicts))
                self._on_event(CasePassFinished(name, number * len(names) + index + 1, plan.passes * len(names)))

    def _measure_more(self, seconds: float) -> None:
        """Measure more rounds of uncertain points, in as many passes again at most, for about ``seconds``."""
        plan, session, end = self._record.plan, len(self._record.sessions), time.monotonic() + seconds
        for number in range(plan.passes, 2 * plan.passes):
            for name in shuffled(plan.problems, plan.seed, number):
                if time.monotonic() >= end:
                    return
                if not self._is_of_this_machine(name):
                    continue
                whole = (case for case in self._cases[name].values() if case.outcome is Outcome.MEASURED)
                points = uncertain([_read_again(case) for case in whole], plan, number == plan.passes)
                if points:
                    self._measure_pass(name, CasePass(session, number, points, self._verdicts))

    def _is_of_this_machine(self, name: str) -> bool:
        """Whether no round of a problem was measured on another machine."""
        sessions = self._record.sessions
        used = {one.session for case in self._cases[name].values() for point in case.points for one in point.rounds}
        return all(sessions[one].host in ("", self._session.host) for one in used if one < len(sessions))

    def _is_finished(self, name: str) -> bool:
        plan, cases = self._record.plan, self._cases[name]
        return len(cases) == len(plan.solvers) and all(map(plan.has_finished, cases.values()))

    def _measure_pass(self, name: str, case_pass: CasePass) -> None:
        """Measure the cases of a problem in one pass."""
        plan, known = self._record.plan, self._cases[name]
        finished = {solver for solver, case in known.items() if plan.has_finished(case)}
        self._on_event(ProblemStarted(name, case_pass.number, plan.passes))
        cases = self._cases_of(name, case_pass)
        try:
            measure_ladder(cases, self._keep, self._core)
        finally:
            for case in cases:
                self._put(case.record())
        for wrong in refuted(list(known.values()), cases[0].is_solvable if cases else None):
            self._put(wrong)
        for solver, record in known.items():
            if solver not in finished and plan.has_finished(record):
                self._done += 1
                total = len(plan.problems) * len(plan.solvers)
                self._on_event(CaseFinished(name, solver, record.outcome, self._done, total))
        busy = [*self._session.busy_cores, self._core.busy_cores]
        self._session = replace(self._session, busy_cores=busy)
        self._note(self._record)

    def _generate(self) -> None:
        """Generate the problems that are neither carried nor available, and simulate missing references."""
        record, plan = self._record, self._record.plan
        for index, trajectory in enumerate(plan.trajectories):
            for known in referenced(trajectory, plan.limits):
                plan = replace(plan, trajectories=[*plan.trajectories[:index], known, *plan.trajectories[index + 1 :]])
                self._note(replace(record, plan=plan))
            self._on_event(ReferenceSimulated(plan.trajectories[index]))
        names = [] if plan.trajectories else plan.problems
        missing = [name for name in names if name not in record.carried and not is_available(name)]
        if missing:
            generate(missing)
            self._note(replace(record, carried={**record.carried, **carry(missing, self._store)}))

    def _forget_other_problems(self) -> None:
        """Forget stored cases of problems whose numbers are others now."""
        for name, cases in self._cases.items():
            if cases:
                digest = self._digest(name)
                self._cases[name] = {solver: case for solver, case in cases.items() if case.digest == digest}
        self._done = sum(
            self._record.plan.has_finished(case) for cases in self._cases.values() for case in cases.values()
        )

    def _forget_other_machines(self) -> None:
        """Forget the cases of problems that were begun on another machine: all solvers of one are measured on one."""
        for name in self._cases:
            if not (self._mix or self._is_finished(name) or self._is_of_this_machine(name)):
                self._done -= sum(map(self._record.plan.has_finished, self._cases[name].values()))
                self._cases[name] = {}
                self.begun_anew.append(name)

    def _digest(self, name: str) -> str:
        plan = self._record.plan
        if plan.trajectories:
            return trajectory_of(plan.trajectory(name)).digest
        return problem_of(self._store, self._record, name).digest

    def _cases_of(self, name: str, case_pass: CasePass) -> list[LadderCase[Any]]:
        """Return the cases of a problem that are measured in a case_pass, in an order of its own."""
        record, known, plan = self._record, self._cases[name], self._record.plan
        if case_pass.points is None:
            left = {one for one in plan.solvers if one not in known or not plan.has_finished(known[one])}
        else:
            left = {solver for solver, _ in case_pass.points}
        if plan.trajectories:
            trajectory = trajectory_of(plan.trajectory(name))
            methods = [one for one in self._contestants if isinstance(one, Method) and one.record.name in left]
            return [TrajectoryCase(trajectory, one, plan.limits, known.get(one.record.name)) for one in methods]
        problem = problem_of(self._store, record, name)
        solvers = [one for one in self._contestants if isinstance(one, Contestant) and one.name in left]
        data = problem_bytes(problem.anonymous()) if solvers else b""
        return [
            Case(problem, solver, plan.limits, plan.tolerances, data, known.get(solver.name), case_pass)
            for solver in shuffled(solvers, plan.seed, case_pass.number, plan.problems.index(name))
        ]

    def _keep(self, case: LadderCase[Any], value: float) -> None:
        """Store a case with a new point, and report it; later rounds of a point are stored at the end of the pass."""
        record = case.record()
        before = self._cases[record.problem].get(record.solver)
        if before is None or record.outcome is not before.outcome or len(record.points) > len(before.points):
            self._put(record)
        if record.points and record != before:
            self._cases[record.problem][record.solver] = record
            self._on_event(PointFinished(record.problem, record.solver, value))

    def _put(self, record: CaseRecord) -> None:
        self._cases[record.problem][record.solver] = record
        self._store.write_case(record)

    def _note(self, record: RunRecord) -> None:
        """Store the record of the run."""
        self._record = record
        self._store.write_run(replace(record, sessions=[*record.sessions, self._session]))


def _read_again(case: CaseRecord) -> CaseRecord:
    """Return a case as its file has it."""
    return record_of(content_of(case), CaseRecord)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
