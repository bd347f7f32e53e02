"""A run: every solver on every problem, interleaved, stored case by case.

All cases of one problem live at the same time, each in its process, and work one at a time in short rounds, so that a
drift of the machine hits all solvers alike. A reference workload between problems measures that drift; it is stored
each time.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from ...problems.catalog.catalog import is_available
from ...problems.catalog.storage import problem_bytes
from ...problems.contact.problem import ContactProblem
from ..errors import InterruptedRunError
from ..generate import generate
from ..store.outcome import FAULTS
from ..store.records import CaseRecord, Machine, PlanRecord, RunRecord, Session, content_of, record_of
from ..store.store import Store
from .case import Case
from .contestants import Contestant
from .describing import contestant
from .machine import calibration_seconds, describe_machine
from .plan import Plan, name_of
from .plugins import check_again, sources, use_plugin_files
from .problems import carry, check_known, problem_of

ROUNDS = 5
"""Rounds for each point of the ladder; every round has at least one timed solve."""

ROUND_SECONDS = 0.02
"""Wall time of a round at least, so that a point is measured for at least 0.1 s."""


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


Event = RunStarted | ProblemStarted | CaseFinished


def measure(plan: Plan, folder: Path, on_event: Callable[[Event], None]) -> None:
    """Carry out a plan, and store it and what is measured in a new folder, named as the run is.

    Raises:
        ProxbenchError: if the folder cannot be written or there is a run in it, before the start.
        InterruptedRunError: on Ctrl-C; finished cases are kept.
    """
    store = Store.create(folder)
    names = [name_of(problem) for problem in plan.problems]
    solvers = [solver.name for solver in plan.solvers]
    with store.alone():
        store.refuse_second()
        record = RunRecord(
            run_id=folder.name,
            plan=PlanRecord(problems=names, solvers=solvers, tolerances=list(plan.tolerances), limits=plan.limits),
            machine=msgspec.convert(describe_machine(), Machine),
            plugins=sources(solvers, names),
            carried=carry(plan.problems, store),
        )
        _carry_out(plan.solvers, store, record_of(content_of(record), RunRecord), {}, on_event)


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
    use_plugin_files(plugins)
    check_again(use for use in record.plugins if use.kind == "solver" or use.name not in record.carried)
    check_known(name for name in record.plan.problems if name not in record.carried)
    solvers = tuple(map(contestant, record.plan.solvers))
    with store.alone():
        cases, _ = store.read_cases()
        finished = {
            (case.problem, case.solver): case.digest for case in cases if not (retry_failed and case.outcome in FAULTS)
        }
        _carry_out(solvers, store, record, finished, on_event)


def _carry_out(
    solvers: Sequence[Contestant],
    store: Store,
    record: RunRecord,
    finished: dict[tuple[str, str], str],
    on_event: Callable[[Event], None],
) -> None:
    plan, session = record.plan, Session(started=_now())
    total = len(plan.problems) * len(solvers)
    session = _noted(store, record, session)
    on_event(RunStarted(store.folder, total, len(finished)))
    try:
        record = _generated(store, record)
        done = 0
        for name in plan.problems:
            problem = problem_of(store, record, name)
            open_solvers = [s for s in solvers if finished.get((name, s.name)) != problem.digest]
            done += len(solvers) - len(open_solvers)
            on_event(ProblemStarted(name))
            for case in _measured(problem, open_solvers, plan):
                store.write_case(case)
                done += 1
                on_event(CaseFinished(name, case.solver, case.outcome, done, total))
            session = _noted(store, record, session)
    except KeyboardInterrupt:
        raise InterruptedRunError(store.folder) from None
    store.restore()
    _write(store, record, replace(session, finished=_now()))


def _generated(store: Store, record: RunRecord) -> RunRecord:
    """Generate the problems that are neither carried nor available; return the record of the run that carries them."""
    names = [name for name in record.plan.problems if name not in record.carried and not is_available(name)]
    if not names:
        return record
    generate(names)
    return replace(record, carried={**record.carried, **carry(names, store)})


def _noted(store: Store, record: RunRecord, session: Session) -> Session:
    """Return the session with the speed and load of the machine at this moment, stored with the run."""
    seconds, load = calibration_seconds(), os.getloadavg()[0]
    session = replace(session, calibration_seconds=[*session.calibration_seconds, seconds], load=[*session.load, load])
    _write(store, record, session)
    return session


def _write(store: Store, record: RunRecord, session: Session) -> None:
    store.write_run(replace(record, sessions=[*record.sessions, session]))


def _measured(problem: ContactProblem, solvers: Sequence[Contestant], plan: PlanRecord) -> list[CaseRecord]:
    """Return all cases of one problem, measured in interleaved rounds."""
    cases = [Case(problem, solver, plan.limits) for solver in solvers]
    try:
        data = problem_bytes(problem) if cases else b""
        for case in cases:
            case.begin(data, plan.tolerances[-1])
        for tolerance in plan.tolerances:
            _measure_point(cases, tolerance)
    finally:
        for case in cases:
            case.end()
    return [case.record() for case in cases]


def _measure_point(cases: list[Case], tolerance: float) -> None:
    """Measure one tolerance for all cases in turn, round after round; a failing solve is not repeated."""
    rounds: dict[int, list[dict[str, Any]]] = {}
    for number in range(ROUNDS):
        for index, case in enumerate(cases):
            if not case.is_open or (number and not _goes_on(rounds.get(index))):
                continue
            answer = case.measure(tolerance, ROUND_SECONDS)
            if answer is not None:
                rounds.setdefault(index, []).append(answer)
    for index, case in enumerate(cases):
        if case.is_open and index in rounds:
            case.add_point(tolerance, rounds[index])
        elif case.points:
            case.skip_point(tolerance)


def _goes_on(rounds: list[dict[str, Any]] | None) -> bool:
    return rounds is not None and rounds[-1]["status"] == "solved"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
