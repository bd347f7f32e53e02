"""The settings and the plan of a run, set on the command line or in Python, and stored with the run."""

from collections.abc import Iterable
from numbers import Integral, Real
from typing import Annotated, Literal, Self

import msgspec
from msgspec import Meta, Struct

from ...problems.exchange.families import Sampling, family_of
from ...problems.representation import counted
from ..errors import BenchError
from .fields import MAX_NUMBER, Count, Number, Positive, Record, Tolerance

LADDER = (1e-2, 1e-4, 1e-6, 1e-8)
"""Default tolerances."""

THOROUGH_LADDER = tuple(10.0**-k for k in range(1, 11))
"""Tolerances of a thorough run, 1e-1 … 1e-10."""

PASSES, THOROUGH_PASSES = 2, 5
"""Default numbers of passes. With one pass, ratios of times have no confidence intervals."""

MAX_PASSES = 1000
"""Largest number of passes."""

MAX_MEBIBYTES = 2**40
"""Exclusive upper bound of a memory limit [MiB]."""


class Limits(Struct, frozen=True):
    """Limits of one case.

    Attributes:
        solve_seconds: limit of one solve [s].
        case_seconds: limit of all work on a case in one pass [s].
        memory_bytes: memory that a case may use beyond that of the framework [bytes].
        max_iterations: limit of iterations of one solve.

    Raises:
        BenchError: if a limit is not a positive, finite number.
    """

    solve_seconds: Number = 0.5
    case_seconds: Number = 60.0
    memory_bytes: Count = 2 * 2**30
    max_iterations: Count = 100_000

    def __post_init__(self) -> None:
        for name, value in msgspec.structs.asdict(self).items():
            require_number(name, value)
            if not 0 < value < MAX_NUMBER:
                raise BenchError(f"`{name}` must be positive and finite, got {value:g}; omit it for the default.")


def changed_limits(
    limits: Limits | None, solve_seconds: float | None, case_seconds: float | None, memory_bytes: int | None
) -> Limits:
    """Return ``limits``, or the default ones, with those other arguments that are not None.

    Raises:
        BenchError: if ``limits`` is not a ``Limits``, or a change is not a positive, finite number.
    """
    given: object = limits
    if given is not None and not isinstance(given, Limits):
        raise BenchError(f"`limits` must be Limits, such as Limits(solve_seconds=1.0), got {given!r:.60}.")
    changes: dict[str, float] = {} if memory_bytes is None else {"memory_bytes": memory_bytes}
    for name, seconds in (("solve_seconds", solve_seconds), ("case_seconds", case_seconds)):
        if seconds is not None:
            require_number(name, seconds)
            changes[name] = float(seconds)  # a file has no other real numbers
    return msgspec.structs.replace(limits or Limits(), **changes)


def require_number(name: str, value: object, is_whole: bool = False) -> None:
    """Raise ``BenchError`` if a setting is not a real number that a double represents, or not whole as required."""
    if isinstance(value, int) and abs(value) > MAX_NUMBER:
        raise BenchError(f"`{name}` must be less than {MAX_NUMBER:g}, got a number of {len(str(value))} digits.")
    if not isinstance(value, Real):
        raise BenchError(f"`{name}` must be a number, got {value!r:.60}.")
    if is_whole and not isinstance(value, Integral):
        raise BenchError(f"`{name}` must be a whole number, got {value!r:.60}.")


def limit_in_bytes(memory: float | None) -> int | None:
    """Convert a memory limit from MiB to bytes; None remains None.

    Raises:
        BenchError: if the limit is not a number, less than 1 MiB or not finite.
    """
    if memory is None:
        return None
    require_number("memory", memory)
    if not 1 <= memory < MAX_MEBIBYTES:
        raise BenchError(f"`memory` must be at least 1 MiB and finite, got {memory:g} MiB; omit it for the default.")
    return round(memory * 2**20)


class RunSettings(Record, frozen=True, kw_only=True):
    """Settings of a run.

    Attributes:
        tolerances: the ladder, from coarse to fine; in a study, the errors for which tables give times.
        limits: limits of each case.
        passes: number of passes over all problems, with one or two rounds of each point.
        seed: seed of the orders of problems and solvers in each pass, and of the choice of a sample of problems.
    """

    tolerances: Annotated[list[Tolerance], Meta(min_length=1)] = msgspec.field(default_factory=lambda: list(LADDER))
    limits: Limits = Limits()
    passes: Annotated[int, Meta(ge=1, le=MAX_PASSES)] = PASSES
    seed: Count = 0

    @classmethod
    def checked(
        cls,
        tolerances: Iterable[float] | None = None,
        limits: Limits | None = None,
        *,
        passes: int | None = None,
        seed: int = 0,
        thorough: bool = False,
    ) -> Self:
        """Return validated settings; a thorough run has more tolerances and passes by default.

        Raises:
            BenchError: if a tolerance, the number of passes or the seed is not a number or out of range.
        """
        default_ladder, default_passes = (THOROUGH_LADDER, THOROUGH_PASSES) if thorough else (LADDER, PASSES)
        given_ladder = tuple(tolerances or default_ladder)
        passes = default_passes if passes is None else passes
        for name, values in (("tolerances", given_ladder), ("passes", (passes,)), ("seed", (seed,))):
            for value in values:
                require_number(name, value, is_whole=name != "tolerances")
        ladder = sorted(set(map(float, given_ladder)), reverse=True)
        for tolerance in ladder:
            if not 0.0 < tolerance < 1.0:
                raise BenchError(f"`tolerances` must be between 0 and 1, got {tolerance:g}; choose one such as 1e-4.")
        if not 1 <= passes <= MAX_PASSES:
            raise BenchError(f"`passes` must be between 1 and {MAX_PASSES}, got {passes}.")
        if not 0 <= seed < 2**63:
            raise BenchError(f"`seed` must be at least 0 and less than 2**63, got {seed}.")
        return cls(tolerances=ladder, limits=limits or Limits(), passes=int(passes), seed=int(seed))


class MethodRecord(Record, frozen=True, kw_only=True):
    """A stepper with a solver.

    Attributes:
        name: name of the combination.
        values: the ladder: step sizes [s] or tolerances.
        tolerance: tolerance of the solver, unless ``values`` are its tolerances.
        max_iterations: limit of iterations of one solve.
        start: initial impulses of each solve, by name.
    """

    name: str
    values: Annotated[list[Tolerance], Meta(min_length=1)]
    tolerance: Tolerance
    max_iterations: Count
    start: str


class ReferenceRecord(Record, frozen=True, kw_only=True):
    """Final values of one member of the reference of a trajectory, by name; if it failed, the reason instead."""

    member: Number
    values: dict[str, Number]
    failure: str = ""


class TrajectoryRecord(Record, frozen=True, kw_only=True):
    """A problem for steppers with solvers.

    Attributes:
        name: the scene with its options.
        duration: simulated time [s].
        members: seeds of the scene if aggregates are compared, else factors on steps or tolerances.
        error: kind of the error that is measured.
        reference: method that simulates the reference, with one value; None if the end of the motion is known.
        known: the simulated part of the reference, or the known end.
        scale: scale by which differences from the known end are divided.
        displacement: largest change of a coordinate from the start at any time of the reference [m; 1 for
            quaternions], stored as "way"; None if unknown.

    Raises:
        ValueError: if members of the reference have values of different names.
    """

    name: str
    duration: Positive
    members: Annotated[list[Number], Meta(min_length=1)]
    error: Literal["limit cycle", "end position", "aggregates"]
    reference: MethodRecord | None = None
    known: list[ReferenceRecord] = []
    scale: Positive = 1.0
    displacement: Number | None = msgspec.field(default=None, name="way")

    def __post_init__(self) -> None:
        if len({tuple(sorted(member.values)) for member in self.known if not member.failure}) > 1:
            raise ValueError("the members of its reference have values of different names")


SHARD = "[1-9][0-9]{0,4}/[1-9][0-9]{0,4}"
"""Regular expression of a part of a divided run, such as ``"2/8"``."""


class PlanRecord(RunSettings, frozen=True, kw_only=True):
    """The plan of a run: problems, solvers and settings.

    Attributes:
        problems: names of problems.
        solvers: names of solvers, or of steppers with solvers.
        methods: the steppers with solvers; empty in a run over contact problems.
        trajectories: the problems of a run over trajectories.
        suite: name of the suite; empty if the problems were named.
        requested: the suite, or problems, files and folders, as given; empty if unknown, in a study, and in a run that
            is merged from different selections.
        sample: number of drawn problems; None if all were taken.
        sampling: how the sample was divided among families.
        families: family of each problem, by name.
        left_out: a sentence for each file of a folder that cannot be measured.
        available: number of problems of the suite, or of the given ones, before a sample or a shard is taken; None if
            unknown, as in older runs.
        shard: part of a divided run, such as "2/8"; empty for a whole run.
        missing_shards: the parts of a divided run that a merged run lacks, such as "2/8".

    Raises:
        ValueError: if the names of a run over trajectories differ from its trajectories or methods.
    """

    problems: list[str]
    solvers: list[str]
    methods: list[MethodRecord] = []
    trajectories: list[TrajectoryRecord] = []
    suite: str = ""
    requested: list[str] = []
    sample: Count | None = None
    sampling: Sampling = "proportional"
    families: dict[str, str] = {}
    left_out: list[str] = []
    available: Count | None = None
    shard: Annotated[str, Meta(pattern=f"^({SHARD})?$")] = ""
    missing_shards: list[Annotated[str, Meta(pattern=f"^{SHARD}$")]] = []

    def __post_init__(self) -> None:
        names = [trajectory.name for trajectory in self.trajectories], [method.name for method in self.methods]
        if any(names) and names != (self.problems, self.solvers):
            raise ValueError("its names differ from those of its trajectories and methods")

    @property
    def n_available(self) -> int | None:
        """Number of problems of which this run has all or a part; None if an older or merged run does not tell."""
        if self.available is not None:
            return self.available
        is_part = self.sample is not None or self.shard or self.missing_shards or (self.suite and not self.requested)
        return None if is_part else len(self.problems)

    def problems_in_words(self, count: int) -> str:
        """Return which problems a table of ``count`` problems is about, such as ``"2 of 9 problems of woodpecker"``."""
        of_suite = f" of {self.suite}" if self.suite else ""
        if self.n_available is None or count > self.n_available:
            return f"{counted(count, 'problem')}{of_suite}"
        numbers = f"{count} of {self.n_available}" if count < self.n_available else f"all {count}"
        return f"{numbers} {'problem' if self.n_available == 1 else 'problems'}{of_suite}"

    def ladder(self, solver: str) -> list[float]:
        """Return the ladder of one of ``solvers``."""
        return next((method.values for method in self.methods if method.name == solver), self.tolerances)

    def family(self, problem: str) -> str:
        """Return the family of one of ``problems``."""
        return self.families.get(problem) or family_of(problem)

    def trajectory(self, name: str) -> TrajectoryRecord:
        """Return one of the trajectories by its name."""
        return next(trajectory for trajectory in self.trajectories if trajectory.name == name)
