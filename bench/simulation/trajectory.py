"""A simulation as far as it has come: one row of numbers for each step, and the last state."""

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...problems.mechanics.state import State
from ...solvers.interface import Status
from ..store.outcome import ROUNDING
from .beside import Beside
from .failure import Failure
from .plan import SimulationPlan
from .thinning import Thinning

STEP = np.dtype(
    [
        ("time", "<f8"),
        ("contacts", "<i4"),
        ("iterations", "<i4"),
        ("residual", "<f8"),
        ("status", "u1"),
        ("kinetic_energy", "<f8"),
        ("potential_energy", "<f8"),
        ("penetration", "<f8"),
        ("impact_depth", "<f8"),
        ("balls_through", "<i4"),
        ("agitation", "<f8"),
        ("seconds", "<f8"),
    ]
)
"""One step: its end [s]; active contacts; iterations of the solver; the judge's residual; an index into the statuses;
energies [J] at its end; deepest penetration over the length of the scene, in the state where it begins and at its
midpoint, where contacts are found; balls that have left through the outlet, −1 where there is none; mean kinetic energy
of the others over m g r; wall time of the step [s]."""

JAM_SECONDS = 0.25
"""Simulated time of rest after which a funnel counts as jammed; a ball falls through thirty radii in it."""

JAM_AGITATION = 1e-4
"""A pile rests while its balls move with less than this kinetic energy over m g r, on average."""

NO_CONTACT = "no contact"
"""Status of a step in which no solver was asked."""

STATUSES = (NO_CONTACT, *(status.value for status in Status))
"""What the status of a step is an index into."""

SLACK = 1.001
"""A step counts as solved up to this many tolerances: solver and judge sum relative velocities in different orders."""


class Ending(StrEnum):
    """Why a simulation is over."""

    DURATION = "duration"
    EMPTIED = "emptied"
    JAMMED = "jammed"
    STOPPED = "stopped"
    FAILED = "failed"


@dataclass(eq=False)
class Simulation:
    """A simulation as far as it has come.

    Attributes:
        plan: what is simulated, and how.
        statuses: what ``steps["status"]`` is an index into.
        wall_seconds: wall time of everything: steps, judging, storing, showing.
        file: the result file, None if nothing is stored.
        failure: why the next step could not be taken, None if nothing failed since the simulation last went on.
        beside: where its chart and its recording are.
        thinning: keeps states evenly over simulated time.
    """

    plan: SimulationPlan
    statuses: tuple[str, ...] = STATUSES
    wall_seconds: float = 0.0
    file: Path | None = None
    failure: Failure | None = None
    beside: Beside = field(default_factory=Beside)
    _rows: NDArray[np.void] = field(default_factory=lambda: np.zeros(1024, dtype=STEP), repr=False)
    thinning: Thinning = field(init=False, repr=False)
    _reached: tuple[int, State] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.thinning = Thinning(self.plan.states, self.plan.scene.start, self.plan.step_size)
        self._reached = (0, self.plan.scene.start)

    @property
    def n_steps(self) -> int:
        """Number of steps taken."""
        return self._reached[0]

    @property
    def state(self) -> State:
        """The last state."""
        return self._reached[1]

    @property
    def states(self) -> list[State]:
        """States from the first to the last, evenly over simulated time."""
        return self.thinning.states

    @property
    def steps(self) -> NDArray[np.void]:
        """The steps taken, a structured array of dtype ``STEP``, shape (n_steps,)."""
        return self._rows[: self._reached[0]]

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to simulate: the duration is over, the last ball through, or the outlet jammed."""
        return self.ending not in (Ending.STOPPED, Ending.FAILED)

    @property
    def ending(self) -> "Ending":
        """Why the simulation is over, or that it is not."""
        if self._is_emptied:
            return Ending.EMPTIED
        if self._is_jammed:
            return Ending.JAMMED
        if self.n_steps >= self.plan.n_steps:
            return Ending.DURATION
        return Ending.STOPPED if self.failure is None else Ending.FAILED

    @property
    def _is_emptied(self) -> bool:
        has_outlet = self.plan.scene.balls_through is not None and self.n_steps > 0
        return has_outlet and bool(self.steps["balls_through"][-1] == self.plan.scene.n_balls)

    @property
    def _is_jammed(self) -> bool:
        """Whether balls are left above the outlet, and have rested there, none leaving, for ``JAM_SECONDS``."""
        steps = self.steps
        if self.plan.scene.balls_through is None or not len(steps) or steps["agitation"][-1] > JAM_AGITATION:
            return False
        since = int(np.searchsorted(steps["time"], steps["time"][-1] - JAM_SECONDS, side="right"))
        last = steps[since:]
        rested = since > 0 and bool((last["agitation"] <= JAM_AGITATION).all())
        return rested and bool(last["balls_through"][0] == last["balls_through"][-1])

    @property
    def unsolved(self) -> NDArray[np.bool_]:
        """Which steps the judge does not find solved to the tolerance, shape (n_steps,)."""
        return self.unsolved_from(0)

    def unsolved_from(self, first: int) -> NDArray[np.bool_]:
        """Return the same of the steps from index ``first`` on."""
        missed: NDArray[np.bool_] = ~(self.steps["residual"][first:] <= SLACK * self.plan.tolerance + ROUNDING)
        return missed

    @property
    def refuted(self) -> NDArray[np.bool_]:
        """Which unsolved steps the solver itself calls solved, shape (n_steps,)."""
        claimed: NDArray[np.bool_] = self.steps["status"] == self.statuses.index(Status.SOLVED.value)
        return self.unsolved & claimed

    def append(self, row: tuple[float, ...], state: State) -> None:
        """Add one step with its values in the order of ``STEP``; an interruption in between leaves the step out."""
        count = self.n_steps
        if count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        self._rows[count] = row
        self._reached = (count + 1, state)
        self.thinning.offer(state)

    def restore(self, steps: NDArray[np.void], state: State) -> None:
        """Put stored steps and the state they led to in place of everything."""
        self._rows = np.concatenate([steps, np.zeros(1024, dtype=STEP)])
        self._reached = (len(steps), state)
        self.thinning.offer(state)
