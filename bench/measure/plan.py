"""What a run measures: problems, solvers, the ladder of tolerances, and limits, all checked before anything starts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Solver
from ..errors import BenchError
from ..plugins.contestants import Contestant
from ..plugins.describing import contestant
from ..store.records import MOST_PASSES, Limits
from ..store.trajectory_records import TrajectoryRecord
from .selection import Given, name_of, place_of, select, shard_of
from .trajectories.methods import Method

__all__ = ["DEFAULT_SOLVERS", "LADDER", "Limits", "Plan", "make_plan", "name_of"]

PASSES, THOROUGH_PASSES = 2, 5
"""Passes of a run that names no number, and of a thorough one: with one alone, ratios of times have no intervals."""

LADDER = (1e-2, 1e-4, 1e-6, 1e-8)
"""Tolerances of a run that names none: those that tables give the time to."""

THOROUGH_LADDER = tuple(10.0**-k for k in range(1, 11))
"""Those of a thorough run, 1e-1 … 1e-10: more points of each curve."""


DEFAULT_SOLVERS = (
    "Robust",
    "Jprox",
    "JORprox(relaxation=0.5)",
    "SORprox",
    "SORprox(relaxation=1.5)",
    "SORprox(step_size='row_sum')",
    "SORprox(relaxation=1.5, form='factors')",
    "SafeguardedSORprox",
    "NSGS",
    "ClarabelSOCP",
    "Refined(ClarabelCoulomb)",
    "Lemke",
    "PyramidPGS(sides=4)",
    "PyramidPGS(sides=8)",
    "PyramidPGS(sides=16)",
)
"""Solver variants of a run that names none."""


@dataclass(frozen=True)
class Plan:
    """A run as it will be carried out.

    Attributes:
        problems: names of problems, or problems.
        solvers: solvers, each with a name of its own.
        tolerances: the ladder, from coarse to fine.
        limits: the limits of each case.
        methods: in a study, the steppers with solvers in place of ``solvers``.
        trajectories: in a study, its problems.
        passes: passes over all problems, with one or two rounds of each point.
        seed: of the orders of problems and solvers in each pass, and of a sample.
        suite: name of the suite that the problems are; empty where they were named.
        families: the family of each problem, by its name.
        left_out: a sentence for each file of a folder that cannot be measured.
        shard: which part of the problems of a divided run these are, "2/8"; empty if all.
    """

    problems: tuple[str | ContactProblem, ...]
    solvers: tuple[Contestant, ...]
    tolerances: tuple[float, ...]
    limits: Limits

    methods: tuple[Method, ...] = ()
    trajectories: tuple[TrajectoryRecord, ...] = ()
    passes: int = PASSES
    seed: int = 0
    suite: str = ""
    families: Mapping[str, str] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    shard: str = ""


def make_plan(
    problems: Sequence[Given] | None = None,
    solvers: Sequence[str | Solver] | None = None,
    suite: str | Path = "quick",
    tolerances: Sequence[float] | None = None,
    limits: Limits | None = None,
    passes: int | None = None,
    seed: int = 0,
    sample: int | None = None,
    thorough: bool = False,
    shard: str = "",
) -> Plan:
    """Return the plan for the given problems (or a suite, or a sample) and solvers (or the default variants).

    Problems of plugins are built here and those of files are read, see ``select``; the others are loaded when their
    turn comes. A thorough plan has more tolerances and passes where none are given.

    Raises:
        ProblemError: for an unknown problem or suite, with the nearest name, a file or folder without any, or an empty
            sample.
        SolverError: for an unknown solver or option, with the nearest name.
        PluginError: if a plugin's solver breaks the contract, or a plugin does not make the problem it offers.
        BenchError: for a name given twice, a problem with the name of one of the library and other numbers, a solver
            object that breaks the contract, or a tolerance, a number of passes, a seed or a shard out of range.
    """
    chosen = select(problems, suite, sample, seed)
    if shard:
        chosen, shard = shard_of(chosen, shard), "{}/{}".format(*place_of(shard))
    methods = tuple(map(contestant, solvers or DEFAULT_SOLVERS))
    names = [method.name for method in methods]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise BenchError(f"the solver {twice!r} is given more than once; name it once.")
    default_ladder, default_passes = (THOROUGH_LADDER, THOROUGH_PASSES) if thorough else (LADDER, PASSES)
    ladder = tuple(sorted(set(tolerances), reverse=True)) if tolerances else default_ladder
    passes = default_passes if passes is None else passes
    for tolerance in ladder:
        if not 0.0 < tolerance < 1.0:
            raise BenchError(f"tolerance {tolerance} must be between 0 and 1.")
    if not 1 <= passes <= MOST_PASSES:
        raise BenchError(f"`passes` must be between 1 and {MOST_PASSES}, got {passes}.")
    if not 0 <= seed < 2**63:
        raise BenchError(f"`seed` must not be negative, got {seed}.")
    return Plan(
        chosen.problems,
        methods,
        ladder,
        limits or Limits(),
        passes=passes,
        seed=seed,
        suite=chosen.suite,
        families=chosen.families,
        left_out=chosen.left_out,
        shard=shard,
    )
