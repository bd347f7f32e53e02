"""A simulation: one row per accepted step, switching points, and states."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from ...problems.motion.scenes.scene import SceneEnding
from ...problems.motion.state import State
from ...problems.motion.stepping.step import AcceptedStep, LawName, LawState, LawStates, SwitchingPoint
from ...problems.motion.trajectories.limit_cycle import SwitchEvent
from ..report.layout.text import counted
from ..store.notes import hides_contacts
from ..store.outcome import ROUNDING
from .history import Failure, Segment, extended, planned_segment
from .kept_states import KeptStates
from .plan import SimulationPlan
from .step_row import STATUSES, StepRow, step_columns
from .view.outputs import SimulationOutputs

SWITCH = np.dtype(
    [("begin", "<f8"), ("end", "<f8"), ("law", "u1"), ("contact", "<i8"), ("before", "u1"), ("after", "u1")]
)
"""One switching point: its interval [s]; an index into ``LAWS``; the contact; indices into ``LAW_STATES``."""

LAWS: tuple[LawName, ...] = get_args(LawName)
"""Names of laws by the index that rows of switching points store."""

LAW_STATES: tuple[LawState, ...] = get_args(LawState)
"""Names of the states of laws by the stored index."""

SLACK = 1.001
"""Multiple of the tolerance up to which a step is solved; solver and judge sum velocities in different orders."""


class Ending(StrEnum):
    """Why a simulation ended, unless its scene ended it."""

    DURATION = "duration"
    STOPPED = "stopped"
    FAILED = "failed"


class GrowingArray:
    """An array to which rows are appended, and whose capacity doubles when it is full.

    Args:
        start: the first rows, with the shape and type of all rows.
    """

    def __init__(self, start: NDArray[Any]) -> None:
        self._array, self._count = start, len(start)

    def append(self, row: Any) -> None:
        """Add one row."""
        if self._count == len(self._array):
            new_rows = np.zeros((max(256, self._count), *self._array.shape[1:]), dtype=self._array.dtype)
            self._array = np.concatenate([self._array, new_rows])
        self._array[self._count] = row
        self._count += 1

    def truncate(self, count: int) -> None:
        """Discard all except the first ``count`` rows."""
        self._count = min(self._count, count)

    @property
    def all(self) -> NDArray[Any]:
        """All rows."""
        return self._array[: self._count]


@dataclass(frozen=True, eq=False)
class _Progress:
    """The progress of a simulation; it is replaced as a whole, so that an interruption leaves a consistent state."""

    n_steps: int
    n_switches: int
    state: State
    law_states: LawStates | None = None
    segments: tuple[Segment, ...] = ()


@dataclass(eq=False)
class Simulation:
    """A simulation, finished or in progress.

    Attributes:
        plan: the plan.
        statuses: names of the statuses, indexed by ``steps["status"]``.
        wall_seconds: total wall time of steps, judging, storing and showing [s].
        file: the result file; None if nothing is stored.
        failure: the failed next step; None if no step has failed since the simulation was resumed.
        outputs: paths of the chart and the recording.
        kept_states: the stored states, evenly over simulated time and at switching points.
    """

    plan: SimulationPlan
    statuses: tuple[str, ...] = STATUSES
    wall_seconds: float = 0.0
    file: Path | None = None
    failure: Failure | None = None
    outputs: SimulationOutputs = field(default_factory=SimulationOutputs)
    kept_states: KeptStates = field(init=False, repr=False)
    _rows: GrowingArray = field(init=False, repr=False)
    _switches: GrowingArray = field(init=False, repr=False)
    _progress: _Progress = field(init=False, repr=False)

    def __post_init__(self) -> None:
        scene = self.plan.scene
        self.kept_states = KeptStates(self.plan.states, scene.start, self.plan.stepper.resolution(scene))
        self._rows = GrowingArray(np.zeros(0, dtype=step_columns(scene)))
        self._switches = GrowingArray(np.zeros(0, dtype=SWITCH))
        self._progress = _Progress(0, 0, scene.start)

    def __repr__(self) -> str:
        reached = f"{counted(self.n_steps, 'step')}, {self.state.time:g} of {self.plan.until:g} s"
        return f"<Simulation of {self.plan.scene.name}: {reached}>"

    @property
    def n_steps(self) -> int:
        """Number of accepted steps."""
        return self._progress.n_steps

    @property
    def state(self) -> State:
        """The last state."""
        return self._progress.state

    @property
    def law_states(self) -> LawStates | None:
        """States of the laws in the last step; None at the start."""
        return self._progress.law_states

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The settings of the steps, in order; empty without steps."""
        return self._progress.segments

    def segments_with_steps(self) -> Iterator[tuple[Segment, slice]]:
        """Yield each segment with the indices of its steps."""
        ends = [*(segment.first for segment in self.segments[1:]), self.n_steps]
        for segment, end in zip(self.segments, ends, strict=False):  # without steps there is no segment
            yield segment, slice(segment.first, end)

    @property
    def tolerances(self) -> FloatArray:
        """The tolerance of each step, that of its segment, shape (n_steps,)."""
        borders = [segment.first for segment in self.segments]
        counts = np.diff([*borders, self.n_steps])
        return np.repeat([segment.tolerance for segment in self.segments], counts)

    @property
    def states(self) -> list[State]:
        """States from the first to the last, evenly over simulated time and at switching points."""
        return self.kept_states.states

    @property
    def times(self) -> FloatArray:
        """Times of ``states`` [s], shape (n_states,)."""
        return np.array([state.time for state in self.states])

    @property
    def trajectory(self) -> FloatArray:
        """(q, u) of ``states``, shape (n_states, n_coordinates + n_dofs)."""
        return np.array([np.concatenate([state.position, state.velocity]) for state in self.states])

    @property
    def steps(self) -> NDArray[np.void]:
        """The accepted steps, a structured array of dtype ``step_columns(scene)``, shape (n_steps,)."""
        return self._rows.all[: self._progress.n_steps]

    @property
    def switches(self) -> NDArray[np.void]:
        """The switching points, a structured array of dtype ``SWITCH``."""
        return self._switches.all[: self._progress.n_switches]

    @property
    def switch_events(self) -> list[SwitchEvent]:
        """The switching points in order of time, as events with names of laws and states."""
        return [
            SwitchEvent(0.5 * (begin + end), LAWS[law], contact, LAW_STATES[before], LAW_STATES[after])
            for begin, end, law, contact, before, after in self.switches.tolist()
        ]

    @property
    def is_finished(self) -> bool:
        """Whether the simulation is complete: it reached its duration, or its scene ended it."""
        return self.ending not in (Ending.STOPPED, Ending.FAILED)

    @property
    def scene_ending(self) -> SceneEnding | None:
        """The ending by the scene; None if the scene has not ended the simulation."""
        rule, steps = self.plan.scene.ending, self.steps
        if rule is None or not self.n_steps:
            return None
        first = int(np.searchsorted(steps["time"], steps["time"][-1] - rule.seconds, side="right"))
        return rule.find(steps[max(0, first - 1) :])

    @property
    def ending(self) -> str:
        """Why the simulation ended: an ``Ending``, or the name of ``scene_ending``."""
        scene_ending = self.scene_ending
        if scene_ending is not None:
            return scene_ending.name
        if self.plan.stepper.has_reached(self.plan.scene, self.state, self.plan.until):
            return Ending.DURATION
        return Ending.STOPPED if self.failure is None else Ending.FAILED

    @property
    def unsolved(self) -> NDArray[np.bool_]:
        """Whether each step is unsolved, as judged, shape (n_steps,)."""
        return self.unsolved_from(0)

    def unsolved_from(self, first: int) -> NDArray[np.bool_]:
        """Return ``unsolved`` for the steps from index ``first`` on."""
        tolerances = self.tolerances[first:]
        is_unsolved: NDArray[np.bool_] = ~(self.steps["residual"][first:] <= SLACK * tolerances + ROUNDING)
        return is_unsolved

    @property
    def refuted(self) -> NDArray[np.bool_]:
        """Whether each step is unsolved but reported as solved, shape (n_steps,)."""
        claimed: NDArray[np.bool_] = self.steps["status"] == self.statuses.index(Status.SOLVED.value)
        return self.unsolved & claimed

    @property
    def overlapping(self) -> NDArray[np.bool_]:
        """Whether a penetration above the tolerance remains after the projection in each step, shape (n_steps,)."""
        overlapping: NDArray[np.bool_] = self.steps["overlap"] > 0.0
        return overlapping

    @property
    def has_hidden_errors(self) -> NDArray[np.bool_]:
        """Whether fast contacts hide the errors of others in each step, shape (n_steps,)."""
        return hides_contacts(self.steps["residual"], self.steps["local_residual"])

    def append(self, row: StepRow, step: AcceptedStep) -> None:
        """Add one accepted step with its row, and discard a step that an interruption left incomplete."""
        progress = self._progress
        self._rows.truncate(progress.n_steps)
        self._switches.truncate(progress.n_switches)
        self._rows.append(row.values)
        for switch in step.switches:
            self._switches.append(_switch_row(switch))
        segments = extended(progress.segments, self.plan, progress.n_steps)
        n_switches = progress.n_switches + len(step.switches)
        self._progress = _Progress(progress.n_steps + 1, n_switches, step.end, step.states, segments)
        if step.switches:
            self.kept_states.offer(step.begin, True)
        self.kept_states.offer(step.end, bool(step.switches))

    def restore(
        self,
        steps: NDArray[np.void],
        state: State,
        switches: NDArray[np.void] | None = None,
        law_states: LawStates | None = None,
        segments: Sequence[Segment] | None = None,
    ) -> None:
        """Replace all steps by stored ones.

        Args:
            steps: the steps.
            state: the state at the end of the last step.
            switches: the switching points; None if there are none.
            law_states: the last states of laws.
            segments: segments of the steps; if None, one with the settings of the plan.
        """
        if switches is None:
            switches = np.zeros(0, dtype=SWITCH)
        if segments is None:
            segments = [planned_segment(self.plan, 0)] if len(steps) else []
        self._rows, self._switches = GrowingArray(steps), GrowingArray(switches)
        self._progress = _Progress(
            len(steps), len(switches), state, law_states if len(steps) else None, tuple(segments)
        )
        self.kept_states.offer(state)


def describe_switches(events: Sequence[SwitchEvent]) -> str:
    """Return the numbers of switching points and of their instants, in words; each law that switches counts once."""
    if not events:
        return "no switching points"
    instants = len({event.time for event in events})
    return f"{counted(len(events), 'switching point')} at {counted(instants, 'instant')}"


def _switch_row(switch: SwitchingPoint) -> tuple[float, ...]:
    """Return a switching point as a row of type ``SWITCH``."""
    law, before, after = LAWS.index(switch.law), LAW_STATES.index(switch.before), LAW_STATES.index(switch.after)
    return switch.begin, switch.end, law, switch.contact, before, after
