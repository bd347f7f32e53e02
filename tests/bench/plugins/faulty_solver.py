"""A solver with one fault, chosen by name, for tests of the checks."""

import os
import random
import signal
import subprocess
import threading
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from proxbench.problems import ContactProblem, Model, judge
from proxbench.problems.contact.laws import LawKind
from proxbench.solvers import Prepared, Solution, Status, Stop, create

MISNAMED = {
    ("blind to infeasibility", Status.INFEASIBLE): Status.ITERATION_LIMIT,
    ("infeasible in doubt", Status.ITERATION_LIMIT): Status.INFEASIBLE,
    ("absolute", Status.ITERATION_LIMIT): Status.SOLVED,
    ("never oscillates", Status.OSCILLATING): Status.ITERATION_LIMIT,
}
"""False statements of a faulty solver."""

SPOILED: dict[str, Callable[[Solution], Any]] = {
    "lies": lambda solution: _false(solution),
    "never zero": lambda solution: replace(solution, impulses=solution.impulses + 1e-15),
    "nan": lambda solution: replace(solution, impulses=np.full_like(solution.impulses, np.nan), status=Status.DIVERGED),
    "shape": lambda solution: replace(solution, impulses=np.zeros(len(solution.impulses) + 1)),
    "None": lambda solution: None,
    "count": lambda solution: replace(solution, iterations=1.5),
    "negative count": lambda solution: replace(solution, iterations=-5),
    "enormous count": lambda solution: replace(solution, iterations=10**5000),
    "list": lambda solution: replace(solution, impulses=list(solution.impulses)),
    "masked": lambda solution: replace(solution, impulses=np.ma.masked_array(solution.impulses, mask=True)),
    "no text": lambda solution: replace(solution, message=3),
    "gives up": lambda solution: Solution(np.zeros_like(solution.impulses), Status.STALLED, 0),
    "zero": lambda solution: Solution(np.zeros_like(solution.impulses), Status.SOLVED, 0),
    "unsupported": lambda solution: replace(solution, status=Status.UNSUPPORTED),
}
"""Values that a faulty solver returns in place of its result."""


def in_any_order(problem: ContactProblem) -> str:
    """Return a text that does not depend on the order of contacts."""
    return f"{np.sort(problem.free_velocity).tolist()} {sizes(problem)}"


def in_any_direction(problem: ContactProblem) -> str:
    """Return a text that does not depend on the directions of tangents."""
    known = problem.free_velocity.copy()
    fixed = np.ones(problem.n_rows, dtype=bool)
    for row in problem.laws.first_row[problem.laws.kind == LawKind.SPATIAL_FRICTION]:
        known[row : row + 2] = np.hypot(*known[row : row + 2]), 0.0
        fixed[row : row + 2] = False
    delassus = problem.delassus().toarray()[np.ix_(fixed, fixed)]
    return f"{np.round(known, 9).tolist()} {np.round(delassus, 9).tolist()} {sizes(problem)}"


def sizes(problem: ContactProblem) -> str:
    """Return numbers of G and of the laws that do not depend on the order or the tangents of contacts."""
    delassus = problem.delassus().toarray()
    friction = problem.laws.friction_coefficient.sum(), problem.laws.fixed_bound.sum()
    return (
        f"{problem.factors is None} {problem.n_rows} {np.linalg.norm(delassus):.6g} {delassus.trace():.6g} {friction}"
    )


REMEMBERED: dict[str, Callable[[ContactProblem], str]] = {
    "remembers": lambda problem: problem.digest,
    "remembers contacts in any order": in_any_order,
    "remembers tangents of any direction": in_any_direction,
}
"""How a faulty solver recognises a problem, for which it returns its first solution again."""

SLOWLY = ("remembers contacts in any order", "remembers tangents of any direction")
"""Faults that take as long as a solve, so that the answers reveal them, but not the times."""

started: list[object] = []
"""Started processes; Python warns if a running one is garbage-collected."""

memory: dict[tuple[str, str, Stop], Solution] = {}


@dataclass(frozen=True)
class Faulty:
    """Solves as SORprox does, except for one fault."""

    fault: str

    model: ClassVar[Model] = Model.COULOMB

    @property
    def name(self) -> str:
        return f"Faulty(fault={self.fault!r})"

    @property
    def has_iterates(self) -> bool:
        return "perhaps" if self.fault == "odd has_iterates" else self.fault != "no iterates"  # type: ignore[return-value]

    def __getstate__(self) -> dict[str, Any]:
        if self.fault == "stays at home":
            raise TypeError("it holds a connection")
        return dict(vars(self))

    def supports(self, problem: ContactProblem) -> Any:
        if self.fault == "supports nothing":
            return "it is Monday"
        if self.fault == "supports at random":
            return "not now" if random.random() < 0.5 else None
        return {"supports True": True, "supports without words": " "}.get(self.fault)

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
        if self.fault in REMEMBERED and start is None and observe is None:
            key = self.fault, REMEMBERED[self.fault](self.problem), stop
            if self.fault in SLOWLY or key not in memory:
                memory.setdefault(key, self.inner.solve(stop))
            return memory[key]
        if self.fault in SIDE_EFFECTS:
            SIDE_EFFECTS[self.fault]()
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
        if self.fault == "warns":
            warnings.warn("look here", stacklevel=1)
        if self.fault == "prints below":
            os.write(1, b"hello from below")
        if self.fault == "coarse when observed" and observe is not None:
            stop = replace(stop, tolerance=1e3 * stop.tolerance)
        solution = self.inner.solve(stop, start=start, observe=None if self.fault == "blind" else observe)
        return self.spoiled(solution, stop)

    def spoiled(self, solution: Solution, stop: Stop) -> Any:
        if (self.fault, solution.status) in MISNAMED:
            return replace(solution, status=MISNAMED[self.fault, solution.status])
        if self.fault == f"lies on {self.problem.name}":
            return _false(solution)
        if self.fault in SPOILED:
            return SPOILED[self.fault](solution)
        return MISTAKES[self.fault](self, solution, stop) if self.fault in MISTAKES else solution


def the_only_copy(problem: ContactProblem) -> Any:
    """Return the rows of the contact that the last contact duplicates; None if it duplicates none or several."""
    if not problem.n_contacts or problem.n_rows % problem.n_contacts:
        return None
    contacts = np.arange(problem.n_rows).reshape(problem.n_contacts, -1)
    columns = np.vstack([problem.delassus().toarray(), problem.free_velocity])
    alike = [rows for rows in contacts[:-1] if np.array_equal(columns[:, rows], columns[:, contacts[-1]])]
    return alike[0] if len(alike) == 1 else None


def _false(solution: Solution) -> Solution:
    return replace(solution, impulses=0.9 * solution.impulses, status=Status.SOLVED)


def _writes_problem(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    values = solver.problem.free_velocity
    values.setflags(write=True)
    values[:1] += 1.0
    return solution


def _forgetful(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    return replace(solution, impulses=solution.impulses + 1e-9 * solver.solves)


def _counts_on(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    return replace(solution, iterations=solution.iterations + solver.solves - 1)


def _lies_at_1e_4(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    return _false(solution) if stop.tolerance == 1e-4 else solution


def _nan_when_cut_short(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    cut = stop.max_iterations == 3
    return replace(solution, impulses=np.full_like(solution.impulses, np.nan)) if cut else solution


def _never_done(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    return replace(solution, status=Status.STALLED) if np.any(solution.impulses) else solution


def _knows_metres_only(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    is_fast = np.abs(solver.problem.free_velocity).max(initial=0.0) > 1e3
    return replace(solution, status=Status.STALLED) if is_fast else solution


def _returns_the_last(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    last = replace(solution, impulses=0.5 * solution.impulses, status=Status.ITERATION_LIMIT)
    return last if stop.tolerance < 1e-7 else solution


def _empty_unsolved(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    return solution if len(solution.impulses) else replace(solution, status=Status.STALLED)


def _counts_copies_twice(solver: _Faulty, solution: Solution, stop: Stop) -> Solution:
    rows = the_only_copy(solver.problem)
    if rows is None:
        return solution
    doubled = solution.impulses.copy()
    doubled[rows] = doubled[-len(rows) :] = doubled[rows] + doubled[-len(rows) :]
    return replace(solution, impulses=doubled)


MISTAKES: dict[str, Callable[[_Faulty, Solution, Stop], Solution]] = {
    "writes problem": _writes_problem,
    "forgetful": _forgetful,
    "counts on": _counts_on,
    "lies at 1e-4": _lies_at_1e_4,
    "nan when cut short": _nan_when_cut_short,
    "never done": _never_done,
    "knows metres only": _knows_metres_only,
    "returns the last": _returns_the_last,
    "empty unsolved": _empty_unsolved,
    "counts copies twice": _counts_copies_twice,
}
"""How a faulty solver changes its solution in some cases."""


def _replace_the_judge() -> None:
    import proxbench.bench.conformance.trial as trial

    trial.judge = lambda *arguments, **options: judge(*arguments, **options)


SIDE_EFFECTS: dict[str, Callable[[], Any]] = {
    "moves": lambda: os.chdir("/"),
    "raises errors of numpy": lambda: np.seterr(all="raise"),
    "draws from numpy": np.random.random,
    "sets the environment": lambda: os.environ.update(OMP_NUM_THREADS="8"),
    "hears signals": lambda: signal.signal(signal.SIGUSR1, signal.SIG_IGN),
    "starts a thread": lambda: threading.Thread(target=time.sleep, args=(5.0,), daemon=True).start(),
    "starts a process": lambda: started.append(subprocess.Popen(["sleep", "5"])),
    "replaces the judge": _replace_the_judge,
    "replaces the clock": lambda: setattr(time, "perf_counter", lambda: 0.0),
}
"""Changes that a faulty solver makes to its process."""
