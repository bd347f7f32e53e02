"""Every cheat of the suite: what it does, on what, and what a run says of it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cheating_solvers as answers
import remembering_solvers as memory
import tampering_solvers as tampering
from proxbench.bench.measure.contacts.case import Case, CasePass
from proxbench.bench.measure.ladder import measure_ladder
from proxbench.bench.measure.measuring_core import MeasuringCore
from proxbench.bench.measure.refutation import find_refuted
from proxbench.bench.plugins.describing import solver_spec
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import PASSES, Limits
from proxbench.bench.store.records import CaseRecord
from proxbench.problems import load
from proxbench.problems.exchange.storage import problem_bytes

LADDER = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)

LIMITS = Limits(solve_seconds=30.0, case_seconds=120.0)

NOT_CAUGHT = "solved: not caught"


@dataclass(frozen=True)
class Cheat:
    """One trick.

    Attributes:
        does: what it does, as the table says it.
        verdict: how it ends, as the table says it: an outcome and, behind a colon, words of the reason.
        make: makes the solver, given a folder for its files.
        problem: what it is tried on.
        limits: of its case.
    """

    does: str
    verdict: str
    make: Callable[[Path], Any]
    problem: str = "funnel-100"
    limits: Limits = LIMITS

    def tried(self, folder: Path, ladder: tuple[float, ...] = LADDER) -> CaseRecord:
        """Measure it as a run does."""
        problem = load(self.problem)
        data, solver = problem_bytes(problem.anonymous()), solver_spec(self.make(folder))
        record: CaseRecord | None = None
        core = MeasuringCore.claim()
        for number in range(PASSES):
            case = Case(problem, solver, self.limits, ladder, data, record, CasePass(0, number))
            measure_ladder([case], core=core)
            record = case.record()
            if record.outcome is not Outcome.MEASURED:
                break
        core.release()
        return next(iter(find_refuted([record], case.is_solvable)), record)


def _of(solver: Callable[[], Any]) -> Callable[[Path], Any]:
    return lambda folder: solver()


REPEATS = "misbehaved: it repeats answers instead of solving"
FASTER = "solved: first solves take"
COPIES = "solved: copies of the problem"
CLOCK = "misbehaved: its own clock explains"
REPLACED = "misbehaved: it replaced"
THREADS = "misbehaved: thread running"
PROCESSES = "misbehaved: running"
BOX = "hard-sticking-box"
LARGE = "funnel-1000"

CHEATS = {
    "Remembering": Cheat("keeps answers by the digest of the problem", REPEATS, _of(memory.Remembering)),
    "Waiting": Cheat("keeps answers, and gives them after 0.37 of their time", REPEATS, _of(memory.Waiting), LARGE),
    "WaitingLonger": Cheat(
        "keeps answers, and gives them after 0.8 of their time", FASTER, lambda folder: memory.Waiting(0.8), LARGE
    ),
    "Carrying": Cheat(
        "needs longer than its limit, and gives the answer the next time",
        "misbehaved: reach the time limit",
        _of(memory.Carrying),
        "funnel-30",
        Limits(solve_seconds=0.3, case_seconds=120.0),
    ),
    "BySize": Cheat("keeps answers by the number of rows", "wrong: ", _of(memory.BySize)),
    "WhateverUnits": Cheat("keeps answers by c in whatever units", REPEATS, _of(memory.WhateverUnits)),
    "RemembersLaws": Cheat("keeps answers by id(laws)", "solved: gains nothing", _of(answers.RemembersLaws), BOX),
    "InPrepare": Cheat("solves in prepare, once a problem", REPEATS, _of(memory.InPrepare)),
    "InSupports": Cheat("solves in supports", REPEATS, _of(memory.InSupports)),
    "LongInSupports": Cheat(
        "solves in supports, to every tolerance", "misbehaved: its supports worked for", _of(memory.LongInSupports)
    ),
    "FromLibraryInWhateverUnits": Cheat(
        "solves the library when it is made, by c in whatever units",
        COPIES,
        _of(memory.FromLibraryInWhateverUnits),
    ),
    "OnDisk": Cheat("keeps answers in files from run to run", REPEATS, lambda folder: memory.OnDisk(str(folder))),
    "OnDiskInWhateverUnits": Cheat(
        "keeps answers in files, by c in whatever units",
        COPIES,
        lambda folder: memory.OnDiskInWhateverUnits(str(folder)),
    ),
    "WhateverOrder": Cheat(
        "knows a problem in whatever order, axes and units, and waits before it answers",
        COPIES,
        _of(memory.WhateverOrder),
    ),
    "WhateverNearby": Cheat(
        "gives the answer of a known problem to all that are like it",
        "wrong: on a copy",
        lambda folder: memory.WhateverOrder(0.5),
    ),
    "WarmStarting": Cheat("starts from its answer to the coarser tolerance", REPEATS, _of(memory.WarmStarting), LARGE),
    "WhenCollecting": Cheat(
        "solves in a callback of the garbage collector",
        "misbehaved: the settings of the garbage collector",
        _of(memory.WhenCollecting),
    ),
    "WhenReleased": Cheat("solves in __del__ of what it prepared", REPEATS, _of(memory.WhenReleased)),
    "WhenTimerRings": Cheat("solves in a signal handler", "misbehaved: signal handlers", _of(memory.WhenTimerRings)),
    "KnowsCopies": Cheat(
        "stalls where it finds itself in a forked process", "stalled: in a first solve", _of(memory.KnowsCopies)
    ),
    "Choosy": Cheat(
        "refuses all problems but those it knows",
        "unsupported: it is no benchmark",
        lambda folder: memory.Choosy([load("funnel-100").digest]),
    ),
    "AheadInBareThread": Cheat(
        "works on in a thread that threading does not list", THREADS, _of(tampering.AheadInBareThread)
    ),
    "Background": Cheat("starts a thread in supports", THREADS, _of(answers.Background), BOX),
    "Orphaning": Cheat("leaves a process behind that is no child of its own", PROCESSES, _of(tampering.Orphaning)),
    "OtherCores": Cheat(
        "leaves the core that it is pinned to", "misbehaved: it changed the cores", _of(tampering.OtherCores)
    ),
    "OtherCoresMeanwhile": Cheat(
        "works in two threads on two cores, and returns to one before a solve ends",
        "misbehaved: it changed the cores",
        _of(tampering.OtherCoresMeanwhile),
        LARGE,
    ),
    "SlowClock": Cheat(
        "replaces the clock by one ten times slower, and hides it", CLOCK, _of(tampering.SlowClock), LARGE
    ),
    "StoppedClock": Cheat(
        "replaces the clock by one that stands, and hides it",
        "timeout: the case took longer",
        _of(tampering.StoppedClock),
        limits=Limits(solve_seconds=1.0, case_seconds=5.0),
    ),
    "Accountant": Cheat(
        "replaces Measurement.round, divides the times, and hides it", CLOCK, _of(tampering.Accountant), LARGE
    ),
    "BeforeSolving": Cheat(
        "replaces Measurement._solve, solves before, and hides it", CLOCK, _of(tampering.BeforeSolving), LARGE
    ),
    "Postponing": Cheat(
        "replaces np.copyto, solves after the clock has stopped, and hides it",
        CLOCK,
        _of(tampering.Postponing),
        LARGE,
    ),
    "Slowing": Cheat("traces memory, which slows the harness", "misbehaved: memory tracing", _of(tampering.Slowing)),
    "Profiling": Cheat("sets an empty profile function", "misbehaved: the profile function", _of(tampering.Profiling)),
    "ReplacingSorted": Cheat("replaces sorted by a slow one", REPLACED, _of(tampering.ReplacingSorted)),
    "RareCollection": Cheat(
        "changes the thresholds of the garbage collector",
        "misbehaved: the settings of the garbage collector",
        _of(tampering.RareCollection),
    ),
    "Silent": Cheat(
        "ignores warnings and floating-point errors", "misbehaved: the warning filters", _of(tampering.Silent)
    ),
    "SilentErrors": Cheat(
        "ignores floating-point errors from its first solve on",
        "misbehaved: numpy's error state",
        _of(tampering.SilentErrors),
    ),
    "Preferred": Cheat(
        "gives its process priority over others", "misbehaved: the scheduling", _of(tampering.Preferred)
    ),
    "SometimesZero": Cheat("answers zero in three of ten solves", "wrong: ", _of(answers.SometimesZero), BOX),
    "Loose": Cheat("claims a thousandth of what it reached", "wrong: ", _of(answers.Loose)),
    "Jittering": Cheat(
        "changes the last bits from solve to solve", "solved: different answers", _of(answers.Jittering), BOX
    ),
    "Lazy": Cheat(
        "returns a solution that solves when it is read", "misbehaved: a subclass of Solution", _of(answers.Lazy), BOX
    ),
    "Disguised": Cheat(
        "returns impulses of a subclass of ndarray", "misbehaved: not a plain numpy array", _of(answers.Disguised), BOX
    ),
    "ChangesLater": Cheat(
        "changes impulses after it has returned", "solved: gains nothing", _of(answers.ChangesLater), BOX
    ),
    "Elsewhere": Cheat(
        "returns before the work is done, and waits in synchronise",
        "solved: gains nothing",
        _of(answers.Elsewhere),
        BOX,
    ),
    "Late": Cheat(
        "answers after the limit",
        "time limit: its limit is 0.02 s",
        _of(answers.Late),
        BOX,
        Limits(solve_seconds=0.02, case_seconds=120.0),
    ),
    "LateInPrepare": Cheat(
        "prepares beyond the limit",
        "time limit: preparing took longer than the time limit",
        _of(answers.LateInPrepare),
        BOX,
        Limits(solve_seconds=0.02, case_seconds=120.0),
    ),
    "Hopeless": Cheat("says that a problem has no solution", "wrong: one is known", _of(answers.Hopeless), BOX),
    "FewIterations": Cheat(
        "counts ten sweeps as one iteration", "solved: gains nothing", _of(answers.FewIterations), "funnel-30"
    ),
    "Reader": Cheat("reads the known answer or the name of the problem", "wrong: ", _of(answers.Reader), BOX),
}
"""All of them by name."""


def table() -> str:
    """Return the suite as a table of the documentation."""
    rows = [f"| {cheat.does} | {cheat.verdict.rstrip(': ')} |" for cheat in CHEATS.values()]
    return "\n".join(["| cheat | verdict |", "| --- | --- |", *rows])
