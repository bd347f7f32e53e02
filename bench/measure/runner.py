"""A run: every contestant on every problem, interleaved, stored case by case.

A reference workload between problems measures the drift of the machine; it is stored each time.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import msgspec
from msgspec.structs import replace

from ...problems.catalog.catalog import is_available
from ...problems.catalog.storage import problem_bytes
from ...problems.contact.judge import JUDGE
from ...problems.scenes.registry import read_scene
from ..errors import BenchError, InterruptedRunError
from ..generate import generate
from ..plugins.contestants import Contestant
from ..plugins.describing import contestant
from ..plugins.files import check_again, sources, use_plugin_files
from ..plugins.problems import carry, check_known, problem_of
from ..store.conversion import content_of, record_of
from ..store.outcome import FAULTS
from ..store.records import CaseRecord, Machine, PlanRecord, RunRecord, Session
from ..store.store import Store
from .case import Case
from .ladder import LadderCase, measure_ladder
from .machine import calibration_seconds, describe_machine
from .plan import Plan, name_of
from .refutation import refuted
from .trajectories.case import TrajectoryCase
from .trajectories.methods import Method, stored_method
from .trajectories.problems import referenced, trajectory_of

Contestants = Sequence[Contestant] | Sequence[Method]


@dataclass(frozen=True)
class RunStarted:
    """The plan is made and the folder exists."""

    run_dir: Path
    total: int
    done: int


@dataclass(frozen=True)
class ProblemStarted:
    """The cases of one problem begin."""

    problem: str


@dataclass(frozen=True)
class CaseFinished:
    """One case is stored."""

    problem: str
    solver: str
    outcome: str
    done: int
    total: int


@dataclass(frozen=True)
class PointFinished:
    """One point of a case is stored, which goes on from there."""

    problem: str
    solver: str
    tolerance: float


Event = RunStarted | ProblemStarted | PointFinished | CaseFinished


def measure(plan: Plan, folder: Path, on_event: Callable[[Event], None]) -> None:
    """Carry out a plan, and store it and what is measured in a new folder, named as the run is.

    Raises:
        ProxbenchError: if the folder cannot be written or there is a run in it, before the start.
        InterruptedRunError: on Ctrl-C; finished cases are kept.
    """
    store = Store.create(folder)
    names = [name_of(problem) for problem in plan.problems]
    solvers = [method.solver for method in plan.methods] or plan.solvers
    scenes = [read_scene(trajectory.name)[0] for trajectory in plan.trajectories]
    with store.alone():
        store.refuse_second()
        record = RunRecord(
            run_id=folder.name,
            plan=PlanRecord(
                problems=names,
                solvers=[method.record.name for method in plan.methods] or [solver.name for solver in solvers],
                tolerances=list(plan.tolerances),
                limits=plan.limits,
                methods=[method.record for method in plan.methods],
                trajectories=list(plan.trajectories),
            ),
            machine=msgspec.convert(describe_machine(), Machine),
            judge=JUDGE,
            plugins=sources([solver.name for solver in solvers], names, scenes),
            carried={} if scenes else carry(plan.problems, store),
        )
        record = record_of(content_of(record), RunRecord)
        _Progress(plan.methods or plan.solvers, store, record, on_event).complete({})


def measure_rest(
    folder: Path, retry_failed: bool, on_event: Callable[[Event], None], plugins: Sequence[Path | str] = ()
) -> None:
    """Measure the cases of a stored run that are missing, damaged, or of a problem with another digest.

    Args:
        folder: of the run.
        retry_failed: measure cases again that timed out, crashed, ran out of memory or misbehaved.
        on_event: called as the run goes on.
        plugins: the plugin files that it was begun with.

    Raises:
        ProxbenchError: if the folder is no run, its run.json is damaged, a name in it is unknown, or a plugin file of
            its solvers is not named, is gone or has changed.
        InterruptedRunError: on Ctrl-C.
    """
    store = Store.open(folder)
    record = store.read_run()
    if record.judge != JUDGE:
        raise BenchError(
            f"{folder} was judged by version {record.judge} of the judge, this is {JUDGE}; residuals of both do not "
            "compare, begin a new run."
        )
    use_plugin_files(plugins)
    check_again(use for use in record.plugins if use.kind == "solver" or use.name not in record.carried)
    contestants: Contestants = tuple(map(stored_method, record.plan.methods))
    if not contestants:
        check_known(name for name in record.plan.problems if name not in record.carried)
        contestants = tuple(map(contestant, record.plan.solvers))
    with store.alone():
        cases, _ = store.read_cases()
        stored = {(case.problem, case.solver): case for case in cases if not (retry_failed and case.outcome in FAULTS)}
        _Progress(contestants, store, record, on_event).complete(stored)


class _Progress:
    """A plan as far as it is carried out."""

    def __init__(
        self, contestants: Contestants, store: Store, record: RunRecord, on_event: Callable[[Event], None]
    ) -> None:
        self._contestants, self._store, self._record, self._on_event = contestants, store, record, on_event
        self._session = Session(started=_now())

    def complete(self, stored: Mapping[tuple[str, str], CaseRecord]) -> None:
        """Measure what is not among the stored cases, by problem and solver."""
        plan = self._record.plan
        total = len(plan.problems) * len(plan.solvers)
        self._note_machine()
        done = sum(plan.has_finished(case) for case in stored.values())
        self._on_event(RunStarted(self._store.folder, total, done))
        try:
            self._generate()
            done = 0
            for name in plan.problems:
                known = {solver: case for (problem, solver), case in stored.items() if problem == name}
                cases = self._cases(name, known)
                done += len(plan.solvers) - len(cases)
                self._on_event(ProblemStarted(name))
                measure_ladder(cases, self._keep)
                for case in self._records(cases, known):
                    self._store.write_case(case)
                    done += 1
                    self._on_event(CaseFinished(name, case.solver, case.outcome, done, total))
                self._note_machine()
        except KeyboardInterrupt:
            raise InterruptedRunError(self._store.folder) from None
        self._store.restore()
        self._session = replace(self._session, finished=_now())
        self._note(self._record)

    def _generate(self) -> None:
        """Generate the problems that are neither carried nor available, and simulate missing references."""
        record, plan = self._record, self._record.plan
        for index, trajectory in enumerate(plan.trajectories):
            for known in referenced(trajectory, plan.limits):
                plan = replace(plan, trajectories=[*plan.trajectories[:index], known, *plan.trajectories[index + 1 :]])
                self._note(replace(record, plan=plan))
        names = [] if plan.trajectories else plan.problems
        missing = [name for name in names if name not in record.carried and not is_available(name)]
        if missing:
            generate(missing)
            self._note(replace(record, carried={**record.carried, **carry(missing, self._store)}))

    def _cases(self, name: str, stored: Mapping[str, CaseRecord]) -> list[LadderCase]:
        """Return the cases of a problem that are left to measure, given those of its cases that are stored."""
        record, limits = self._record, self._record.plan.limits
        if record.plan.trajectories:
            trajectory = trajectory_of(record.plan.trajectory(name))
            same = {solver: case for solver, case in stored.items() if case.digest == trajectory.digest}
            finished = {solver for solver, case in same.items() if record.plan.has_finished(case)}
            methods = [method for method in self._contestants if isinstance(method, Method)]
            return [
                TrajectoryCase(trajectory, method, limits, same.get(method.record.name))
                for method in methods
                if method.record.name not in finished
            ]
        problem = problem_of(self._store, record, name)
        finished = {solver for solver, case in stored.items() if case.digest == problem.digest}
        solvers = [one for one in self._contestants if isinstance(one, Contestant) and one.name not in finished]
        data = problem_bytes(problem.anonymous()) if solvers else b""
        return [Case(problem, solver, limits, record.plan.tolerances, data) for solver in solvers]

    def _records(self, cases: Sequence[LadderCase], stored: Mapping[str, CaseRecord]) -> list[CaseRecord]:
        """Return the records of measured cases; a stored one whose claims they refute is stored again."""
        records = {case.solver: case for case in (case.record() for case in cases)}
        digests = {case.digest for case in records.values()}
        others = [case for case in stored.values() if case.solver not in records and case.digest in digests]
        for case in refuted([*records.values(), *others], cases[0].is_solvable if cases else None):
            if case.solver in records:
                records[case.solver] = case
            else:
                self._store.write_case(case)
        return list(records.values())

    def _keep(self, case: LadderCase) -> None:
        """Store a case as far as it has come."""
        record = case.record()
        self._store.write_case(record)
        if record.points:
            self._on_event(PointFinished(record.problem, record.solver, record.points[-1].tolerance))

    def _note_machine(self) -> None:
        """Store the speed and load of the machine at this moment."""
        seconds, load, session = calibration_seconds(), os.getloadavg()[0], self._session
        times = [*session.calibration_seconds, seconds]
        self._session = replace(session, calibration_seconds=times, load=[*session.load, load])
        self._note(self._record)

    def _note(self, record: RunRecord) -> None:
        """Store the record of the run."""
        self._record = record
        self._store.write_run(replace(record, sessions=[*record.sessions, self._session]))


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
