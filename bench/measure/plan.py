"""What a run measures: problems, solvers, the ladder of tolerances, and limits, all checked before anything starts."""

from collections.abc import Sequence
from dataclasses import dataclass

from ...problems.catalog.catalog import is_available, load, plugin_problems, problem_names, suite_members
from ...problems.contact.problem import ContactProblem
from ...problems.errors import ProblemError, suggestion
from ...solvers.interface import Solver
from ..errors import BenchError
from .contestants import Contestant
from .describing import contestant, plugin_problem

LADDER = tuple(10.0**-k for k in range(1, 11))
"""Tolerances of the ladder, 1e-1 … 1e-10."""

DEFAULT_SOLVERS = (
    "Jprox",
    "JORprox(relaxation=0.5)",
    "SORprox",
    "SORprox(relaxation=1.5)",
    "SORprox(step_size='row_sum')",
    "SORprox(relaxation=1.5, form='factors')",
    "SafeguardedSORprox",
    "NSGS",
    "ClarabelSOCP",
    "ClarabelCoulomb",
    "Lemke",
    "PyramidPGS(sides=4)",
    "PyramidPGS(sides=8)",
    "PyramidPGS(sides=16)",
)
"""Solver variants of a run that names none."""


@dataclass(frozen=True)
class Limits:
    """Limits of one case.

    Attributes:
        solve_seconds: limit of one solve [s].
        case_seconds: limit of everything in a case [s].
        memory_bytes: memory that a case may take beyond what the framework itself needs.
        max_iterations: limit of iterations of one solve.

    Raises:
        BenchError: if a limit is not positive.
    """

    solve_seconds: float = 0.5
    case_seconds: float = 60.0
    memory_bytes: int = 2 * 2**30
    max_iterations: int = 100_000

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0:
                raise BenchError(f"{name} must be positive, got {value}.")


@dataclass(frozen=True)
class Plan:
    """A run as it will be carried out.

    Attributes:
        problems: names of problems, or problems.
        solvers: solvers, each with a name of its own.
        tolerances: the ladder, from coarse to fine.
        limits: the limits of each case.
    """

    problems: tuple[str | ContactProblem, ...]
    solvers: tuple[Contestant, ...]
    tolerances: tuple[float, ...] = LADDER
    limits: Limits = Limits()

    @property
    def n_cases(self) -> int:
        """Number of cases."""
        return len(self.problems) * len(self.solvers)

    @property
    def missing(self) -> list[str]:
        """Names of problems that have to be generated first."""
        return [name for name in self.problems if isinstance(name, str) and not is_available(name)]


def make_plan(
    problems: Sequence[str | ContactProblem] | None = None,
    solvers: Sequence[str | Solver] | None = None,
    suite: str = "quick",
    tolerances: Sequence[float] | None = None,
    limits: Limits | None = None,
) -> Plan:
    """Return the plan for the given problems (or a suite) and solvers (or the default variants).

    Problems of plugins are built here; the others are loaded when their turn comes.

    Raises:
        ProblemError: for an unknown problem or suite, with the nearest name.
        SolverError: for an unknown solver or option, with the nearest name.
        PluginError: if a plugin's solver breaks the contract, or a plugin does not make the problem it offers.
        BenchError: for a name given twice, a solver object that breaks the contract, or a tolerance that is not between
            0 and 1.
    """
    chosen = tuple(problems) if problems else tuple(suite_members(suite))
    known = problem_names()
    for problem in chosen:
        if isinstance(problem, str) and problem not in known:
            raise ProblemError(f"there is no problem {problem!r}{suggestion(problem, known)}")
    from_plugins = {offer.name for offer in plugin_problems()}
    chosen = tuple(resolved(p) if isinstance(p, str) and p in from_plugins else p for p in chosen)
    methods = tuple(map(contestant, solvers or DEFAULT_SOLVERS))
    for kind, names in (("problem", [name_of(p) for p in chosen]), ("solver", [s.name for s in methods])):
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise BenchError(f"the {kind} {twice!r} is given more than once; name it once.")
    ladder = tuple(sorted(set(tolerances), reverse=True)) if tolerances else LADDER
    for tolerance in ladder:
        if not 0.0 < tolerance < 1.0:
            raise BenchError(f"tolerance {tolerance} must be between 0 and 1.")
    return Plan(chosen, methods, ladder, limits or Limits())


def name_of(problem: str | ContactProblem) -> str:
    """Return the name of a problem."""
    return problem if isinstance(problem, str) else problem.name


def resolved(problem: str | ContactProblem) -> ContactProblem:
    """Return the problem itself, loaded if it is given by name."""
    if not isinstance(problem, str):
        return problem
    return plugin_problem(problem) if problem in {offer.name for offer in plugin_problems()} else load(problem)
