"""Start or resume a run: store the plan, then measure the missing cases."""

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

from ...problems.contact.judge import JUDGE
from ...problems.motion.scenes.registry import parse_scene
from ..errors import BenchError
from ..plugins.descriptions import solver_spec
from ..plugins.files import check_plugins_unchanged, plugin_uses, use_plugin_files
from ..plugins.problems import check_known, store_problems
from ..plugins.solver_specs import SolverSpec
from ..store.condition import differences, software_differences
from ..store.conversion import content_of, record_of
from ..store.outcome import FAULTS
from ..store.records import RunRecord
from ..store.store import Store
from .execution.distributed import DistributedExecutor
from .execution.events import OnEvent
from .execution.local import LocalExecutor
from .execution.run_executor import RunExecutor, Solvers
from .machine import this_machine
from .plan import Plan
from .trajectories.methods import Method, stored_method


def measure(
    plan: Plan[SolverSpec] | Plan[Method], folder: Path, on_event: OnEvent, executor: Executor | None = None
) -> None:
    """Execute a plan, and store it with its results in a new folder with the name of the run.

    Args:
        plan: the plan.
        folder: folder of the run.
        on_event: called with each event of the run.
        executor: executor of the problems, each as a task; this process if None.

    Raises:
        ProxbenchError: before the start, if the folder cannot be written or contains a run.
        InterruptedRunError: on Ctrl-C; finished cases are kept.
    """
    store = Store.create(folder)
    names = [trajectory.name for trajectory in plan.record.trajectories]
    solvers = [subject.solver if isinstance(subject, Method) else subject for subject in plan.solvers]
    scenes = [parse_scene(name)[0] for name in names]
    with store.locked():
        store.require_new()
        record = RunRecord(
            run_id=folder.name,
            plan=plan.record,
            machine=this_machine(),
            judge=JUDGE,
            plugins=plugin_uses([solver.name for solver in solvers], plan.record.problems, scenes),
            carried=store_problems(plan.problems, store),
        )
        record = record_of(content_of(record), RunRecord)
        _executor(plan.solvers, store, record, on_event, executor).execute({})


def resume_measuring(
    folder: Path,
    retry_failed: bool,
    on_event: OnEvent,
    plugins: Sequence[Path | str] = (),
    *,
    mix: bool = False,
    executor: Executor | None = None,
) -> None:
    """Measure the cases of a stored run that are missing, damaged, or of a problem with another digest.

    Args:
        folder: folder of the run.
        retry_failed: measure cases again that timed out, crashed, ran out of memory or misbehaved.
        on_event: called with each event of the run.
        plugins: the plugin files of the run.
        mix: continue even if machine, versions or source differ from those of the run.
        executor: executor of the problems, each as a task, on any machine; this process if None.

    Raises:
        ProxbenchError: if the folder is not a run, its run.json is damaged, a name in it is unknown, a plugin file of
            its solvers is not named, is missing or has changed, the version of the judge differs, or, without ``mix``,
            the machine, versions or source differ.
        InterruptedRunError: on Ctrl-C.
    """
    store = Store.open(folder)
    record = store.read_run()
    if record.judge != JUDGE:
        raise BenchError(
            f"{folder} was judged by version {record.judge} of the judge, but this is {JUDGE}; their residuals are "
            "not comparable; begin a new run."
        )
    find_differences = differences if executor is None else software_differences
    changes = find_differences(record.machine, this_machine())
    if changes and not mix:
        raise BenchError(
            f"{folder} was started with another machine or source ({'; '.join(changes)}), whose times are not "
            f"comparable; begin a new run, or mix them with `mix=True`."
        )
    use_plugin_files(plugins)
    check_plugins_unchanged(use for use in record.plugins if use.kind == "solver" or use.name not in record.carried)
    solvers: Solvers = tuple(map(stored_method, record.plan.methods))
    if not solvers:
        check_known(name for name in record.plan.problems if name not in record.carried)
        solvers = tuple(map(solver_spec, record.plan.solvers))
    with store.locked():
        cases, _ = store.read_cases()
        stored = {(case.problem, case.solver): case for case in cases if not (retry_failed and case.outcome in FAULTS)}
        _executor(solvers, store, record, on_event, executor, mix).execute(stored)


def _executor(
    solvers: Solvers, store: Store, record: RunRecord, on_event: OnEvent, executor: Executor | None, mix: bool = False
) -> RunExecutor:
    """Return the executor of a plan: this process, or the workers of ``executor``."""
    if executor is None:
        return LocalExecutor(solvers, store, record, on_event, mix)
    return DistributedExecutor(solvers, store, record, on_event, executor=executor, mix=mix)
