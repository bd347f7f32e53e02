"""The plan of a run: problems, solvers and settings, validated before the run starts."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Solver
from ...problems.exchange.catalog import SEQUENCES_SUITE
from ...problems.exchange.families import Sampling
from ...problems.representation import counted, html_table, names_or_number
from ..errors import BenchError
from ..plugins.descriptions import solver_spec
from ..plugins.solver_specs import SolverSpec, warm_variant
from ..store.plans import PlanRecord, RunSettings
from .selection import ProblemSource, problem_name, require_unique, select, select_shard
from .trajectories.methods import Method

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
"""Solver variants that are measured by default."""

SEQUENCE_SOLVERS = ("Robust", "SORprox", "NSGS", "InteriorPoint", "HybridNewton")
"""Solvers that are measured by default in the suite ``sequences``, with cold and with warm starts."""

Subject = TypeVar("Subject", SolverSpec, Method)
"""The subject of a measurement: a solver, or a stepper with a solver."""


@dataclass(frozen=True)
class Plan(Generic[Subject]):
    """A plan, with the problems and solvers that it names.

    Attributes:
        record: the stored plan.
        problems: the problems, or their names if they are loaded later; empty in a study.
        solvers: the solvers; in a study, the steppers with solvers.
    """

    record: PlanRecord
    problems: tuple[str | ContactProblem, ...]
    solvers: tuple[Subject, ...]

    def __repr__(self) -> str:
        record = self.record
        counts = counted(len(record.tolerances), "tolerance"), counted(record.passes, "pass", "passes")
        return f"<Plan: {'; '.join(self._names().values())}; {', '.join(counts)}>"

    def _repr_html_(self) -> str:
        record = self.record
        facts: dict[str, object] = dict(self._names())
        facts["tolerances"] = ", ".join(f"{tolerance:g}" for tolerance in record.tolerances)
        facts |= {"passes": record.passes, "limit of a solve [s]": record.limits.solve_seconds}
        return html_table("Plan of a run", facts)

    def _names(self) -> dict[str, str]:
        """Return the names of problems and solvers, or how many there are if there are many."""
        subject = "method" if self.record.methods else "solver"
        return {
            "problems": names_or_number(self.record.problems, "problem"),
            f"{subject}s": names_or_number(self.record.solvers, subject),
        }


def make_plan(
    problems: Sequence[ProblemSource] | None = None,
    solvers: Sequence[str | Solver] | None = None,
    settings: RunSettings | None = None,
    *,
    suite: str | Path = "quick",
    sample: int | None = None,
    sampling: Sampling = "proportional",
    shard: str = "",
) -> Plan[SolverSpec]:
    """Return the plan for the given problems (or a suite, or a sample) and solvers (or the default variants).

    Problems of plugins are built, and files are read, immediately (see ``select``); other problems are loaded later.

    Args:
        problems: names, files, folders or problem objects; the members of ``suite`` if None.
        solvers: names with options, or solver objects; ``DEFAULT_SOLVERS`` if None. In the suite ``sequences``, the
            default is ``SEQUENCE_SOLVERS``, and each solver is measured from zero and, as ``Warm(solver)``, from its
            answer to the previous step.
        settings: tolerances, limits, passes and seed.
        suite: name of a suite, or a folder.
        sample: number of problems to draw; all if None.
        sampling: how the sample is divided among families: "proportional" or "even".
        shard: "i/n" to measure every n-th problem from the i-th on; all problems if empty.

    Raises:
        ProblemError: for an unknown problem or suite (the message suggests the nearest name), a file or folder without
            a problem, or an empty sample.
        SolverError: for an unknown solver or option; the message suggests the nearest name.
        PluginError: if a plugin's solver does not implement the interface, or a plugin does not create its problem.
        BenchError: for an empty list of solvers, a name given twice, a problem that has the name of a library
            problem but different data, a solver object that does not implement the interface, or a shard out of range.
    """
    settings = settings or RunSettings()
    selection = select(problems, suite, sample, settings.seed, sampling)
    if not isinstance(shard, str) or shard:
        selection, shard = select_shard(selection, shard)
    is_sequence_suite = selection.suite == SEQUENCES_SUITE
    if solvers is not None and not solvers:
        raise BenchError("no solver is given; name at least one, or omit the solvers to measure the default ones.")
    specs = tuple(map(solver_spec, solvers or (SEQUENCE_SOLVERS if is_sequence_suite else DEFAULT_SOLVERS)))
    if is_sequence_suite:
        specs = tuple(dict.fromkeys(variant for spec in specs for variant in (spec, warm_variant(spec))))
    names = [spec.name for spec in specs]
    require_unique("solver", names)
    record = PlanRecord(
        problems=[problem_name(problem) for problem in selection.problems],
        solvers=names,
        tolerances=settings.tolerances,
        limits=settings.limits,
        passes=settings.passes,
        seed=settings.seed,
        suite=selection.suite,
        requested=[problem_name(source) for source in problems or [suite]],
        sample=None if sample is None else int(sample),
        sampling=sampling,
        families=dict(selection.families),
        left_out=list(selection.left_out),
        available=selection.available,
        shard=shard,
    )
    return Plan(record, selection.problems, specs)
