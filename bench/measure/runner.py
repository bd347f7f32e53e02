"""A run: every solver on every problem, interleaved, stored case by case.

All cases of one problem live at the same time, each in its process, and work one at a time in short rounds, so that a
drift of the machine hits all solvers alike. A reference workload between problems measures that drift.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ...problems.catalog.storage import problem_bytes
from ...problems.contact.problem import ContactProblem
from ...solvers.interface import Solver
from ..errors import BenchError, InterruptedRunError
from ..generate import generate
from ..store.outcome import FAULTS
from ..store.store import Store, plain_name
from .case import Case
from .contestants import Contestant
from .machine import calibration_seconds, describe_machine
from .plan import Limits, Plan, make_plan, name_of, resolved
from .plugins import check_again, sources, use_plugin_files

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


def run(
    problems: Sequence[str | ContactProblem] | None = None,
    solvers: Sequence[str | Solver] | None = None,
    suite: str = "quick",
    results: Path | str = "results",
    run_id: str | None = None,
    tolerances: Sequence[float] | None = None,
    limits: Limits | None = None,
    on_event: Callable[[Event], None] = lambda event: None,
    plugins: Sequence[Path | str] = (),
) -> Path:
    """Measure solvers on problems and store the results; return the folder of the run.

    Args:
        problems: names, or problems; the members of ``suite`` if None. What is missing is generated.
        solvers: names with options, or solvers; the default variants if None.
        suite: a named suite.
        results: the folder in which the folder of the run is made.
        run_id: its name; date and time if None.
        tolerances: the ladder; 1e-1 … 1e-10 if None.
        limits: of each case.
        on_event: called as the run goes on.
        plugins: plugin files whose solvers and problems can be named.

    Raises:
        ProxbenchError: for anything unknown or out of range, or a folder that cannot be written, before the start.
        InterruptedRunError: on Ctrl-C; finished cases are kept.
    """
    use_plugin_files(plugins)
    plan = make_plan(problems, solvers, suite, tolerances, limits)
    identity = run_id or datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    if identity != plain_name(identity):
        raise BenchError(f"run id {identity!r} must be a folder name of at most 60 letters, digits, '.', '_' and '-'.")
    store = Store.create(Path(results) / identity)
    planned = _planned(plan)
    info: dict[str, Any] = {
        "run_id": identity,
        "plan": planned,
        "machine": describe_machine(),
        "calibration_seconds": [],
    }
    used = sources(planned["solvers"], planned["problems"])
    with store.alone():
        store.refuse_second()
        info |= {"plugins": used, "started": _now(), "finished": ""}
        store.write_info(info)
        return _carry_out(plan, store, info, finished={}, on_event=on_event)


def resume(
    run_dir: Path | str,
    retry_failed: bool = False,
    on_event: Callable[[Event], None] = lambda event: None,
    plugins: Sequence[Path | str] = (),
) -> Path:
    """Finish an interrupted run: measure the cases that are missing, damaged, or of a problem with another digest.

    Args:
        run_dir: the folder of the run.
        retry_failed: measure cases again that timed out, crashed, ran out of memory or misbehaved.
        on_event: called as the run goes on.
        plugins: the plugin files that it was begun with.

    Raises:
        BenchError: if the folder is no run, its run.json is damaged, or a plugin file it was begun with is not named,
            is gone or has changed.
        InterruptedRunError: on Ctrl-C.
    """
    store = Store.open(Path(run_dir))
    info = store.read_info()
    use_plugin_files(plugins)
    check_again(info.get("plugins", []))
    planned = info["plan"]
    plan = make_plan(
        planned["problems"], planned["solvers"], tolerances=planned["tolerances"], limits=Limits(**planned["limits"])
    )
    with store.alone():
        cases, _ = store.read_cases()
        finished = {
            (case["problem"], case["solver"]): case["digest"]
            for case in cases
            if not (retry_failed and case["outcome"] in FAULTS)
        }
        return _carry_out(plan, store, info, finished, on_event)


def _carry_out(
    plan: Plan,
    store: Store,
    info: dict[str, Any],
    finished: dict[tuple[str, str], str],
    on_event: Callable[[Event], None],
) -> Path:
    on_event(RunStarted(store.folder, plan.n_cases, len(finished)))
    calibration = [calibration_seconds()]
    try:
        if plan.missing:
            generate(plan.missing)
        done = 0
        for given in plan.problems:
            problem = resolved(given)
            open_solvers = [s for s in plan.solvers if finished.get((problem.name, s.name)) != problem.digest]
            done += len(plan.solvers) - len(open_solvers)
            on_event(ProblemStarted(problem.name))
            for document in _measured(problem, open_solvers, plan):
                store.write_case(document)
                done += 1
                on_event(CaseFinished(problem.name, document["solver"], document["outcome"], done, plan.n_cases))
            calibration.append(calibration_seconds())
    except KeyboardInterrupt:
        raise InterruptedRunError(store.folder) from None
    store.restore()
    store.write_info({**info, "calibration_seconds": info["calibration_seconds"] + calibration, "finished": _now()})
    return store.folder


def _measured(problem: ContactProblem, solvers: Sequence[Contestant], plan: Plan) -> list[dict[str, Any]]:
    """Return the documents of all cases of one problem, measured in interleaved rounds."""
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
    return [case.document() for case in cases]


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


def _planned(plan: Plan) -> dict[str, Any]:
    return {
        "problems": [name_of(problem) for problem in plan.problems],
        "solvers": [solver.name for solver in plan.solvers],
        "tolerances": list(plan.tolerances),
        "limits": vars(plan.limits),
    }


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
