"""A run from its begin, or from where it stopped: what it was planned as is stored, then what it lacks is measured."""

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

from ...problems.contact.judge import JUDGE
from ...problems.motion.scenes.registry import read_scene
from ..errors import BenchError
from ..plugins.describing import contestant
from ..plugins.files import check_again, sources, use_plugin_files
from ..plugins.problems import carry, check_known
from ..store.condition import differences, other_software
from ..store.conversion import content_of, record_of
from ..store.outcome import FAULTS
from ..store.records import PlanRecord, RunRecord
from ..store.store import Store
from .execution.dispatch import Dispatch
from .execution.events import OnEvent
from .execution.progress import Contestants, Progress
from .machine import this_machine
from .plan import Plan, name_of
from .trajectories.methods import stored_method


def measure(plan: Plan, folder: Path, on_event: OnEvent, executor: Executor | None = None) -> None:
    """Carry out a plan, and store it and what is measured in a new folder, named as the run is.

    Args:
        plan: what to measure.
        folder: of the run.
        on_event: called as the run goes on.
        executor: measures its problems, each as a task; this process if None.

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
                passes=1 if plan.trajectories else plan.passes,
                seed=plan.seed,
                suite=plan.suite,
                families=dict(plan.families),
                left_out=list(plan.left_out),
                shard=plan.shard,
            ),
            machine=this_machine(),
            judge=JUDGE,
            plugins=sources([solver.name for solver in solvers], names, scenes),
            carried={} if scenes else carry(plan.problems, store),
        )
        record = record_of(content_of(record), RunRecord)
        _progress(plan.methods or plan.solvers, store, record, on_event, executor).complete({})


def measure_rest(
    folder: Path,
    retry_failed: bool,
    on_event: OnEvent,
    plugins: Sequence[Path | str] = (),
    mix: bool = False,
    executor: Executor | None = None,
) -> None:
    """Measure the cases of a stored run that are missing, damaged, or of a problem with another digest.

    Args:
        folder: of the run.
        retry_failed: measure cases again that timed out, crashed, ran out of memory or misbehaved.
        on_event: called as the run goes on.
        plugins: the plugin files that it was begun with.
        mix: go on also where machine, versions or source are others than those it was begun with.
        executor: measures its problems, each as a task; this process if None. It need not be of the same machine then.

    Raises:
        ProxbenchError: if the folder is no run, its run.json is damaged, a name in it is unknown, a plugin file of its
            solvers is not named, is gone or has changed, or the machine is another one.
        InterruptedRunError: on Ctrl-C.
    """
    store = Store.open(folder)
    record = store.read_run()
    if record.judge != JUDGE:
        raise BenchError(
            f"{folder} was judged by version {record.judge} of the judge, this is {JUDGE}; residuals of both do not "
            "compare, begin a new run."
        )
    differing = differences if executor is None else other_software
    changed = differing(record.machine, this_machine())
    if changed and not mix:
        raise BenchError(
            f"{folder} was begun with another machine or source ({'; '.join(changed)}), whose times do not compare; "
            f"begin a new run, or mix them with `mix=True`."
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
        _progress(contestants, store, record, on_event, executor, mix).complete(stored)


def _progress(
    contestants: Contestants,
    store: Store,
    record: RunRecord,
    on_event: OnEvent,
    executor: Executor | None,
    mix: bool = False,
) -> Progress:
    """Return what carries out a plan, here or on an executor."""
    if executor is None:
        return Progress(contestants, store, record, on_event, mix)
    return Dispatch(contestants, store, record, on_event, executor, mix)
