"""Each check notices the fault that it is there for, and tells it in a sentence."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from proxbench.bench.conformance import PROBLEM_CHECKS, SOLVER_CHECKS, NotApplicable, Violation
from proxbench.problems import Answer, ContactProblem, Model
from proxbench.solvers import Prepared, Solution, Status, Stop, create

CHECKS = {check.name: check for check in SOLVER_CHECKS}
OF_PROBLEMS = {check.name: check for check in PROBLEM_CHECKS}

MISNAMED = {
    ("blind to infeasibility", Status.INFEASIBLE): Status.ITERATION_LIMIT,
    ("infeasible in doubt", Status.STALLED): Status.INFEASIBLE,
    ("absolute", Status.STALLED): Status.SOLVED,
    ("never oscillates", Status.OSCILLATING): Status.ITERATION_LIMIT,
}
"""What a faulty solver says instead of what is true."""

SPOILED: dict[str, Callable[[Solution], Any]] = {
    "nan": lambda solution: replace(solution, impulses=np.full_like(solution.impulses, np.nan), status=Status.DIVERGED),
    "shape": lambda solution: replace(solution, impulses=np.zeros(len(solution.impulses) + 1)),
    "None": lambda solution: None,
    "count": lambda solution: replace(solution, iterations=1.5),
    "gives up": lambda solution: Solution(np.zeros_like(solution.impulses), Status.STALLED, 0),
    "zero": lambda solution: Solution(np.zeros_like(solution.impulses), Status.SOLVED, 0),
    "unsupported": lambda solution: replace(solution, status=Status.UNSUPPORTED),
}
"""What a faulty solver returns whatever it has found."""


@dataclass(frozen=True)
class Faulty:
    """Solves as SORprox does, but for one fault."""

    fault: str

    model: ClassVar[Model] = Model.COULOMB

    @property
    def name(self) -> str:
        return f"Faulty(fault={self.fault!r})"

    @property
    def has_iterates(self) -> bool:
        return self.fault != "no iterates"

    def supports(self, problem: ContactProblem) -> Any:
        if self.fault == "supports nothing":
            return "it is Monday"
        return True if self.fault == "supports True" else None

    def prepare(self, problem: ContactProblem) -> Any:
        if self.fault == "no solve":
            return 3
        return _Faulty(
            self.fault,
            problem,
            create("SORprox", relaxation=1.0 if self.fault == "never oscillates" else 0.5).prepare(problem),
        )


@dataclass
class _Faulty:
    fault: str
    problem: ContactProblem
    inner: Prepared
    solves: int = 0

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Any:
        self.solves += 1
        if self.fault == "cold":
            start = None
        if self.fault == "writes start" and start is not None:
            start[:1] = 7.0
        if self.fault == "no limit":
            stop = replace(stop, max_iterations=10**5)
        if self.fault == "late":
            time.sleep(1.3 if stop.max_seconds < 0.5 else 0.0)
        if self.fault == "prints":
            print("hello")
        if self.fault == "prints below":
            os.write(1, b"hello from below")
        if self.fault == "coarse when observed" and observe is not None:
            stop = replace(stop, tolerance=1e3 * stop.tolerance)
        solution = self.inner.solve(stop, start=start, observe=None if self.fault == "blind" else observe)
        return self.spoiled(solution, stop)

    def spoiled(self, solution: Solution, stop: Stop) -> Any:
        impulses = solution.impulses
        if self.fault == "writes problem":
            values = self.problem.free_velocity
            values.setflags(write=True)
            values[:1] += 1.0
        if self.fault in SPOILED:
            return SPOILED[self.fault](solution)
        if self.fault == "lies":
            return replace(solution, impulses=0.9 * impulses, status=Status.SOLVED)
        if (self.fault, solution.status) in MISNAMED:
            return replace(solution, status=MISNAMED[self.fault, solution.status])
        if self.fault == "never zero":
            return replace(solution, impulses=impulses + 1e-15)
        if self.fault == "forgetful":
            return replace(solution, impulses=impulses + 1e-9 * self.solves)
        if self.fault == "knows metres only" and np.abs(self.problem.free_velocity).max(initial=0.0) > 1e3:
            return replace(solution, status=Status.STALLED)
        if self.fault == "returns the last" and stop.tolerance < 1e-7:
            return replace(solution, impulses=0.5 * impulses, status=Status.ITERATION_LIMIT)
        if self.fault == "empty unsolved" and not len(impulses):
            return replace(solution, status=Status.STALLED)
        return solution


@pytest.mark.parametrize(
    ("fault", "check", "words"),
    [
        ("no solve", "interface", "returned an int, which has no method solve(stop, start=None, observe=None)"),
        ("supports nothing", "useful", "refuses all 20 small problems, the first because it is Monday"),
        ("supports True", "supports", "its supports returned True"),
        ("unsupported", "supports", "let supports say why"),
        ("None", "finite", "returned NoneType, not a Solution"),
        ("shape", "finite", "of shape"),
        ("count", "finite", "1.5 as its number of iterations"),
        ("nan", "finite", "not finite, with status diverged"),
        ("writes start", "inputs untouched", "changed the start"),
        ("writes problem", "inputs untouched", "changed the numbers of 8 frictionless contacts"),
        ("forgetful", "deterministic", "on the same prepared problem"),
        ("lies", "truthful", "to 0.0001, but the judge of its model (coulomb) reads"),
        ("gives up", "useful", "solves none of 20 problems to 0.001"),
        ("zero", "useful", "its best residual is 9.8e-03"),
        ("blind to infeasibility", "infeasible", "ends as iteration limit"),
        ("never zero", "at rest", "up to 1.0e-15 N s"),
        ("empty unsolved", "no contacts", "ends as stalled"),
        ("blind", "observed", "called its observer never"),
        ("coarse when observed", "observed", "otherwise than the unobserved one"),
        ("cold", "warm start", "begin from start"),
        ("no limit", "iteration limit", "where 1 were allowed"),
        ("late", "time limit", "took 1."),
        ("knows metres only", "units", "but in micrometres and milligrams it ends as stalled"),
        ("infeasible in doubt", "hard stacks", "has a solution, and ends as infeasible"),
        ("absolute", "hard stacks", "claims to have solved hard-stack-"),
        ("absolute", "hard degenerate", "hard-squeezed has no solution, and ends as solved"),
        ("nan", "hard rods", "not finite, with status diverged"),
        ("writes problem", "hard spheres", "changed the numbers of hard-incline"),
        ("never oscillates", "cycles", "in a cycle of two, and it ends at the iteration limit"),
        ("returns the last", "tolerances", "a tolerance of 1e-08 ends at a residual of"),
        ("prints", "silent", "'hello'"),
        ("prints below", "silent", "'hello from below'"),
    ],
)
def test_a_fault_is_noticed_by_its_check(fault: str, check: str, words: str) -> None:
    with pytest.raises(Violation) as told:
        CHECKS[check].run(Faulty(fault))
    sentence = str(told.value)
    assert words in sentence
    assert sentence.endswith(".")
    assert "\n" not in sentence


@pytest.mark.parametrize("check", SOLVER_CHECKS, ids=str)
def test_without_a_fault_every_check_is_passed(check: Any) -> None:
    check.run(Faulty(""))


@pytest.mark.parametrize("check", ["observed", "warm start"])
def test_a_solver_without_iterates_is_not_asked_for_them(check: str) -> None:
    with pytest.raises(NotApplicable, match="has_iterates is False"):
        CHECKS[check].run(Faulty("no iterates"))


def test_a_solver_that_cannot_be_sent_to_another_process_is_told() -> None:
    @dataclass(frozen=True)
    class Local(Faulty):
        pass

    with pytest.raises(Violation, match="cannot be pickled"):
        CHECKS["travels"].run(Local(""))


def test_problems_are_held_to_their_promises() -> None:
    rng = np.random.default_rng(0)

    def made(answer: Answer | None = None, free_velocity: float = -1.0) -> ContactProblem:
        return ContactProblem.from_delassus(np.eye(1), (free_velocity,), dim=1, answer=answer)

    for check in PROBLEM_CHECKS:
        check.run(lambda: made(Answer(impulses=(np.ones(1),))))
    with pytest.raises(Violation, match="fixed seed"):
        OF_PROBLEMS["deterministic"].run(lambda: made(free_velocity=-float(rng.random())))
    with pytest.raises(Violation, match="the judge reads"):
        OF_PROBLEMS["answer"].run(lambda: made(Answer(impulses=(np.zeros(1),))))
    with pytest.raises(Violation, match="no contacts"):
        OF_PROBLEMS["made"].run(lambda: ContactProblem.from_delassus(np.zeros((0, 0)), (), dim=1))
