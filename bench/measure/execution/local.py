"""Execute the plan of a run in this process, in passes over all problems, and store each new point.

Each pass has a different order of problems and solvers, and measures one or two rounds of each point, so that another
program disturbs few rounds of any point.
"""

from datetime import UTC, datetime
from typing import Any

from msgspec.structs import replace

from ....problems.exchange.files.problem_file import problem_bytes
from ....problems.exchange.sequences import NO_PREDECESSORS
from ...plugins.problems import predecessors_of_run, problem_of_run
from ...plugins.solver_specs import SolverSpec
from ...store.records import RunRecord, Session
from ...store.store import Store
from ..contacts.case import Case
from ..ladder import CasePass, LadderCase, measure_ladder
from ..machine import this_machine
from ..measuring_core import MeasuringCore
from ..refutation import mark_refuted_claims
from ..trajectories.case import TrajectoryCase
from ..trajectories.methods import Method
from ..trajectories.problems import trajectory_of
from .events import OnEvent, PointFinished, ProblemPassFinished, ProblemStarted
from .run_executor import RunExecutor, Solvers, shuffled


class LocalExecutor(RunExecutor):
    """Measure on a core of this machine, in a new session."""

    def __init__(self, solvers: Solvers, store: Store, record: RunRecord, on_event: OnEvent, mix: bool = False) -> None:
        """Store the arguments; ``mix`` allows cases of several machines in one run."""
        super().__init__(solvers, store, record, on_event, mix)
        self._session = Session(started=_now(), machine=this_machine())
        self._core = MeasuringCore(None)

    def _measure(self) -> None:
        """Measure the remaining points in each planned pass."""
        self._core = MeasuringCore.claim()
        self._session = replace(self._session, core=self._core.number)
        self._write_run(self._record)
        plan, session, n_done = self._record.plan, len(self._record.sessions), 0
        try:
            for number in range(plan.passes):
                for name in plan.problems if plan.trajectories else shuffled(plan.problems, plan.seed, number):
                    if not self._is_finished(name):
                        self._measure_pass(name, CasePass(session, number))
                    n_done += 1
                    self._on_event(ProblemPassFinished(name, n_done, plan.passes * len(plan.problems)))
        finally:
            self._core.release()
        self._session = replace(self._session, finished=_now())
        self._write_run(self._record)

    def _measure_pass(self, name: str, case_pass: CasePass) -> None:
        """Measure the cases of a problem in one pass."""
        plan, known = self._record.plan, self._cases[name]
        finished = self._finished_solvers(name)
        self._on_event(ProblemStarted(name, case_pass.number, plan.passes))
        cases = self._cases_of_pass(name, case_pass)
        try:
            measure_ladder(cases, self._store_point, self._core)
        finally:
            for case in cases:
                self._write_case(case.record())
        for refuted in mark_refuted_claims(list(known.values()), cases[0].is_solvable if cases else None):
            self._write_case(refuted)
        for solver, record in known.items():
            if solver not in finished and record.is_finished(plan):
                self._report_finished(record)
        busy = [*self._session.busy_cores, self._core.busy_cores]
        self._session = replace(self._session, busy_cores=busy)
        self._write_run(self._record)

    def _cases_of_pass(self, name: str, case_pass: CasePass) -> list[LadderCase[Any]]:
        """Return the cases of a problem that a pass measures; those of a contact problem are shuffled."""
        record, known, plan = self._record, self._cases[name], self._record.plan
        remaining = set(plan.solvers) - self._finished_solvers(name)
        if plan.trajectories:
            trajectory = trajectory_of(plan.trajectory(name))
            methods = [
                solver for solver in self._solvers if isinstance(solver, Method) and solver.record.name in remaining
            ]
            return [
                TrajectoryCase(trajectory, method, plan.limits, known.get(method.record.name), case_pass)
                for method in methods
            ]
        problem = problem_of_run(self._store, record, name)
        solvers = [solver for solver in self._solvers if isinstance(solver, SolverSpec) and solver.name in remaining]
        data = problem_bytes(problem.anonymous()) if solvers else b""
        is_warm = any(solver.starts_warm for solver in solvers)
        before = predecessors_of_run(self._store, record, problem) if is_warm else NO_PREDECESSORS
        return [
            Case(
                problem,
                solver,
                plan.limits,
                plan.tolerances,
                problem_data=data,
                stored=known.get(solver.name),
                case_pass=case_pass,
                before=before,
            )
            for solver in shuffled(solvers, plan.seed, case_pass.number, plan.problems.index(name))
        ]

    def _store_point(self, case: LadderCase[Any], value: float) -> None:
        """Store a case with a new point, and report it; later rounds of a point are stored at the end of the pass."""
        record = case.record()
        before = self._cases[record.problem].get(record.solver)
        if before is None or record.outcome is not before.outcome or len(record.points) > len(before.points):
            self._write_case(record)
        if record.points and record != before:
            self._cases[record.problem][record.solver] = record
            self._on_event(PointFinished(record.problem, record.solver, value))

    def _is_of_this_machine(self, name: str) -> bool:
        """Return whether no round of a problem is known to have been measured on another machine."""
        sessions = self._record.sessions
        points = [point for case in self._cases[name].values() for point in case.points]
        indices = {measured.session for point in points for measured in point.rounds}
        return all(
            sessions[index].machine.host in ("", self._session.machine.host)
            for index in indices
            if index < len(sessions)
        )

    def _discard_stale_cases(self) -> None:
        """Discard stale cases, and unfinished problems of another machine: one machine must measure all solvers."""
        super()._discard_stale_cases()
        for name in self._cases:
            if not (self._mix or self._is_finished(name) or self._is_of_this_machine(name)):
                self._cases[name] = {}
        self._done = self._count_finished()

    def _write_run(self, record: RunRecord) -> None:
        """Store the record of the run, with the session of this machine."""
        self._record = record
        self._store.write_run(replace(record, sessions=[*record.sessions, self._session]))


def _now() -> str:
    """Return the current time, as ISO 8601 in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")
