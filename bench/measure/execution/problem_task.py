"""One problem of a run with all its solvers, as a task that any process on any machine can do.

All solvers of a problem are in one task, since they take turns and their rounds are compared in pairs.
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

_one_at_a_time = threading.Lock()
"""A process measures one task at a time: executors may have several threads in each."""


@dataclass(frozen=True)
class ProblemTask:
    """What a worker needs.

    Attributes:
        run: the run, with this problem alone in its plan, and its sessions so far.
        cases: its cases that are measured already.
        problem: the content of its file.
        solvers: the solvers.
        plugin_files: the plugin files that they may come from, with the names that they offer.
        mix: keep what another machine has measured of the problem.
    """

    run: RunRecord
    cases: tuple[CaseRecord, ...]
    problem: bytes
    solvers: tuple[SolverSpec, ...]
    plugin_files: tuple[tuple[PluginFile, Names | None], ...] = ()
    mix: bool = False


@dataclass(frozen=True)
class MeasuredProblem:
    """What a worker returns.

    Attributes:
        session: when and where it was measured; its number is that of the sessions of the task.
        cases: all of the problem.
    """

    session: Session
    cases: tuple[CaseRecord, ...]


def measure_problem(task: ProblemTask) -> MeasuredProblem:
    """Measure a task, alone in this process. The result depends on the task alone, and nothing else changes.

    Raises:
        BenchError: if this machine has another version of the judge or of the source than where the run was begun.
    """
    here = this_machine()
    if (JUDGE, here.source) != (task.run.judge, task.run.machine.source):
        raise BenchError(f"the worker on {here.host} has another source of proxbench; install the same one everywhere.")
    for file, names in task.plugin_files:
        register(file, names, runs_here=False)
    with _one_at_a_time, tempfile.TemporaryDirectory(prefix="proxbench-", suffix=PART) as folder:
        store = Store.create(Path(folder, "run"))
        (name,) = task.run.plan.problems
        store.write_problem(read_problem(io.BytesIO(task.problem), f"problem {name!r}"))
        for case in task.cases:
            store.write_case(case)
        stored = {(case.problem, case.solver): case for case in task.cases}
        LocalExecutor(task.solvers, store, task.run, lambda event: None, task.mix).execute(stored)
        return MeasuredProblem(store.read_run().sessions[-1], tuple(store.read_cases()[0]))
