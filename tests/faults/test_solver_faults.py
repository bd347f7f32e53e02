"""Whatever a solver does, the run ends, the results of other solvers do not change, and nothing is left behind."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import pytest
from proxbench.bench.store.records import CaseRecord
from proxbench.bench.store.store import Store
from sandbox import Sandbox, Verdicts, verdicts

MEASURED, CRASHED, MISBEHAVED, TIMEOUT = "measured", "crashed", "misbehaved", "timeout"

ACTIONS = {
    "raise": (CRASHED, "RuntimeError: the plugin gave up"),
    "raise badly": (CRASHED, "UnprintableError"),
    "refuse badly": (CRASHED, "for no reason"),
    "raise anything": (CRASHED, "NoOrdinaryError: beyond every except clause"),
    "interrupt": (CRASHED, "KeyboardInterrupt"),
    "leave": (CRASHED, "SystemExit: enough"),
    "recur": (CRASHED, "RecursionError"),
    "none": (MISBEHAVED, "NoneType"),
    "shape": (MISBEHAVED, "shape (1,)"),
    "type": (MISBEHAVED, "of type <U7"),
    "status": (MISBEHAVED, "'perfect'"),
    "nan": (MISBEHAVED, "not finite"),
    "lie": (MEASURED, "wrong"),
    "mask": (MISBEHAVED, "type MaskedArray"),
    "count down": (MISBEHAVED, "iterations that is negative"),
    "count on": (MISBEHAVED, "iterations that is larger"),
    "refuse without words": (MISBEHAVED, "its supports returned ' '"),
    "refuse at length": ("unsupported", "never never"),
    "whisper": (MEASURED, ""),
    "explain": (MEASURED, ""),
    "talk": (MEASURED, ""),
    "exit": (CRASHED, "exit code 7"),
    "segfault": (CRASHED, "SIGSEGV"),
    "abort": (CRASHED, "SIGABRT"),
    "set an alarm": (CRASHED, "SIGALRM"),
    "hang up": (CRASHED, "closed its connection"),
    "leave slowly": (MISBEHAVED, "thread running"),
    "allocate": ("out of memory", "256 MiB"),
    "write": (MISBEHAVED, "changed the numbers"),
    "print": (CRASHED, "after much noise"),
    "print gigabytes": (MEASURED, ""),
    "patch": (MISBEHAVED, "it replaced "),
    "move": (MEASURED, ""),
    "unsettle": (MISBEHAVED, "it changed "),
    "close": (CRASHED, "exit code 1"),
    "litter": (MEASURED, ""),
    "start threads": (MISBEHAVED, "threads running"),
    "start processes": (MISBEHAVED, "processes running"),
    "return twice": (MEASURED, ""),
    "run away": (MISBEHAVED, "running"),
    "kill its supervisor": (CRASHED, "together with its supervisor"),
    "stop its supervisor": (TIMEOUT, "8 s"),
    "forge": (MISBEHAVED, "an invalid answer"),
}
"""The outcome of each action, and words of the reason of a failed case, or the outcome of a measured point."""

LATE_ACTIONS = {name: (TIMEOUT, "2 s") for name in ("stop itself", "sleep", "spin")}
"""Actions that last as long as the time limit; they have their own run, with a short limit."""

FEW = ("lie", "segfault", "patch", "move", "spin")
"""Actions that slow tests run: a claim, a crash, two side effects and a time limit. The other actions are weekly."""

GROUPS = {"few": FEW, "others": tuple(name for name in ACTIONS | LATE_ACTIONS if name not in FEW)}

groups = pytest.mark.parametrize("group", ["few", pytest.param("others", marks=pytest.mark.weekly)])
actions = pytest.mark.parametrize(
    "action", [*FEW, *(pytest.param(name, marks=pytest.mark.weekly) for name in GROUPS["others"])]
)


def group_of(action: str) -> str:
    return "few" if action in FEW else "others"


RUNS = """
def run_actions(run_id, actions):
    run(
        ["funnel-30", "hard-sticking-box"],
        [
            "SORprox",
            *(Misbehaving(action, only="funnel-30") for action in actions),
            "ClarabelSOCP",
        ],
        tolerances=[1e-1, 1e-3],
        passes=1,
        limits=Limits(solve_seconds=8.0, case_seconds=8.0, memory_bytes=2**28),
        run_id=run_id,
    )

run_actions("quiet", [])
run_actions("disturbed", {actions!r})
run(
    ["funnel-30"],
    [Misbehaving(action) for action in {late_actions!r}],
    tolerances=[1e-1],
    passes=1,
    limits=Limits(solve_seconds=2.0, case_seconds=2.0),
    run_id="late",
)
"""


@dataclass
class Disturbance:
    """An undisturbed run, the same run disturbed by all actions, and what the latter left behind."""

    quiet: Verdicts
    disturbed: Verdicts
    cases: dict[str, CaseRecord]
    left_behind: list[str]


Disturb = Callable[[str], Disturbance]


@pytest.fixture(scope="module")
def disturb(tmp_path_factory: pytest.TempPathFactory) -> Disturb:
    """Return a function that runs the actions of a group, once."""

    @cache
    def run(group: str) -> Disturbance:
        sandbox = Sandbox(tmp_path_factory.mktemp("disturbed"))
        early, late = ([name for name in GROUPS[group] if name in kind] for kind in (ACTIONS, LATE_ACTIONS))
        done = sandbox.run(RUNS.format(actions=early, late_actions=late))
        assert (done.returncode, done.stdout) == (0, ""), done.stderr
        quiet, disturbed, last = (sandbox.results / name for name in ("quiet", "disturbed", "late"))
        cases = [case for folder in (disturbed, last) for case in Store.open(folder).read_cases()[0]]
        on_funnel = {case.solver: case for case in cases if case.problem == "funnel-30"}
        return Disturbance(verdicts(quiet), verdicts(disturbed), on_funnel, sandbox.left_behind())

    return run


@groups
def test_other_cases_are_complete_and_judged_as_usual(disturb: Disturb, group: str) -> None:
    disturbance, early = disturb(group), [name for name in GROUPS[group] if name in ACTIONS]
    culprits = [f"Misbehaving({action})" for action in early]
    assert len(disturbance.quiet) == 4
    others = {key: verdict for key, verdict in disturbance.disturbed.items() if key[1] not in culprits}
    assert others == disturbance.quiet
    assert len(disturbance.disturbed) == 4 + 2 * len(early)


@groups
def test_no_process_and_no_temporary_file_is_left(disturb: Disturb, group: str) -> None:
    assert disturb(group).left_behind == []


@actions
def test_record_of_a_misbehaving_solver_names_its_fault(disturb: Disturb, action: str) -> None:
    cases, (outcome, words) = disturb(group_of(action)).cases, (ACTIONS | LATE_ACTIONS)[action]
    case = cases[f"Misbehaving({action})"]
    assert case.outcome == outcome, case.reason + case.traceback + case.stderr
    assert len(case.reason) <= 2000
    if outcome == MEASURED:
        assert [point.outcome for point in case.points][-1:] == [words or "solved"]
    else:
        assert words in case.reason


@pytest.mark.parametrize("action", ["move", pytest.param("print gigabytes", marks=pytest.mark.weekly)])
def test_harmless_side_effects_do_not_change_results(disturb: Disturb, action: str) -> None:
    disturbed = disturb(group_of(action)).disturbed
    assert disturbed["funnel-30", f"Misbehaving({action})"][-1] == disturbed["funnel-30", "SORprox"][-1]
