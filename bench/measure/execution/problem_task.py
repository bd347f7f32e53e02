"""One problem of a run with all its solvers, as a task for a process on any machine.

All solvers of a problem belong to one task, because their rounds alternate and are compared in pairs.
"""

import io
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path

from ....problems.contact.judge import JUDGE
from ....problems.exchange.files.atomic_file import PART
from ....problems.exchange.files.problem_file import read_problem
from ....problems.exchange.plugins.files import PluginFile
from ....problems.exchange.plugins.offers import Names, register
from ...errors import BenchError
from ...plugins.solver_specs import SolverSpec
from ...store.records import CaseRecord, RunRecord, Session
from ...store.store import Store
from ..machine import this_machine
from .local import LocalExecutor

_task_lock = threading.Lock()
"""Lock that lets one task of this process run at a time, even if an executor has several threads per process."""


@dataclass(frozen=True)
class ProblemTask:
    """One problem of a run, with its solvers, for a worker to measure.

    Attributes:
        run: the run, with only this problem in its plan, and its sessions.
        cases: cases of the problem that are already measured.
        problems: contents of problem files: the earlier steps that solvers with warm starts need, then the problem.
        solvers: the solvers.
        plugin_files: plugin files of the solvers, with the names that they provide.
        mix: whether to keep cases of another machine if the problem is unfinished.
    """

    run: RunRecord
    cases: tuple[CaseRecord, ...]
    problems: tuple[bytes, ...]
    solvers: tuple[SolverSpec, ...]
    plugin_files: tuple[tuple[PluginFile, Names | None], ...] = ()
    mix: bool = False


@dataclass(frozen=True)
class MeasuredProblem:
    """The measured cases of one problem, as a worker returns them.

    Attributes:
        session: the session of the worker, which follows those of the task.
        cases: all cases of the problem.
    """

    session: Session
    cases: tuple[CaseRecord, ...]


def measure_problem(task: ProblemTask) -> MeasuredProblem:
    """Measure the problem of a task, after other tasks in this process have ended.

    Raises:
        BenchError: if the judge or the source of Proxbench on this machine differs from that of the run.
    """
    here = this_machine()
    if (JUDGE, here.source) != (task.run.judge, task.run.machine.source):
        raise BenchError(
            f"the worker on {here.host} runs a different version of Proxbench; "
            "install the same version on all machines."
        )
    for file, names in task.plugin_files:
        register(file, names, runs_here=False)
    with _task_lock, tempfile.TemporaryDirectory(prefix="proxbench-", suffix=PART) as folder:
        store = Store.create(Path(folder, "run"))
        for content in task.problems:
            store.write_problem(read_problem(io.BytesIO(content), "a problem of the task"))
        for case in task.cases:
            store.write_case(case)
        stored = {(case.problem, case.solver): case for case in task.cases}
        LocalExecutor(task.solvers, store, task.run, lambda event: None, task.mix).execute(stored)
        return MeasuredProblem(store.read_run().sessions[-1], tuple(store.read_cases()[0]))
