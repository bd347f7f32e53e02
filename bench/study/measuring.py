"""Measuring one member of a case: simulate, and keep what it came to and what it cost."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from ...problems.errors import said
from ...problems.scenes.woodpecker import OVERLAP, section_start
from ...problems.stepping.accepted_step import AcceptedStep
from ...problems.trajectories.limit_cycle import section_error
from ...problems.trajectories.pour import Watch
from ..simulation.plan import SimulationPlan
from ..simulation.run import simulate
from .plan import Case, StudyPlan, case_plan

ERROR = "error"
"""What the error of one trajectory is called among the values."""

MOST_SOLVES = 10_000
"""One-step solves after which a variable step is given up: where its solver is too coarse, its laws flicker."""

WARM_SHARE = 0.2
"""Share of the duration that is simulated beforehand, so that no compilation is timed."""

StopAsked = Callable[[], bool]


@dataclass(frozen=True)
class Measured:
    """One member of a case.

    Attributes:
        wall: wall time of its steps [s]; judging and noting are not counted.
        solves: one-step inclusions solved, those of rejected attempts included.
        unsolved: steps that the judge does not find solved to the tolerance.
        values: what it came to: the error of a trajectory, or aggregates of a pour; empty if it failed.
        failure: why it came to nothing; empty if it did.
    """

    wall: float
    solves: int
    unsolved: int
    values: Mapping[str, float] = field(default_factory=dict)
    failure: str = ""


def measure(plan: StudyPlan, case: Case, member: float, should_stop: StopAsked = lambda: False) -> Measured | None:
    """Simulate one member of a case; return None if it was stopped."""
    simulated = _made(plan, case, member)
    watch = Watch(simulated.scene)
    try:
        found = _run(simulated, watch, should_stop)
    except (
        Exception,
        SystemExit,
    ) as error:  # a plugin's solver may raise anything, and others are to be measured still
        return Measured(0.0, 0, 0, failure=said(error))
    if should_stop():
        return None
    if found.failure:
        return found
    is_woodpecker = simulated.scene.name == "woodpecker"
    values = {ERROR: section_error(watch.last)} if is_woodpecker else watch.aggregates(plan.duration)
    if not all(map(math.isfinite, values.values())):
        return replace(found, failure="the motion is no longer finite")
    return replace(found, values=values)


def warm_up(plan: StudyPlan, case: Case, should_stop: StopAsked = lambda: False) -> None:
    """Simulate the begin of a case, so that all it needs is compiled."""
    measure(replace(plan, duration=WARM_SHARE * plan.duration), case, case.members[0], should_stop)


def _made(plan: StudyPlan, case: Case, member: float) -> SimulationPlan:
    """Return the simulation of one member: a seed of a pour, a factor on the steps of the woodpecker."""
    if plan.scene != "woodpecker":
        return case_plan(plan, case, {**plan.options, "seed": int(member)})
    if case.step_size is not None:
        # a whole number of steps reaches the end exactly
        steps = max(1, round(plan.duration / case.step_size * member))
        made = case_plan(plan, case, plan.options, plan.duration / steps)
    else:
        made = case_plan(plan, case, plan.options, factor=member)
    return replace(made, scene=replace(made.scene, start=section_start(OVERLAP)))


def _run(plan: SimulationPlan, watch: Watch, should_stop: StopAsked) -> Measured:
    solves, most = 0, MOST_SOLVES if plan.stepper.locates_switches else math.inf

    def note(number: int, taken: AcceptedStep) -> None:
        nonlocal solves
        solves += taken.solves
        watch.note(taken.end)

    done = simulate(plan, on_step=[note], should_stop=lambda: solves > most or should_stop())
    steps = done.steps
    cost = Measured(float(steps["seconds"].sum()), int(steps["solves"].sum()), int(done.unsolved.sum()))
    if not done.is_finished and solves > most:
        at = f"at {done.state.time:.4g} of {plan.until:.4g} s"
        return replace(cost, failure=f"given up after {most} one-step solves, {at}")
    return cost
