"""The records of a run. Files are written from them and validated against them; frames have their fields as columns."""

import itertools
from collections.abc import Sequence
from typing import Annotated, Literal

from msgspec import Meta
from msgspec.structs import replace

from .fields import Count, Number, Quartiles, Record, Residual, Tolerance
from .impulses import Impulses
from .outcome import Outcome
from .plans import PlanRecord

MAX_ANSWERS = 20
"""Largest number of distinct answers of a point that are counted."""


class ThreadPool(Record, frozen=True, kw_only=True):
    """A multithreaded library, as threadpoolctl describes it. Cases use one thread of each library."""

    user_api: str | None = None
    internal_api: str | None = None
    version: str | None = None


class Machine(Record, frozen=True, kw_only=True):
    """Processor, memory [bytes], system, libraries with their versions, and the source.

    Attributes:
        commit: commit of the source; empty outside a checkout.
        dirty: whether the source differed from the commit.
        source: SHA-256 of the source files of this package; empty if unknown.
        settings: variables of the environment that change times.
        host: host name; empty if unknown.
    """

    processor: str
    cores: Count
    logical_cores: Count
    memory_bytes: Count
    system: str
    python: str
    versions: dict[str, str]
    thread_pools: list[ThreadPool]
    commit: str
    dirty: bool
    source: str = ""
    settings: dict[str, str] = {}
    host: str = ""


class PluginUse(Record, frozen=True, kw_only=True):
    """A solver, problem or scene of a plugin, or a solver in another language.

    Attributes:
        kind: "solver", "problem" or "scene".
        name: its name.
        source: its plugin, for messages; for a solver in another language, its file, name and version.
        file: path of the plugin file, shared library or program; empty for a plugin package.
        sha256: SHA-256 of this file; empty for a plugin package.
    """

    kind: str
    name: str
    source: str
    file: str = ""
    sha256: str = ""


class Session(Record, frozen=True, kw_only=True):
    """One call of ``run`` or ``resume``.

    Attributes:
        started: start time, as ISO 8601 in UTC.
        finished: end time; empty if the session was killed.
        core: core on which solves were timed; None if none was reserved.
        busy_cores: mean number of other busy cores while the solves of each problem were timed.
        machine: machine of the session.
    """

    started: str
    finished: str = ""
    machine: Machine
    core: Count | None = None
    busy_cores: list[Number] = []


class RunRecord(Record, frozen=True, kw_only=True):
    """A run.

    Attributes:
        run_id: name of the run.
        plan: problems, solvers and settings.
        machine: machine of the first session.
        judge: version of the judge.
        plugins: solvers, problems and scenes of plugins.
        carried: digests of the problems stored with the run, by name.
        sessions: times, machines and load of the sessions.
    """

    run_id: str
    plan: PlanRecord
    machine: Machine
    judge: Count = 1
    plugins: list[PluginUse]
    carried: dict[str, Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]] = {}
    sessions: list[Session] = []


class Curve(Record, frozen=True, kw_only=True):
    """Judged residuals of the observed iterates.

    Attributes:
        iteration: numbers of the iterations, ascending.
        residual: judged residual of each.

    Raises:
        ValueError: if the numbers of residuals and iterations differ.
    """

    iteration: list[Count] = []
    residual: list[Residual] = []

    def __post_init__(self) -> None:
        if len(self.iteration) != len(self.residual):
            raise ValueError("its curve has different numbers of residuals and iterations")


class QuantityError(Record, frozen=True, kw_only=True):
    """Error of a trajectory in one quantity, with the ends of its error bar."""

    quantity: str
    error: Residual
    low: Residual
    high: Residual


Excluded = Literal["", "preempted", "unsteady"]
"""Why a round is excluded; empty if it is counted."""


class Round(Record, frozen=True, kw_only=True):
    """Consecutive timed solves of a point.

    Attributes:
        session: number of the session of the run, from 0.
        number: number of the pass in the session, from 0.
        turn: number of the round in the pass, from 0; rounds of one problem and turn are close in time.
        prepare_seconds: median wall time of preparing [s], over all solves but the first if there are others.
        solve_seconds: median wall time of the same solves [s].
        total_seconds: wall time of both together [s], quartiles over the same solves.
        repeats: number of solves.
        wall_seconds: wall time of all solves together [s].
        processor_seconds: processor time of all solves together, of all threads [s].
        involuntary_switches: context switches that preempted the process.
        voluntary_switches: context switches in which the process slept or waited.
        waited_seconds: time for which the process was ready to run but did not run [s]; None if unknown.
        probe_seconds: longer of the probes of the core before and after the round [s].
        uncounted_seconds: wall time of all solves together outside the library of an external solver, if only the
            library is timed [s].
        excluded: "preempted" or "unsteady" if other programs used the core; empty otherwise.
    """

    session: Count
    number: Count
    turn: Count = 0
    prepare_seconds: Number
    solve_seconds: Number
    total_seconds: Quartiles
    repeats: Count
    wall_seconds: Number
    processor_seconds: Number
    involuntary_switches: Count
    voluntary_switches: Count
    waited_seconds: Number | None = None
    probe_seconds: Number
    uncounted_seconds: Number = 0.0
    excluded: Excluded = ""


class ObservedSolve(Record, frozen=True, kw_only=True):
    """Counts of one observed solve.

    Attributes:
        observed_iterates: number of iterates that it shows to its observer.
        observed_iterations: number of iterations that it reports.
    """

    observed_iterates: Count
    observed_iterations: Count


class Measured(Record, frozen=True, kw_only=True):
    """Measurements at one tolerance, or at one step of a trajectory.

    Attributes:
        iterations: iterations of the solve with the residual ``residual`` as the solver reports them, or the number of
            iterates of an observed solve if it reports fewer; of a trajectory, the number of solved one-step
            inclusions, median over its members.
        claimed_iterations: iterations that the solver reports; None if they equal ``iterations``.
        observed: an observed solve to the tolerance, if it shows another number of iterates than it reports.
        residual: judged residual under Coulomb's law; of a trajectory, its largest error.
        model_residual: judged residual under the solver's own model.
        prepare_seconds, solve_seconds, total_seconds: wall times of preparing, solving and both [s], quartiles of the
            medians of the counted rounds, or of all rounds if all are excluded; of a trajectory, a round is a member.
        processor_seconds: processor times of a solve, mean over a round [s], quartiles over the same rounds; None in
            runs that were stored before they were counted.
        repeats: number of timed solves.
        is_excluded: whether all rounds are excluded, so that comparisons ignore the times.
        rounds: the rounds; a trajectory has one for each member.
        first_seconds: times of first solves in fresh processes during which no other program used the core [s].
        first_repeated_seconds: for each of them, the time of repeated solves that it is compared with [s].
        copy_seconds: times of first solves of copies of the problem [s].
        copy_repeated_seconds: for each of them, the time of repeated solves of the problem [s].
        answers: number of distinct impulse vectors claimed as solutions, up to ``MAX_ANSWERS``; the worst one counts.
        hashes: hashes of these vectors.
        verdict: the other numbers of the verdict.
        impulses: the impulses with the worst verdicts, stored at the finest point of a case; empty elsewhere.
        impulse_error: distance to the known impulses; None if they are unknown.
        errors: errors of a trajectory, one for each quantity.
        unsolved_steps: number of steps of all members of a trajectory whose judged residual is too large.
        overlapping_steps: number of steps of all members whose projection of positions leaves overlaps deeper than its
            tolerance; 0 in runs that were stored before it was counted.
        failed_members: number of members of a trajectory that failed.
    """

    iterations: Count
    residual: Residual
    model_residual: Residual
    prepare_seconds: Quartiles
    solve_seconds: Quartiles
    total_seconds: Quartiles
    processor_seconds: Quartiles | None = None
    repeats: Count
    is_excluded: bool = False
    rounds: list[Round] = []
    first_seconds: list[Number] = []
    first_repeated_seconds: list[Number] = []
    copy_seconds: list[Number] = []
    copy_repeated_seconds: list[Number] = []
    answers: Count = 1
    hashes: Annotated[list[str], Meta(max_length=MAX_ANSWERS)] = []
    claimed_iterations: Count | None = None
    observed: ObservedSolve | None = None
    verdict: dict[str, bool | Number | None]
    impulses: Annotated[list[Impulses], Meta(max_length=2)] = []
    impulse_error: Number | None
    errors: list[QuantityError] = []
    unsolved_steps: Count = 0
    overlapping_steps: Count = 0
    failed_members: Count = 0


class Point(Record, frozen=True, kw_only=True):
    """One tolerance of the ladder.

    Attributes:
        tolerance: tolerance of the solver, or value of the ladder of a stepper with a solver.
        outcome: the outcome.
        status: status that the solver returned; empty if the point was not attempted.
        reason: reason of the outcome, in words.
        measured: measurements; None if the point was not attempted.
    """

    tolerance: Tolerance
    outcome: Outcome
    status: str
    reason: str
    measured: Measured | None = None

    @property
    def rounds(self) -> list[Round]:
        """The rounds in which the point was measured."""
        return [] if self.measured is None else self.measured.rounds

    @property
    def n_passes(self) -> int:
        """Number of passes in which the point was measured."""
        return len({(timed.session, timed.number) for timed in self.rounds})

    @property
    def last_pass(self) -> int:
        """Number of the last pass in which the point was measured; -1 if there is none."""
        return max((timed.number for timed in self.rounds), default=-1)

    @property
    def is_late_under_load(self) -> bool:
        """Whether the time limit was reached in excluded rounds only, so that the point may be measured again."""
        return self.outcome is Outcome.TIME_LIMIT and self.measured is not None and self.measured.is_excluded

    @property
    def is_repeated(self) -> bool:
        """Whether the point is measured in several rounds, as solved points within the time limit are."""
        return bool(self.rounds) and self.status == Outcome.SOLVED and self.outcome is not Outcome.TIME_LIMIT


class CaseRecord(Record, frozen=True, kw_only=True):
    """One solver, or stepper with a solver, on one problem.

    Attributes:
        problem: name of the problem.
        digest: SHA-256 of the problem's numbers.
        start: digest of the earlier steps and the contacts that a warm start continues; empty for a start from zero,
            and in runs that were stored before it was recorded. Cases of one solver are comparable only if both digests
            are equal.
        solver: name of the solver, with options.
        model: model that the solver solves.
        has_iterates: whether the solver has observable iterates.
        is_randomised: whether the solver declares that its answers differ between repeats.
        threads: number of threads that the solver declares.
        threads_used: largest number of threads that it used on this problem; 0 if it has no timed solve, and in runs
            that were stored before it was recorded.
        n_rows: number of rows of the problem.
        n_contacts: number of contacts of the problem.
        outcome: the outcome.
        reason: reason of the outcome, in words.
        traceback: traceback of a failed case.
        stderr: last lines that a failed case printed.
        wall_seconds: wall time of the whole case [s].
        peak_memory_bytes: peak memory [bytes].
        curve: convergence curve of the observed solve.
        points: the ladder.
    """

    problem: str
    digest: str
    start: Annotated[str, Meta(pattern="^([0-9a-f]{16})?$")] = ""
    solver: str
    model: str
    has_iterates: bool
    is_randomised: bool = False
    threads: Annotated[int, Meta(ge=1)] = 1
    threads_used: Count = 0
    n_rows: Count
    n_contacts: Count
    outcome: Outcome
    reason: str
    traceback: str
    stderr: str
    wall_seconds: Number
    peak_memory_bytes: Count
    curve: Curve
    points: list[Point]

    def is_finished(self, plan: PlanRecord) -> bool:
        """Return whether the case is measured as far as a plan requires.

        Points have fewer passes than the plan if earlier passes did not reach them, because a coarser point was late
        under load.
        """
        if self.outcome is not Outcome.MEASURED:
            return True
        repeated = itertools.takewhile(lambda point: point.is_repeated or point.is_late_under_load, self.points)
        is_measured = all(point.n_passes >= plan.passes or point.last_pass >= plan.passes - 1 for point in repeated)
        return self.is_tried(plan) and is_measured

    def is_tried(self, plan: PlanRecord) -> bool:
        """Return whether the whole ladder was measured at least once, or the case failed."""
        return self.outcome is not Outcome.MEASURED or len(self.points) >= len(plan.ladder(self.solver))


def with_sessions(case: CaseRecord, new_numbers: Sequence[int]) -> CaseRecord:
    """Return a case with the sessions of its rounds renumbered: ``new_numbers[i]`` instead of i."""

    def renumbered(point: Point) -> Point:
        if point.measured is None:
            return point
        rounds = [replace(timed, session=new_numbers[timed.session]) for timed in point.rounds]
        return replace(point, measured=replace(point.measured, rounds=rounds))

    return replace(case, points=[renumbered(point) for point in case.points])
