"""The cheats of decision 14: its table is the catalogue, and names classes or entries of these modules."""

import re
from collections.abc import Iterable
from pathlib import Path

import cheating_solvers
import remembering_solvers
import tampering_solvers
from cheating_solvers import ANSWERS, Answering, Honest
from proxbench.bench.measure.contacts.case import Case
from proxbench.bench.measure.ladder import CasePass, measure_ladder
from proxbench.bench.measure.measuring_core import MeasuringCore
from proxbench.bench.measure.refutation import mark_refuted_claims
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import PASSES
from proxbench.bench.store.records import CaseRecord
from proxbench.problems import load
from proxbench.problems.exchange.files.problem_file import problem_bytes
from tampering_solvers import CHANGES, Changing

DECISION = Path(__file__).parents[3] / "docs" / "decisions" / "0014-nothing-spoils-a-run.md"

ROW = re.compile(r"^\| `(\w+)` \|.*\| ([^|]+) \|$", re.MULTILINE)
"""A row of the table: the name of a cheat, its action, its gain, and its verdict."""

VERDICTS = dict(ROW.findall(DECISION.read_text(encoding="utf-8")))
"""The ending of each cheat: an outcome and, after a colon, words of the reason or of a note."""

LADDER = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def make_cheat(name: str, folder: Path) -> Honest:
    """Return a cheat by its name, with a folder for its files."""
    if name in ANSWERS:
        return Answering(name)
    if name in CHANGES:
        return Changing(name)
    modules = (cheating_solvers, remembering_solvers, tampering_solvers)
    kind: type[Honest] = next(found for module in modules if (found := getattr(module, name, None)) is not None)
    return kind.made(str(folder))


def measured(solver: Honest, problem_name: str = "", ladder: Iterable[float] = LADDER) -> CaseRecord:
    """Measure a solver on its own problem or on another one, as a run does."""
    problem, spec = load(problem_name or solver.tried_on), solver_spec(solver)
    data, core = problem_bytes(problem.anonymous()), MeasuringCore.claim()
    record: CaseRecord | None = None
    for number in range(PASSES):
        case = Case(
            problem, spec, solver.limits, tuple(ladder), problem_data=data, stored=record, case_pass=CasePass(0, number)
        )
        measure_ladder([case], core=core)
        record = case.record()
        if record.outcome is not Outcome.MEASURED:
            break
    core.release()
    return next(iter(mark_refuted_claims([record], case.is_solvable)), record)
