"""Chosen steps of a motion, with the state before each."""

from collections.abc import Iterable, Iterator

from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step


def steps_at(rule: MidpointRule, start: State, times: Iterable[float]) -> Iterator[tuple[State, Step]]:
    """Yield the steps that end at some times [s] after the start, each with the state before it."""
    wanted, before = {round(time / rule.time_step) for time in times}, start
    for number, step in enumerate(rule.steps(start, max(wanted)), 1):
        if number in wanted:
            yield before, step
        before = step.state
