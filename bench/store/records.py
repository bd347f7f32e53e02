"""What a run stores, as typed records: files are written from them, checked against them, and made frames by them."""

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
"""Different answers of a point that are told apart."""


class ThreadPool(Record, frozen=True, kw_only=True):
    """A library with threads of its own, as threadpoolctl describes it."""

    user_api: str | None = None
    internal_api: str | None = None
    version: str | None = None
    num_threads: Count | None = None


class Machine(Record, frozen=True, kw_only=True):
    """Processor, memory [bytes], system, libraries with their versions, and the source.

    Attributes:
        commit: the commit of the source; empty where it is no checkout.
        dirty: whether the source differed from it.
        source: SHA-256 of the source files of this package; empty where it was not noted.
        host: its name in its network; empty where it was not noted.
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
    host: str = ""


class PluginUse(Record, frozen=True, kw_only=True):
    """A name that a run has from a plugin; a file with its SHA-256, or a package."""

    kind: str
    name: str
    source: str
    file: str = ""
    sha256: str = ""


class Session(Record, frozen=True, kw_only=True):
    """What was measured in one go, by ``run`` or ``resume``.

    Attributes:
        started: when, as ISO 8601 in UTC.
        finished: when it ended; empty if it did not.
        core: the core on which solves were timed; None where none was claimed.
        busy_cores: how many other cores were busy on average while the solves of each problem were timed.
        machine: what it was measured on; None where only the run has one.
    """

    started: str
    finished: str = ""
    machine: Machine | None = None
    core: Count | None = None
    busy_cores: list[Number] = []

    @property
    def host(self) -> str:
        """Name of the machine; empty where it was not noted."""
        return "" if self.machine is None else self.machine.host


class RunRecord(Record, frozen=True, kw_only=True):
    """A run.

    Attributes:
        run_id: its name.
        plan: what it measures.
        machine: what it was begun on.
        judge: version of the judge that its residuals are of.
        plugins: the names that it has from plugins.
        carried: digests of the problems that are stored with it, by name.
        sessions: when it was worked on, and how steady the machine was.
    """

    run_id: str
    plan: PlanRecord
    machine: Machine
    judge: Count = 1
    plugins: list[PluginUse]
    carried: dict[str, Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]] = {}
    sessions: list[Session] = []


class Curve(Record, frozen=True, kw_only=True):
    """The judged residual of the observed iterates.

    Raises:
        ValueError: if there are not as many residuals as iterations.
    """

    iteration: list[Count] = []
    residual: list[Residual] = []

    def __post_init__(self) -> None:
        if len(self.iteration) != len(self.residual):
            raise ValueError("its curve has not as many residuals as iterations")


class QuantityError(Record, frozen=True, kw_only=True):
    """The error of a trajectory in one quantity, and the ends of its bar."""

    quantity: str
    error: Residual
    low: Residual
    high: Residual


Excluded = Literal["", "preempted", "unsteady"]


class Round(Record, frozen=True, kw_only=True):
    """Timed solves of a point in one go, as the clock counted them.

    Attributes:
        session: number of the session of the run, from 0.
        number: number of the pass in it, from 0.
        turn: number of the round in the pass, from 0; those of one problem and turn are close to each other in time.
        prepare_seconds: median wall time of preparing [s], over all solves but the first, if there are others.
        solve_seconds: median wall time of solving [s], over the same.
        total_seconds: wall time of both together [s], quartiles over the same.
        repeats: number of solves.
        wall_seconds: wall time of all solves together [s].
        processor_seconds: processor time of all solves together, of all threads [s].
        involuntary_switches: context switches in which something else took the core.
        voluntary_switches: context switches in which the process gave up the core, to sleep or to wait.
        waited_seconds: time for which the process was ready to run and did not [s]; None where the system does not say.
        probe_seconds: the longer one of the probes of the core before and after [s].
        excluded: "preempted" or "unsteady" if the core was not the round's own, empty if it was.
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
    excluded: Excluded = ""


class Measured(Record, frozen=True, kw_only=True):
    """What was measured at one tolerance, or at one step of a trajectory.

    Attributes:
        iterations: of a timed solve, as the observer counted them where the solver has one; of a trajectory, one-step
            inclusions solved, median over its members.
        claimed_iterations: of that solve, as the solver counts them; None where nothing else is known.
        residual: the judge's, under Coulomb's law; of a trajectory, the largest of its errors.
        model_residual: the judge's, under the solver's own model.
        prepare_seconds, solve_seconds, total_seconds: wall times of preparing, of solving and of both, quartiles of the
            medians of the rounds that are not excluded, of all where all are.
        repeats: number of timed solves.
        is_excluded: whether all rounds are excluded, so that the times take part in no comparison.
        rounds: in which they were measured; empty for a trajectory.
        first_seconds: times of first solves in fresh processes [s]; processor times where these were preempted.
        copy_seconds: the same of copies of the problem [s].
        answers: number of different vectors of impulses among those that ended solved, up to ``MAX_ANSWERS``; of all
            solves the worst is judged.
        hashes: what tells these vectors apart.
        verdict: the other numbers of the judge's verdict.
        impulses: the answers that the residuals are of, kept at the finest point of a case; empty elsewhere.
        impulse_error: distance to the known impulses, if the problem has such.
        errors: of a trajectory, in each quantity.
        unsolved_steps: steps of all members of a trajectory that the judge does not find solved.
        failed_members: members of it that came to no end.
    """

    iterations: Count
    residual: Residual
    model_residual: Residual
    prepare_seconds: Quartiles
    solve_seconds: Quartiles
    total_seconds: Quartiles
    repeats: Count
    is_excluded: bool = False
    rounds: list[Round] = []
    first_seconds: list[Number] = []
    copy_seconds: list[Number] = []
    answers: Count = 1
    hashes: Annotated[list[str], Meta(max_length=MAX_ANSWERS)] = []
    claimed_iterations: Count | None = None
    verdict: dict[str, bool | Number | None]
    impulses: Annotated[list[Impulses], Meta(max_length=2)] = []
    impulse_error: Number | None
    errors: list[QuantityError] = []
    unsolved_steps: Count = 0
    failed_members: Count = 0


class Point(Record, frozen=True, kw_only=True):
    """One tolerance of the ladder.

    Attributes:
        tolerance: what the solver was given, or the value of the ladder of a stepper with a solver.
        outcome: how it ended.
        status: what the solver says; empty if it was not attempted.
        reason: the same in words.
        measured: numbers; None if it was not attempted.
    """

    tolerance: Tolerance
    outcome: Outcome
    status: str
    reason: str
    measured: Measured | None = None

    @property
    def rounds(self) -> list[Round]:
        """The rounds in which it was measured."""
        return [] if self.measured is None else self.measured.rounds

    @property
    def n_passes(self) -> int:
        """The number of passes that it was measured in."""
        return len({(one.session, one.number) for one in self.rounds})

    @property
    def is_late_for_others(self) -> bool:
        """Whether it reached its time limit in rounds that were all excluded, so that it may be measured again."""
        return self.outcome is Outcome.TIME_LIMIT and self.measured is not None and self.measured.is_excluded

    @property
    def is_repeated(self) -> bool:
        """Whether it is measured in several rounds, as those of solves that end solved in time are."""
        return bool(self.rounds) and self.status == Outcome.SOLVED and self.outcome is not Outcome.TIME_LIMIT


class CaseRecord(Record, frozen=True, kw_only=True):
    """One solver, or stepper with a solver, on one problem.

    Attributes:
        problem: name.
        digest: SHA-256 of the problem's numbers.
        solver: name, with options.
        model: what the solver solves.
        has_iterates: whether it shows its iterates.
        is_randomised: whether it declares that its answers differ between repeats.
        n_rows: rows of the problem.
        n_contacts: contacts of the problem.
        outcome: how the case ended.
        reason: the same in words.
        traceback: of a failed case.
        stderr: the end of what a failed case printed.
        wall_seconds: wall time of everything in it [s].
        peak_memory_bytes: most memory that it had.
        curve: how the observed solve converged.
        points: the ladder.
    """

    problem: str
    digest: str
    solver: str
    model: str
    has_iterates: bool
    is_randomised: bool = False
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
        """Return whether a plan has nothing left to measure of the case."""
        if self.outcome is not Outcome.MEASURED:
            return True
        repeated = itertools.takewhile(lambda point: point.is_repeated or point.is_late_for_others, self.points)
        return self.is_tried(plan) and all(point.n_passes >= plan.passes for point in repeated)

    def is_tried(self, plan: PlanRecord) -> bool:
        """Return whether the case has reached the end of its ladder at least once, or ended before."""
        return self.outcome is not Outcome.MEASURED or len(self.points) >= len(plan.ladder(self.solver))


def with_sessions(case: CaseRecord, places: Sequence[int]) -> CaseRecord:
    """Return a case in a run where its sessions have these numbers."""

    def moved(point: Point) -> Point:
        if point.measured is None:
            return point
        rounds = [replace(one, session=places[one.session]) for one in point.rounds]
        return replace(point, measured=replace(point.measured, rounds=rounds))

    return replace(case, points=[moved(point) for point in case.points])
