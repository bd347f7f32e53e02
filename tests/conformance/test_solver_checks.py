"""Each check detects the fault that it is meant for, and reports it in a sentence."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import faulty_solver
import numpy as np
import pytest
from faulty_solver import SIDE_EFFECTS, Faulty
from proxbench.bench.conformance import (
    PROBLEM_CHECKS,
    SOLVER_CHECKS,
    NotApplicable,
    Violation,
    hard_checks,
    invariance_checks,
)
from proxbench.bench.conformance.trial import require_known_answer
from proxbench.problems import Answer, ContactProblem

CHECKS = {check.name: check for check in SOLVER_CHECKS}
OF_PROBLEMS = {check.name: check for check in PROBLEM_CHECKS}


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    faulty_solver.memory.clear()
    yield
    faulty_solver.memory.clear()


@pytest.fixture
def _few_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reduce the iterations of each hard case: a check must notice a fault, not solve the other cases of its group."""
    monkeypatch.setattr(hard_checks, "HARD", replace(hard_checks.HARD, max_iterations=200))


@pytest.mark.parametrize(
    ("fault", "check", "words"),
    [
        ("no solve", "interface", "returned an int, which has no method solve(stop, start=None, observe=None)"),
        ("supports nothing", "useful", "declines all 25 small problems, the first because it is Monday"),
        ("supports True", "supports", "its supports returned True"),
        ("supports without words", "supports", "its supports returned ' '; return None"),
        ("supports at random", "supports", "supports is not deterministic on"),
        ("unsupported", "supports", "return a reason there"),
        ("None", "finite", "returned NoneType, not a Solution"),
        ("shape", "finite", "of shape"),
        ("count", "finite", "1.5 as its number of iterations"),
        ("nan", "finite", "not finite, with status diverged"),
        ("writes start", "inputs unchanged", "modified the initial impulses"),
        ("writes problem", "inputs unchanged", "modified the arrays of 8 frictionless contacts"),
        ("forgetful", "deterministic", "on the same prepared problem"),
        ("remembers", "first solve", "do not store answers between solves"),
        ("lies", "truthful", "to 0.0001, but its judged residual (coulomb) is"),
        ("gives up", "useful", "solves none of 25 problems to 0.001"),
        ("zero", "useful", "its best residual is 9.8e-03"),
        ("blind to infeasibility", "infeasible", "the status is iteration limit"),
        ("never zero", "at rest", "up to 1.0e-15 N s"),
        ("empty unsolved", "no contacts", "the status is stalled"),
        ("blind", "observed", "called its observer never"),
        ("coarse when observed", "observed", "differs from the unobserved one"),
        ("cold", "warm start", "begin from start"),
        ("no limit", "iteration limit", "but max_iterations was 1"),
        pytest.param("late", "time limit", "took 1.", marks=pytest.mark.slow),
        ("knows metres only", "units", "but in micrometres and milligrams its status is stalled"),
        ("infeasible in doubt", "hard stacks", "has a solution, but is reported as infeasible"),
        ("absolute", "hard stacks", "claims to have solved hard-stack-"),
        ("lies on hard-squeezed", "hard degenerate", "hard-squeezed has no solution, but is reported as solved"),
        ("nan", "hard rods", "not finite, with status diverged"),
        ("writes problem", "hard spheres", "modified the arrays of hard-incline"),
        ("never oscillates", "cycles", "alternate between two values, and it continues to the iteration limit"),
        ("returns the last", "tolerances", "a tolerance of 1e-08 gives a residual of"),
        ("remembers contacts in any order", "order", "it solves the original 8 frictionless contacts, but it"),
        ("remembers tangents of any direction", "tangents", "with rotated tangents to 1e-06, but its judged residual"),
        ("counts copies twice", "copies", "with contact 0 duplicated to 1e-06, but its judged residual"),
        ("lies on hard-identical-contacts", "hard supports", "claims to have solved hard-identical-contacts"),
        ("lies on hard-cradle-100", "hard stacks", "claims to have solved hard-cradle-100"),
        ("lies on hard-arch-30", "hard wedges", "claims to have solved hard-arch-30"),
        ("lies on hard-many-rods", "hard rods", "claims to have solved hard-many-rods"),
        ("lies on hard-scattered-3000", "hard spheres", "claims to have solved hard-scattered-3000"),
        ("lies on hard-grazing-10", "hard degenerate", "claims to have solved hard-grazing-10"),
        ("lies on hard-disconnected-parts", "hard mixed", "claims to have solved hard-disconnected-parts"),
        ("lies on hard-braced-mu10", "hard random", "claims to have solved hard-braced-mu10"),
        ("lies on hard-pendulum", "hard joints", "claims to have solved hard-pendulum"),
        ("lies on hard-slowing-sphere-stops", "hard rolling", "claims to have solved hard-slowing-sphere-stops"),
        ("list", "finite", "impulses of type list, not a plain numpy array"),
        ("masked", "finite", "impulses of type MaskedArray, not a plain numpy array"),
        ("negative count", "finite", "a number of iterations that is negative"),
        ("enormous count", "finite", "a number of iterations that is larger than 2**53"),
        ("no text", "finite", "a message of type int, not text"),
        ("prints", "silent", "'hello'"),
        ("prints below", "silent", "'hello from below'"),
        ("warns", "silent", "it issued the warning 'look here'; report it"),
    ],
)
@pytest.mark.usefixtures("_few_iterations")
def test_each_fault_is_detected_by_its_check(fault: str, check: str, words: str) -> None:
    with pytest.raises(Violation) as found:
        CHECKS[check].run(Faulty(fault))
    sentence = str(found.value)
    assert words in sentence
    assert sentence.endswith(".")
    assert "\n" not in sentence


FEW = ("counts copies twice", "moves")
"""Faults that run through all checks, even without the full profile."""


LONG = {check.name for check in (*hard_checks.HARD_CHECKS, *invariance_checks.INVARIANCE_CHECKS)}
"""Checks on many problems, which ``SORprox``, the solver of ``Faulty``, passes daily in ``test_built_in_solvers``."""


@pytest.mark.parametrize(
    "check",
    [
        pytest.param(check, marks=pytest.mark.slow if check.name in LONG else (), id=f"{check}")
        for check in SOLVER_CHECKS
    ],
)
@pytest.mark.usefixtures("_few_iterations")
def test_without_a_fault_every_check_is_passed(check: Any) -> None:
    check.run(Faulty(""))


@pytest.mark.parametrize("check", ["observed", "warm start"])
def test_checks_of_iterates_do_not_apply_to_solvers_without_iterates(check: str) -> None:
    with pytest.raises(NotApplicable, match="has_iterates is False"):
        CHECKS[check].run(Faulty("no iterates"))


ALONE = {
    "odd has_iterates": {"interface"},
    "stays at home": {"pickling"},
    **{effect: {"process"} for effect in SIDE_EFFECTS},
    "supports at random": {"supports"},
    "nan when cut short": {"finite"},
    "writes start": {"inputs unchanged", "warm start"},
    "counts on": {"deterministic"},
    "remembers": {"first solve"},
    "lies at 1e-4": {"truthful", "tolerances"},
    "never done": {"useful"},
    "blind to infeasibility": {"infeasible"},
    "never zero": {"at rest", "hard stacks", "hard degenerate"},
    "empty unsolved": {"no contacts"},
    "blind": {"observed"},
    "coarse when observed": {"observed"},
    "cold": {"warm start"},
    "no limit": {"iteration limit"},
    "late": {"time limit"},
    "prints": {"silent"},
    "prints below": {"silent"},
    "warns": {"silent"},
    "knows metres only": {"units"},
    "remembers contacts in any order": {"order", "copies"},
    "remembers tangents of any direction": {"tangents"},
    "counts copies twice": {"copies"},
    "returns the last": {"tolerances"},
    "never oscillates": {"cycles"},
    "absolute": {"hard stacks", "hard wedges", "hard degenerate"},
    "infeasible in doubt": {"hard stacks", "hard wedges"},
    "lies on hard-identical-contacts": {"hard supports"},
    "lies on hard-cradle-100": {"hard stacks"},
    "lies on hard-arch-30": {"hard wedges"},
    "lies on hard-many-rods": {"hard rods"},
    "lies on hard-scattered-3000": {"hard spheres"},
    "lies on hard-grazing-10": {"hard degenerate"},
    "lies on hard-disconnected-parts": {"hard mixed"},
    "lies on hard-braced-mu10": {"hard random"},
    "lies on hard-pendulum": {"hard joints"},
    "lies on hard-slowing-sphere-stops": {"hard rolling"},
}
"""Faults that few checks detect, with these checks."""


@pytest.mark.weekly
@pytest.mark.parametrize("fault", ALONE)
def test_each_fault_is_detected_only_by_the_listed_checks(fault: str) -> None:
    if fault not in FEW and os.environ.get("PROXBENCH_PROFILE") != "full":
        pytest.skip("takes seconds each; PROXBENCH_PROFILE=full runs it")
    assert set(in_a_process(lambda: "\n".join(broken_by(fault))).splitlines()) == ALONE[fault]


def test_every_check_has_a_fault_detected_by_few_checks() -> None:
    assert set().union(*ALONE.values()) == set(CHECKS)


def broken_by(fault: str) -> list[str]:
    """Run all checks on a fault; return the names of those that fail."""
    return [name for name, check in CHECKS.items() if breaks(check, fault)]


def breaks(check: Any, fault: str) -> bool:
    faulty_solver.memory.clear()
    try:
        check.run(Faulty(fault))
    except Violation:
        return True
    except NotApplicable:
        return False
    return False


def in_a_process(act: Callable[[], str]) -> str:
    """Return the result of ``act`` in a forked process, whose state it may change."""
    reading, writing = os.pipe()
    if os.fork() == 0:
        try:
            os.write(writing, act().encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        returned = pipe.read()
    os.wait()
    return returned


def the_violation(check: str, fault: str) -> str:
    try:
        CHECKS[check].run(Faulty(fault))
    except Violation as violation:
        return str(violation)
    return ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ("moves", "changed the working folder; restore"),
        ("raises errors of numpy", "changed numpy's error state"),
        ("draws from numpy", "changed numpy's global random state"),
        ("sets the environment", "changed the environment"),
        ("hears signals", "changed signal handlers"),
        ("starts a thread", "threads or processes running; end them"),
        ("starts a process", "processes running; end them"),
        ("replaces the judge", "replaced proxbench.bench.conformance.trial.judge; do not modify"),
        ("replaces the clock", "replaced time.perf_counter; do not modify"),
    ],
)
def test_process_check_names_the_change_made_by_a_solver(effect: str, words: str) -> None:
    assert words in in_a_process(lambda: the_violation("process", effect))


def test_a_missed_answer_is_reported() -> None:
    problem = ContactProblem.from_delassus(np.eye(1), (-1.0,), dim=1, name="a point")
    for wrong in (Answer(impulses=(np.full(1, 0.5),)), Answer(velocity=np.ones(1))):
        with pytest.raises(Violation, match=r"on a point its error against the known answer is 1\.0e\+00"):
            require_known_answer(replace(problem, answer=wrong), np.ones(1))
    require_known_answer(replace(problem, answer=Answer(impulses=(np.ones(1),), velocity=np.zeros(1))), np.ones(1))


def test_a_solver_that_cannot_be_pickled_is_reported() -> None:
    @dataclass(frozen=True)
    class Local(Faulty):
        pass

    with pytest.raises(Violation, match="cannot be pickled"):
        CHECKS["pickling"].run(Local(""))


def test_checks_of_problems_detect_violations() -> None:
    rng = np.random.default_rng(0)

    def made(answer: Answer | None = None, free_velocity: float = -1.0) -> ContactProblem:
        return ContactProblem.from_delassus(np.eye(1), (free_velocity,), dim=1, answer=answer)

    for check in PROBLEM_CHECKS:
        check.run(lambda: made(Answer(impulses=(np.ones(1),))))
    with pytest.raises(Violation, match="fixed random seed"):
        OF_PROBLEMS["deterministic"].run(lambda: made(free_velocity=-float(rng.random())))
    with pytest.raises(Violation, match="its judged residual is"):
        OF_PROBLEMS["answer"].run(lambda: made(Answer(impulses=(np.zeros(1),))))
    with pytest.raises(Violation, match="no contacts"):
        OF_PROBLEMS["made"].run(lambda: ContactProblem.from_delassus(np.zeros((0, 0)), (), dim=1))
