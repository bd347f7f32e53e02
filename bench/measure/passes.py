"""The passes of a run: in which order problems and solvers come, and which points need more rounds."""

from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np

from ..store.certainty import fastest, ratio
from ..store.records import CaseRecord, PlanRecord, Point

WIDE = 0.05
"""Relative width of the interval of a ratio above which more rounds are measured."""

EXTRA_SHARE = 0.15
"""Time that may be spent on more rounds, relative to that of the planned ones."""

Item = TypeVar("Item")


def shuffled(items: Sequence[Item], *seeds: int) -> list[Item]:
    """Return items in an order of their own for each combination of seeds."""
    return [items[index] for index in np.random.default_rng(seeds).permutation(len(items))]


def uncertain(cases: Sequence[CaseRecord], plan: PlanRecord) -> set[tuple[str, int]]:
    """Return solver and level of the points of one problem that need more rounds.

    They are those with the time that a solver has to an accuracy of the plan, where the interval of its ratio to the
    best solver's is wider than ``WIDE``, with those of the best; and those that other programs disturbed.
    """
    found = {(solver, level) for solver, level, point in _repeated(cases) if _is_short(point, plan.passes)}
    levels = {(solver, point.tolerance): level for solver, level, point in _repeated(cases)}
    for accuracy in plan.tolerances:
        reached = [
            (solver, point)
            for solver, point in fastest(cases, accuracy, plan.limits.solve_seconds).items()
            if (solver, point.tolerance) in levels
        ]
        if not reached:
            continue
        best, first = min(reached, key=lambda one: _seconds(one[1]))
        wide = {
            (solver, point.tolerance) for solver, point in reached if ratio(point.rounds, first.rounds).width > WIDE
        }
        if wide - {(best, first.tolerance)}:
            found |= {(solver, levels[solver, value]) for solver, value in wide | {(best, first.tolerance)}}
    return found


def _repeated(cases: Sequence[CaseRecord]) -> Iterator[tuple[str, int, Point]]:
    for case in cases:
        for level, point in enumerate(case.points):
            if point.is_repeated:
                yield case.solver, level, point


def _is_short(point: Point, passes: int) -> bool:
    return 0 < sum(not one.is_marred for one in point.rounds) < passes


def _seconds(point: Point) -> float:
    return np.inf if point.measured is None else point.measured.total_seconds.median
