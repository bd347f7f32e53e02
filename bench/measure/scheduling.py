"""The passes of a run: in which order problems and solvers come, and which points need more rounds."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from ..store.frames import points_frame, rounds_frame
from ..store.plans import PlanRecord
from ..store.ratios import SLOWER, standings, times_by_point
from ..store.records import CaseRecord

WIDE = 0.05
"""Relative width of the interval of a ratio above which more rounds are measured."""

EXTRA_SHARE = 0.15
"""Time that may be spent on more rounds, relative to that of the planned ones."""

Item = TypeVar("Item")


def shuffled(items: Sequence[Item], *seeds: int) -> list[Item]:
    """Return items in an order of their own for each combination of seeds."""
    return [items[index] for index in np.random.default_rng(seeds).permutation(len(items))]


def uncertain(cases: Sequence[CaseRecord], plan: PlanRecord, is_first: bool) -> set[tuple[str, int]]:
    """Return solver and level of the points of one problem that need more rounds.

    They are those with the time that a solver has to an accuracy of the plan, where the interval of its ratio to the
    best solver's is wider than ``WIDE``, with those of the best; in the first further pass only where it does not tell
    which of both is faster. Beside them, those with fewer rounds that are not excluded than
    planned passes.
    """
    repeated = {
        (case.solver, point.tolerance): (case.solver, level)
        for case in cases
        for level, point in enumerate(case.points)
        if point.is_repeated
    }
    found = {
        repeated[case.solver, point.tolerance]
        for case in cases
        for point in case.points
        if point.is_repeated and sum(not one.excluded for one in point.rounds) < plan.passes
    }
    points, times = points_frame(cases), times_by_point(rounds_frame(cases))
    for accuracy in plan.tolerances:
        stand = standings(points, times, accuracy, plan.limits.solve_seconds)
        wide = stand[(stand["high"] > (1.0 + WIDE) * stand["low"]) & ~(is_first & (stand["standing"] == SLOWER))]
        if len(wide):
            places = [*zip(wide["solver"], wide["tolerance"], strict=True), (stand["solver"][0], stand["tolerance"][0])]
            found |= {repeated[place] for place in places if place in repeated}
    return found
