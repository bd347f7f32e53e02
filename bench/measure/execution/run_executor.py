"""Execute the plan of a run: the common part of local and distributed executors."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np
from msgspec.structs import replace

from ....problems.exchange.catalog import is_available
from ....problems.exchange.sequences import start_digest
from ....problems.representation import counted
from ...errors import InterruptedRunError
from ...plugins.problems import predecessors_of_run, problem_of_run, store_problems
from ...plugins.solver_specs import SolverSpec
from ...simulation.generation.generate import generate
from ...store.records import CaseRecord, RunRecord
from ...store.store import Store
from ..trajectories.methods import Method
from ..trajectories.problems import reference_members, simulate_references, trajectory_of
from .events import CaseFinished, OnEvent, ReferenceSimulated, RunStarted

Solvers = Sequence[SolverSpec] | Sequence[Method]
"""Solvers, or in a study, steppers with solvers."""

Item = TypeVar("Item")


class RunExecutor(ABC):
    """The state of a run, and the execution of its plan."""

    def __init__(self, solvers: Solvers, store: Store, record: RunRecord, on_event: OnEvent, mix: bool = False) -> None:
        """Store the arguments; ``mix`` allows cases of several machines in one run."""
        self._solvers, self._store, self._record, self._on_event = solvers, store, record, on_event
        self._mix = mix
        self._cases: dict[str, dict[str, CaseRecord]] = {name: {} for name in record.plan.problems}
        self._done = 0

    def execute(self, stored: Mapping[tuple[str, str], CaseRecord]) -> None:
        """Measure the cases that are not stored; do nothing if the run is finished.

        Args:
            stored: the stored cases, by problem and solver.

        Raises:
            InterruptedRunError: on Ctrl-C; stored points are kept.
        """
        for (problem, solver), case in stored.items():
            if problem in self._cases:
                self._cases[problem][solver] = case
        total = self._count_cases()
        self._done = self._count_finished()
        if self._done < total:
            self._write_run(self._record)
        self._on_event(self._start_event(total))
        try:
            self._generate_missing()
            self._discard_stale_cases()
            if self._done < total:
                self._measure()
        except KeyboardInterrupt:
            raise InterruptedRunError(self._store.folder) from None
        self._store.restore()

    @abstractmethod
    def _measure(self) -> None:
        """Measure and store the remaining cases."""

    def _discard_stale_cases(self) -> None:
        """Discard the stored cases of problems whose numbers have changed, and warm cases whose starts have changed."""
        for name, cases in self._cases.items():
            if cases:
                digest, starts = self._digest(name), self._starts(name)
                self._cases[name] = {
                    solver: case
                    for solver, case in cases.items()
                    if (case.digest, case.start) == (digest, starts.get(solver, ""))
                }
        self._done = self._count_finished()

    def _count_cases(self) -> int:
        return len(self._record.plan.problems) * len(self._record.plan.solvers)

    def _count_finished(self) -> int:
        return sum(case.is_finished(self._record.plan) for cases in self._cases.values() for case in cases.values())

    def _finished_solvers(self, name: str) -> set[str]:
        """Return the solvers whose cases of a problem are finished."""
        return {solver for solver, case in self._cases[name].items() if case.is_finished(self._record.plan)}

    def _is_finished(self, name: str) -> bool:
        return len(self._finished_solvers(name)) == len(self._record.plan.solvers)

    def _report_finished(self, case: CaseRecord) -> None:
        """Count and report a finished case."""
        self._done += 1
        self._on_event(CaseFinished(case.problem, case.solver, case.outcome, self._done, self._count_cases()))

    def _start_event(self, total: int) -> RunStarted:
        """Return the event of the start of a run with ``total`` cases."""
        plan = self._record.plan
        if not plan.trajectories:
            return RunStarted(self._store.folder, total, self._done)
        values = sum(len(method.values) for method in plan.methods)
        points = values * len(plan.trajectories)
        simulated = [trajectory for trajectory in plan.trajectories if trajectory.reference is not None]
        simulations = sum(len(reference_members(trajectory)) for trajectory in simulated)
        simulations += values * sum(len(trajectory.members) for trajectory in plan.trajectories)
        measured = sum(len(case.points) for cases in self._cases.values() for case in cases.values())
        work = f"{counted(points, 'point')}, {counted(simulations, 'simulation')}"
        return RunStarted(self._store.folder, total, self._done, points, measured, work)

    def _generate_missing(self) -> None:
        """Generate the problems that are neither stored nor available, and simulate missing references."""
        record, plan = self._record, self._record.plan
        for index, trajectory in enumerate(plan.trajectories):
            for updated in simulate_references(trajectory, plan.limits):
                trajectories = [*plan.trajectories[:index], updated, *plan.trajectories[index + 1 :]]
                plan = replace(plan, trajectories=trajectories)
                self._write_run(replace(record, plan=plan))
            self._on_event(ReferenceSimulated(plan.trajectories[index]))
        names = [] if plan.trajectories else plan.problems
        missing = [name for name in names if name not in record.carried and not is_available(name)]
        if missing:
            generate(missing)
            self._write_run(replace(record, carried={**record.carried, **store_problems(missing, self._store)}))

    def _digest(self, name: str) -> str:
        """Return the digest of a problem or trajectory."""
        plan = self._record.plan
        if plan.trajectories:
            return trajectory_of(plan.trajectory(name)).digest
        return problem_of_run(self._store, self._record, name).digest

    def _starts(self, name: str) -> dict[str, str]:
        """Return the digests of the starts of the warm solvers on a problem."""
        warm = [solver.name for solver in self._solvers if isinstance(solver, SolverSpec) and solver.starts_warm]
        if not warm:
            return {}
        problem = problem_of_run(self._store, self._record, name)
        steps = predecessors_of_run(self._store, self._record, problem).steps
        return dict.fromkeys(warm, start_digest(steps, problem))

    def _write_case(self, record: CaseRecord) -> None:
        """Store the record of a case."""
        self._cases[record.problem][record.solver] = record
        self._store.write_case(record)

    def _write_run(self, record: RunRecord) -> None:
        """Store the record of the run."""
        self._record = record
        self._store.write_run(record)


def shuffled(items: Sequence[Item], *seeds: int) -> list[Item]:
    """Return the items in a random order that the seeds determine."""
    return [items[index] for index in np.random.default_rng(seeds).permutation(len(items))]
