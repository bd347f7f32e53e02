"""A part of a run: one problem with all its solvers, as a task that any process on any machine can do.

All solvers of a problem are in one part, since they take turns and their rounds are compared in pairs.
"""

import io
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path

from ....problems.contact.judge import JUDGE
from ....problems.exchange.atomic_file import PART
from ....problems.exchange.plugin_files import PluginFile
from ....problems.exchange.plugins import Names, register
from ....problems.exchange.storage import read_problem
from ...errors import BenchError
from ...plugins.contestants import Contestant
from ...store.records import CaseRecord, RunRecord, Session
from ...store.store import Store
from ..machine import this_machine
from .progress import Progress

_alone = threading.Lock()
"""One part at a time in a process: executors may have several threads in each."""


@dataclass(frozen=True)
class Part:
    """What a worker needs.

    Attributes:
        run: the run, with this problem alone in its plan, and its sessions so far.
        cases: what is measured of them already.
        problem: the content of its file.
        contestants: the solvers.
        plugin_files: the plugin files that they may come from, with the names that they offer.
        mix: keep what another machine has measured of the problem.
    """

    run: RunRecord
    cases: tuple[CaseRecord, ...]
    problem: bytes
    contestants: tuple[Contestant, ...]
    plugin_files: tuple[tuple[PluginFile, Names | None], ...] = ()
    mix: bool = False


@dataclass(frozen=True)
class MeasuredPart:
    """What a worker returns.

    Attributes:
        session: when and where it was measured; its number is that of the sessions of the part.
        cases: all of the problem.
        is_anew: whether what another machine had measured of it was left out.
    """

    session: Session
    cases: tuple[CaseRecord, ...]
    is_anew: bool = False


def measure_part(part: Part) -> MeasuredPart:
    """Measure a part, alone in this process; it depends on nothing but the part, and changes nothing elsewhere.

    Raises:
        BenchError: if this machine has another version of the judge or of the source than where the run was begun.
    """
    here = this_machine()
    if (JUDGE, here.source) != (part.run.judge, part.run.machine.source):
        raise BenchError(f"the worker on {here.host} has another source of proxbench; install the same one everywhere.")
    for file, names in part.plugin_files:
        register(file, names, runs_here=False)
    with _alone, tempfile.TemporaryDirectory(prefix="proxbench-", suffix=PART) as folder:
        store = Store.create(Path(folder, "run"))
        (name,) = part.run.plan.problems
        store.write_problem(read_problem(io.BytesIO(part.problem), f"problem {name!r}"))
        for case in part.cases:
            store.write_case(case)
        stored = {(case.problem, case.solver): case for case in part.cases}
        progress = Progress(part.contestants, store, part.run, lambda event: None, part.mix)
        progress.complete(stored)
        return MeasuredPart(store.read_run().sessions[-1], tuple(store.read_cases()[0]), bool(progress.begun_anew))
