"""Control solves: first solves in fresh processes, which detect solvers that repeat stored answers.

A process that has warmed up on a copy of the problem with another solution is forked. The fork solves the copy again
until its caches are warm, then solves the problem for the first time, in new units (``variants``), and ends. Let t₁ be
the time of such a first solve, and t that of repeated ones. The first solve is fast, or *explained*, if

    t₁ ≤ EXPLAINED_RATIO t + ALLOWANCE_SECONDS.

The speed of a core drifts. After a slow first solve, another round of repeated ones gives a second t, and the larger
one counts. First solves end when the fast ones outnumber the slow ones by ``MIN_FAST_SOLVES``, or the slow ones the
fast ones by ``MAX_SLOW_SOLVES``. If even the fastest is slow for the largest t, a note states both times (``notes``).

A solver has misbehaved if the fastest first solve exceeds ``MAX_RATIO`` t + ``MAX_ALLOWANCE_SECONDS`` for the median
t. Two other reasons for such times are excluded first:

* A solver may load or compile something in its first solve, and the first run of any code is slow. A second series of
  first solves therefore runs in forks that have loaded all cached kernels and solved copies to the same tolerance.
* Copies may take fewer iterations than the problem, and run other code. If fewer than ``MIN_SIMILAR_COPIES`` of them
  take about as many, a third series runs in forks that have solved the problem itself in several other units. All
  these solves run the same code, and the solver is reported only if this series is slow as well. A solver that stores
  answers for all units and miscounts its iterations only gets a note.

Only solves during which no other program used the core count against a solver, if more than half of
``MAX_SLOW_SOLVES`` do.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Status, Stop
from ....problems.exchange.files.problem_file import problem_bytes
from ...isolation.child import FORK_REQUEST
from ...isolation.fork_server import load_kernels
from ...isolation.worker import Fault, Worker, numbers_of
from ...plugins.solver_specs import SolverSpec
from ...store.notes import is_explained
from ...store.outcome import Outcome
from ...store.plans import Limits
from ..measuring_core import MeasuringCore
from ..timed_round import TimedRound
from .case_process import MeasuringRequest, MeasuringTask
from .variants import disguised_copy, in_other_units

MIN_FAST_SOLVES = 2
"""Number by which fast first solves must outnumber slow ones; 1 suffices for long solves."""

LONG_SECONDS = 0.02
"""Time [s] above which a solve counts as long. Times of long solves vary less."""

MAX_SLOW_SOLVES = 4
"""Number by which slow first solves outnumber fast ones at the end of a series; also the size of further series."""

MAX_SOLVES = 9
"""Largest number of first solves in the first series of a point."""

MAX_RATIO, MAX_ALLOWANCE_SECONDS = 1.5, 2e-4
"""Factor and time [s] by which first solves must exceed repeated ones to prove a repeated answer."""

MAX_LOADED_COPIES = 2
"""Number of first copies after which, if the copy is slow, cached kernels are loaded.

The first copy may compile kernels, which are then loaded after the second one.
"""

N_COPIES, MAX_WARM_UPS = 2, 8
"""Least and largest number of problems that a fork solves before a further first solve, to warm up its code."""

WARM_UP_SECONDS = 0.02
"""Time for which a fork solves these problems, unless the largest number is reached before [s]."""

MIN_SECONDS = 1e-6
"""Least time that a solve is assumed to take [s]."""

MIN_SIMILAR_COPIES, MAX_DIFFERENCE = 2, 0.25
"""Least number of copies whose iterations must equal those of the problem to within this relative difference."""

MAX_COPIES = 6
"""Largest number of copies to solve if the first one is slower than the problem."""

WARM_UP_STOP = Stop(1e-8, max_iterations=200, max_seconds=0.1)
"""Limits of the solve that warms up a process, so that timed solves and forks load nothing."""


@dataclass(frozen=True)
class ControlSolve:
    """A first solve in a fresh process.

    Attributes:
        problem: the problem, or a copy of it.
        timed: the round that ends with the solve.
        impulses: the solution in the units of ``problem`` [N s], shape (n_rows,).
        is_steady: whether the probes of the core before and after it are close to the reference.
        is_first: False if the process had solved the problem in other units before; such a time is not stored.
        repeated: time of repeated solves [s]; measured again directly after a solve whose time it does not explain.
    """

    problem: ContactProblem
    timed: TimedRound
    impulses: FloatArray
    is_steady: bool = True
    repeated: float = 0.0
    is_first: bool = True

    @property
    def is_undisturbed(self) -> bool:
        """Whether no other program used the core."""
        return self.is_steady and not self.timed.is_preempted

    @property
    def is_counted(self) -> bool:
        """Whether the solve succeeded and was undisturbed."""
        return self.timed.status is Status.SOLVED and self.is_undisturbed

    @property
    def seconds(self) -> float:
        """Wall time, or processor time if its process was preempted [s]."""
        return float(self.timed.undisturbed[-1])

    @property
    def has_similar_copies(self) -> bool:
        """Whether enough of the copies before it took about as many iterations, so that they ran the same code."""
        own = self.timed.iterations
        similar = [abs(count - own) <= MAX_DIFFERENCE * own for count in self.timed.earlier_iterations]
        return sum(similar) >= MIN_SIMILAR_COPIES

    @property
    def is_explained(self) -> bool:
        """Whether the time of repeated solves explains its time."""
        return is_explained(self.repeated, self.seconds)


class Controls:
    """A process that runs the first solves of one solver on one problem, each in a fork.

    Attributes:
        problem: the problem.
        warm_up: file content of a copy of the problem to warm up on.
        solver: the solver.
        limits: limits of the case.
        core: the measuring core.
    """

    def __init__(self, problem: ContactProblem, warm_up: bytes, solver: SolverSpec, limits: Limits) -> None:
        self.problem, self.warm_up, self.solver, self.limits = problem, warm_up, solver, limits
        self.core = MeasuringCore(None)
        self._worker: Worker | None = None
        self._can_fork, self._loads_kernels = True, False

    def dismiss(self) -> None:
        """Ask the process to end, without waiting for it."""
        if self._worker is not None:
            self._worker.dismiss()

    def pin_to_core(self, core: MeasuringCore) -> None:
        """Pin the process to a core from now on."""
        self.core = core
        if self._worker is not None:
            core.pin(self._worker.process, self.solver.threads)

    def close(self) -> None:
        """End the process, and wait for its end."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def solve_once(self, problem: ContactProblem, stop: Stop, start: FloatArray | None) -> FloatArray:
        """Return the impulses [N s] of one solve of any problem from ``start``, in a fork of the warmed-up process.

        Raises:
            Fault: if there is no valid answer.
        """
        _, impulses = self._solve_in_fork(stop, problem_bytes(problem.anonymous()), start=start)
        return _validated(impulses, problem.n_rows)

    def first_solves(
        self, stop: Stop, seconds: float, measure_again: Callable[[], float], start: FloatArray | None = None
    ) -> list[ControlSolve]:
        """Return first solves of the problem.

        If a solve does not have the status SOLVED, it is replaced by a solve in the units of the problem, the last one.

        Args:
            stop: stop criterion of the timed solves, which have the status SOLVED.
            seconds: median time of the timed solves [s].
            measure_again: function that measures one more round, and returns its median time [s].
            start: impulses from which they started [N s], shape (n_rows,); zero if None.

        Raises:
            Fault: MISBEHAVED if the timed solves repeat an answer, or another fault that ends the process.
        """
        solves: list[ControlSolve] = []
        needed, balance = 1 if seconds > LONG_SECONDS else MIN_FAST_SOLVES, 0
        for _ in range(MAX_SOLVES):
            solve = _with_repeated_seconds(self._first_solve(stop, start), seconds, measure_again)
            if solve.timed.status is not Status.SOLVED:
                return [*solves, self._unscaled_solve(stop, seconds, start)]
            solves.append(solve)
            balance += 1 if solve.is_explained else -1
            if balance >= needed:
                return solves
            if balance <= -MAX_SLOW_SOLVES:
                break
        self._load_kernels()
        number = self._number_of_warm_ups(stop, seconds)

        def solve_after(problems: Sequence[ContactProblem]) -> ControlSolve:
            return _with_repeated_seconds(self._first_solve(stop, start, problems), seconds, measure_again)

        after_copies = [solve_after(self._copies(stop, number)) for _ in range(MAX_SLOW_SOLVES)]
        after_variants: list[ControlSolve] = []
        if _evidence_of_repetition(after_copies, solves) and not all(
            solve.has_similar_copies for solve in after_copies
        ):
            after_variants = [
                replace(solve_after(self._variants(number)), is_first=False) for _ in range(MAX_SLOW_SOLVES)
            ]
        times = _evidence_of_repetition(after_variants or after_copies, [*solves, *after_copies])
        if times is not None:
            raise _repetition_fault(stop, f"take {times[0]:.3g} s", times[1])
        return [*min(solves, after_copies, key=_median_seconds), *after_variants]

    def copies(self, stop: Stop, seconds: float, measure_again: Callable[[], float]) -> list[ControlSolve]:
        """Return first solves of copies: one if repeated solves explain its time, else several.

        Args:
            stop: stop criterion of the timed solves.
            seconds: median time of the timed solves [s].
            measure_again: function that measures one more round, and returns its median time [s].
        """
        solves: list[ControlSolve] = []
        for _ in range(MAX_COPIES):
            problems = [*(self._copies(stop, N_COPIES) if solves else ()), disguised_copy(self.problem, stop.tolerance)]
            solve = self._control_solve(problems[-1], stop, *map(problem_bytes, problems))
            solve = _with_repeated_seconds(solve, seconds, measure_again)
            if solve.timed.status is not Status.SOLVED:
                break
            solves.append(solve)
            if solve.is_undisturbed and solve.is_explained:
                break
            if not solve.is_explained and len(solves) <= MAX_LOADED_COPIES:
                self._load_kernels()
        return solves

    def _number_of_warm_ups(self, stop: Stop, seconds: float) -> int:
        """Return how many problems a fork solves before a further first solve, within the time limit of the case."""
        max_number = min(MAX_WARM_UPS, int(self.limits.case_seconds / stop.max_seconds) - 1)
        return max(N_COPIES, min(max_number, ceil(WARM_UP_SECONDS / max(seconds, MIN_SECONDS))))

    def _copies(self, stop: Stop, number: int) -> list[ContactProblem]:
        """Return copies of the problem to solve before a first solve."""
        return [disguised_copy(self.problem, stop.tolerance) for _ in range(number)]

    def _variants(self, number: int) -> list[ContactProblem]:
        """Return the problem in different units, to solve before a solve in yet other units."""
        return [in_other_units(self.problem).problem for _ in range(number)]

    def _first_solve(self, stop: Stop, start: FloatArray | None, after: Sequence[ContactProblem] = ()) -> ControlSolve:
        """Return a first solve of the problem in other units, in a process that may first solve other problems."""
        variant = in_other_units(self.problem)
        problems = [*after, variant.problem]
        scale = variant.back.diagonal()
        start = None if start is None else start / scale
        return self._control_solve(self.problem, stop, *map(problem_bytes, problems), start=start, scale=scale)

    def _unscaled_solve(self, stop: Stop, seconds: float, start: FloatArray | None) -> ControlSolve:
        """Return a first solve of the problem in its own units.

        Raises:
            Fault: if it reaches the time limit although repeated solves take far less time.
        """
        solve = self._control_solve(self.problem, stop, problem_bytes(self.problem.anonymous()), start=start)
        is_late = solve.timed.status is Status.TIME_LIMIT and solve.is_undisturbed
        if is_late and _is_repeated(seconds, stop.max_seconds):
            raise _repetition_fault(stop, f"reach the time limit of {stop.max_seconds:g} s", seconds)
        return solve

    def _control_solve(
        self,
        problem: ContactProblem,
        stop: Stop,
        *problems: bytes,
        start: FloatArray | None = None,
        scale: FloatArray | float = 1.0,
    ) -> ControlSolve:
        """Return the solve of the last of ``problems`` in a fork; its impulses times ``scale`` solve ``problem``."""
        probe = self.core.probe()
        timed, impulses = self._solve_in_fork(stop, *problems, start=start)
        is_steady = self.core.is_steady(probe, self.core.probe())
        return ControlSolve(problem, timed, scale * _validated(impulses, problem.n_rows), is_steady)

    def _load_kernels(self) -> None:
        """Continue in a process with all cached kernels in memory; the fork server loads those of the framework."""
        if not self._loads_kernels:
            self._loads_kernels = True
            load_kernels()
            self.close()
        elif self._worker is not None:
            self._worker.ask(MeasuringRequest.LOAD_KERNELS)

    def _solve_in_fork(
        self, stop: Stop, *problems: bytes, start: FloatArray | None = None
    ) -> tuple[TimedRound, FloatArray]:
        """Solve problems one after the other in a fork, the last from ``start``; if forking fails, in new processes.

        Raises:
            Fault: if both fail.
        """
        try:
            return self._ask(stop, problems, start)
        except Fault as fault:
            self.close()
            if not self._can_fork:
                raise Fault(fault.outcome, f"in a fresh process {fault.reason}", fault.traceback) from None
            self._can_fork = False
            return self._solve_in_fork(stop, *problems, start=start)

    def _ask(self, stop: Stop, problems: Sequence[bytes], start: FloatArray | None) -> tuple[TimedRound, FloatArray]:
        """Solve problems successively in a process that has only warmed up; return the solves and the last answer.

        Raises:
            Fault: if the answer is invalid.
        """
        if self._worker is None:
            task = MeasuringTask(self.warm_up, self.solver)
            limits, solvers = self.limits, self.solver.compiled_solvers
            self._worker = Worker(task, limits.case_seconds, limits.memory_bytes, solvers)
            self._worker.ask(MeasuringRequest.WARM_UP, WARM_UP_STOP)
            if self._loads_kernels:
                self._worker.ask(MeasuringRequest.LOAD_KERNELS)
            self.core.pin(self._worker.process, self.solver.threads)
        worker, request = self._worker, (MeasuringRequest.FIRST_SOLVES, (stop, problems, start))
        worker.busy_seconds = 0.0
        began = time.monotonic()
        answer, content = worker.ask(FORK_REQUEST, *request) if self._can_fork else worker.ask(request[0], *request[1])
        passed = time.monotonic() - began
        if not self._can_fork:
            self.close()
        return TimedRound.read(answer, passed, self.solver.is_built_in), numbers_of(content)


def _with_repeated_seconds(solve: ControlSolve, seconds: float, measure_again: Callable[[], float]) -> ControlSolve:
    """Return a solve with the time of repeated ones [s], measured again if they do not explain that of the solve."""
    is_slow = solve.timed.status is Status.SOLVED and not is_explained(seconds, solve.seconds)
    return replace(solve, repeated=max(seconds, measure_again()) if is_slow else seconds)


def _validated(impulses: FloatArray, n_rows: int) -> FloatArray:
    """Return the impulses of an answer.

    Raises:
        Fault: if their number is wrong.
    """
    if len(impulses) != n_rows:
        raise Fault(Outcome.MISBEHAVED, f"it returned {len(impulses)} numbers for {n_rows} rows")
    return impulses


def _evidence_of_repetition(
    decisive: Sequence[ControlSolve], others: Sequence[ControlSolve]
) -> tuple[float, float] | None:
    """Return the times of the fastest first solve and of repeated solves [s] if these must repeat an answer.

    Most of the decisive solves must be solved and undisturbed. The median of their repeated times counts, because a
    solver may not repeat its answer in a single one.
    """
    counted = [solve for solve in decisive if solve.is_counted]
    if len(counted) <= MAX_SLOW_SOLVES // 2:
        return None
    first = min(one.seconds for one in [*counted, *(solve for solve in others if solve.is_counted)])
    repeated = float(np.median([one.repeated for one in counted]))
    return (first, repeated) if _is_repeated(repeated, first) else None


def _median_seconds(solves: Sequence[ControlSolve]) -> float:
    return float(np.median([one.seconds for one in solves]))


def _is_repeated(repeated: float, first: float) -> bool:
    """Return whether first solves [s] take so much longer than repeated ones [s] that these must reuse an answer."""
    return first > MAX_RATIO * repeated + MAX_ALLOWANCE_SECONDS


def _repetition_fault(stop: Stop, first_times: str, seconds: float) -> Fault:
    """Return the fault of a solver that repeats an answer.

    Args:
        stop: stop criterion of the solves.
        first_times: what first solves do, such as "take 2 s".
        seconds: time of repeated solves [s].
    """
    times = (
        f"first solves to {stop.tolerance:g}, in fresh processes, {first_times} and repeated ones take {seconds:.3g} s"
    )
    return Fault(Outcome.MISBEHAVED, f"{times}: it repeats answers instead of solving")
