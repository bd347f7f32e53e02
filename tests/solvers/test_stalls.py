"""Stalled solves are repeated with ten times the iterations: from their impulses, and without the rules for stalls.

A stall is false if one of them halves the judged residual; the second is omitted if the residual is rounding.
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, load
from proxbench.problems.contact.residual import Residual
from proxbench.solvers import Solution, Status, Stop, create
from proxbench.solvers.interior.progress import Progress
from proxbench.solvers.iteration import loop
from proxbench.solvers.iteration.stopping import Monitor, Outcome

SOLVERS = (
    "Jprox",
    "SORprox",
    "SORprox(relaxation=1.5)",
    "SafeguardedSORprox",
    "NesterovSORprox",
    "AndersonSORprox",
    "NSGS",
    "APGD",
    "ProximalADMM",
    "InteriorPoint",
    "CentralPath",
    "SemismoothNewton",
)
PROBLEMS = (
    "hard-scaled-rows",
    "hard-scaled-rows-15",
    "hard-scaled-tower-10",
    "hard-sliding-block",
    "hard-slider-in-km-t",
    "hard-slider-in-um-mg",
    "hard-duplicated-slider",
    "hard-random-rank",
    "hard-stack-10-top-1e6",
    "hard-stack-2-top-1e4",
    "funnel-30-early",
)
"""Problems on which solvers stall, and two on which solvers with earlier limits would stall."""

FEW = ("hard-scaled-rows-15", "hard-slider-in-km-t", "hard-duplicated-slider")
"""The problems of the slow test; all are weekly."""

TOLERANCE = 1e-12

STOP = Stop(TOLERANCE, 50_000, 1.0)

UNIT_ROUNDING = 0.01
"""Factor on ``rounding``, which is about a hundred times the effect of one rounding of the largest term."""


def without_rules(patch: pytest.MonkeyPatch) -> None:
    """Disable the rules that end sweeps and interior points as stalled."""
    cycle, end = Monitor.check_cycle, Progress.end

    def no_stall(monitor: Monitor, *iterates: Any) -> Outcome | None:
        ended = cycle(monitor, *iterates)
        return None if ended is not None and ended[0] is Status.STALLED else ended

    def no_end(progress: Progress, status: Status, reason: str) -> None:
        if status is not Status.STALLED or "singular" in reason or "path" in reason:
            end(progress, status, reason)

    patch.setattr(Monitor, "check_cycle", no_stall)
    patch.setattr(loop, "check_rounding_limit", lambda *arguments: None)
    patch.setattr(Progress, "end", no_end)


def stalls(problems: Iterable[str]) -> list[tuple[str, ContactProblem, Callable[..., Solution], Solution]]:
    """Return solver, problem, its prepared ``solve`` and the solution of every solve that stalls."""
    found = []
    for problem in map(load, problems):
        for name in SOLVERS:
            solver = create(name)
            if solver.supports(problem) is None:
                solve = solver.prepare(problem).solve
                solution = solve(STOP)
                if solution.status is Status.STALLED:
                    found.append((name, problem, solve, solution))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("problems", [FEW, pytest.param(PROBLEMS, marks=pytest.mark.weekly)], ids=["few", "all"])
def test_claimed_stalls_are_genuine(problems: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    found, false = stalls(problems), []
    assert len(found) >= 10
    for name, problem, solve, solution in found:
        residual = Residual(problem)
        stalled = residual.judged(problem, solution.impulses)
        longer = Stop(TOLERANCE, 10 * max(solution.iterations, 1), 2.0)
        again = residual.judged(problem, solve(longer, solution.impulses).impulses)
        on = np.inf
        if stalled > max(1e-13, UNIT_ROUNDING * residual.rounding(solution.impulses)):
            with monkeypatch.context() as patch:
                without_rules(patch)
                on = residual.judged(problem, solve(longer).impulses)
        if min(again, on) < 0.5 * stalled:
            false.append(f"{name} on {problem.name}: {stalled:.1e}, again {again:.1e}, on {on:.1e}")
    assert false == []
