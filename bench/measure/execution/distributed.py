"""Execute the plan of a run on the workers of an executor, with one task for each problem.

Executors such as dask may repeat the task of a lost worker; a repeated task writes the same cases again. An error at
the end reports the number of lost problems; a resumed run measures them.
"""

from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from shlex import quote

from msgspec.structs import replace

from ....problems.errors import first_line
from ....problems.exchange.files.problem_file import packed_problem
from ....problems.exchange.plugins.offers import registered
from ...errors import BenchError
from ...plugins.problems import predecessors_of_run, problem_of_run
from ...plugins.solver_specs import SolverSpec
from ...store.records import RunRecord, Session, with_sessions
from ...store.store import Store
from .events import OnEvent, ProblemPassFinished
from .problem_task import MeasuredProblem, ProblemTask, measure_problem
from .run_executor import RunExecutor, Solvers, shuffled

MAX_SUBMITTED = 64
"""Largest number of tasks that are submitted to the executor at a time."""


class DistributedExecutor(RunExecutor):
    """Measure in the processes of workers only, not in this process."""

    def __init__(
        self, solvers: Solvers, store: Store, record: RunRecord, on_event: OnEvent, *, executor: Executor, mix: bool
    ) -> None:
        """Store the arguments; ``mix`` allows cases of several machines in one run."""
        super().__init__(solvers, store, record, on_event, mix)
        self._executor = executor
        self._n_earlier_sessions = len(record.sessions)
        self._lost: dict[str, BaseException] = {}

    def _measure(self) -> None:
        """Submit each unfinished problem to the executor, and store the results.

        Raises:
            BenchError: if problems were lost with their workers, or rejected by them; other results are stored.
        """
        plan = self._record.plan
        pending = [name for name in shuffled(plan.problems, plan.seed, 0) if not self._is_finished(name)]
        n_done, running = len(plan.problems) - len(pending), dict[Future[MeasuredProblem], str]()
        try:
            while pending or running:
                self._submit(pending, running)
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    name, fault = running.pop(future), _fault(future)
                    if fault is None:
                        self._store_result(name, future.result())
                        n_done += 1
                        self._on_event(ProblemPassFinished(name, n_done, len(plan.problems)))
                    else:
                        self._lost[name] = fault
        finally:
            for future in running:
                future.cancel()
        self._require_all_measured()

    def _submit(self, pending: list[str], running: dict[Future[MeasuredProblem], str]) -> None:
        """Submit problems up to the limit; if the executor accepts no more, the remaining ones are lost."""
        try:
            while pending and len(running) < MAX_SUBMITTED:
                running[self._executor.submit(measure_problem, self._task(pending[0]))] = pending[0]
                pending.pop(0)
        except (RuntimeError, OSError) as error:
            self._lost |= dict.fromkeys(pending, error)
            pending.clear()

    def _require_all_measured(self) -> None:
        """Raise ``BenchError`` if problems were lost."""
        if self._lost:
            count = f"{len(self._lost)} of {len(self._record.plan.problems)} problems"
            reason, folder = first_line(next(iter(self._lost.values()))), self._store.folder
            raise BenchError(
                f"{count} could not be measured ({reason}); the other results are stored; resume with: "
                f"proxbench run --resume {quote(str(folder))}"
            )

    def _task(self, name: str) -> ProblemTask:
        """Return the task that measures a problem."""
        record, plan = self._record, self._record.plan
        problem = problem_of_run(self._store, record, name)
        solvers = tuple(solver for solver in self._solvers if isinstance(solver, SolverSpec))
        is_warm = any(solver.starts_warm for solver in solvers)
        steps = predecessors_of_run(self._store, record, problem).steps if is_warm else ()
        task_run = replace(
            record,
            plan=replace(plan, problems=[name], families={name: plan.family(name)}, left_out=[], shard=""),
            carried={step.name: step.digest for step in (*steps, problem)},
            sessions=record.sessions[: self._n_earlier_sessions],
        )
        cases = tuple(self._cases[name].values())
        problems = tuple(map(packed_problem, (*steps, problem)))
        return ProblemTask(task_run, cases, problems, solvers, tuple(registered()), self._mix)

    def _store_result(self, name: str, result: MeasuredProblem) -> None:
        """Store the cases of a problem and their session."""
        finished = self._finished_solvers(name)
        session_indices = [*range(self._n_earlier_sessions), self._session_index(result.session)]
        for case in result.cases:
            self._write_case(with_sessions(case, session_indices))
            if case.is_finished(self._record.plan) and case.solver not in finished:
                self._report_finished(case)

    def _session_index(self, session: Session) -> int:
        """Add a session, or extend that of the same machine; return its index."""
        sessions = self._record.sessions
        for index, earlier in enumerate(sessions[self._n_earlier_sessions :], self._n_earlier_sessions):
            if earlier.machine.host == session.machine.host:
                busy = [*earlier.busy_cores, *session.busy_cores]
                joined = replace(earlier, finished=session.finished, busy_cores=busy)
                self._write_run(replace(self._record, sessions=[*sessions[:index], joined, *sessions[index + 1 :]]))
                return index
        self._write_run(replace(self._record, sessions=[*sessions, session]))
        return len(sessions)


def _fault(future: Future[MeasuredProblem]) -> BaseException | None:
    """Return why a task has no result; None if it has one."""
    return CancelledError("it was cancelled") if future.cancelled() else future.exception()
