"""A simulation with variable steps as far as it has come: accepted steps, switching points, positions, velocities."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.mechanics.state import State
from ...problems.stepping.contact_states import LawStates
from ...problems.stepping.variable_step import SwitchingPoint, VariableStepTaken
from ..simulation.beside import Beside
from ..simulation.failure import Failure
from ..simulation.thinning import Thinning
from .plan import VariablePlan

STEP = np.dtype(
    [
        ("time", "<f8"),
        ("length", "<f8"),
        ("error", "<f8"),
        ("solves", "<i4"),
        ("rejected", "<i4"),
        ("contacts", "<i4"),
        ("iterations", "<i4"),
        ("residual", "<f8"),
        ("kinetic_energy", "<f8"),
        ("potential_energy", "<f8"),
        ("penetration", "<f8"),
        ("seconds", "<f8"),
    ]
)
"""One accepted step: its end and length [s]; estimated relative error; one-step inclusions solved for it, those of
rejected attempts included; attempts rejected before it; closed contacts at its end; iterations of the solver in its
last sequence, and the largest residual the judge finds there; energies [J] at its end; deepest penetration over the
length of the scene; wall time [s]."""

SWITCH = np.dtype(
    [("begin", "<f8"), ("end", "<f8"), ("law", "u1"), ("contact", "<i8"), ("before", "u1"), ("after", "u1")]
)
"""One switching point: not before, not after [s]; an index into ``LAWS``; contact; indices into ``STATES``."""

LAWS = ("unilateral", "friction")

STATES = ("open", "closed", "stick", "slip")

FINENESS = 2.0**-20
"""Base spacing of the states that are kept, over the longest step of the scene: any two steps are told apart."""


class Rows:
    """Rows that are appended one by one, kept in one array that doubles when it is full.

    Args:
        begun: the rows so far, of the shape and type of all.
    """

    def __init__(self, begun: NDArray[Any]) -> None:
        self._array, self._count = begun, len(begun)

    def __len__(self) -> int:
        return self._count

    def append(self, row: Any) -> None:
        """Add one row."""
        if self._count == len(self._array):
            more = np.zeros((max(256, self._count), *self._array.shape[1:]), dtype=self._array.dtype)
            self._array = np.concatenate([self._array, more])
        self._array[self._count] = row
        self._count += 1

    @property
    def all(self) -> NDArray[Any]:
        """All rows."""
        return self._array[: self._count]


@dataclass(eq=False)
class VariableSimulation:
    """A simulation as far as it has come.

    Attributes:
        plan: what is simulated, and how.
        file: the result file, None if nothing is stored.
        wall_seconds: wall time of everything.
        state: the last state.
        states: states of the laws in the step that led there, None at the start.
        failure: why the next step could not be taken, None if nothing failed since the simulation last went on.
        beside: where its chart and its recording are.
        thinning: keeps states evenly over simulated time, and those at switching points.
    """

    plan: VariablePlan
    file: Path | None = None
    wall_seconds: float = 0.0
    failure: Failure | None = None
    beside: Beside = field(default_factory=Beside)
    state: State = field(init=False)
    states: LawStates | None = None
    _rows: Rows = field(init=False, repr=False)
    _switches: Rows = field(init=False, repr=False)
    thinning: Thinning = field(init=False, repr=False)

    def __post_init__(self) -> None:
        scene = self.plan.scene
        self.state = scene.start
        self.thinning = Thinning(self.plan.states, scene.start, FINENESS * scene.longest_step)
        self._rows, self._switches = Rows(np.zeros(0, dtype=STEP)), Rows(np.zeros(0, dtype=SWITCH))

    @property
    def n_steps(self) -> int:
        """Number of accepted steps."""
        return len(self._rows)

    @property
    def n_switches(self) -> int:
        """Number of switching points."""
        return len(self._switches)

    @property
    def last_row(self) -> dict[str, float]:
        """The last accepted step by the names of ``STEP``."""
        last = self._rows.all[-1]
        return {name: float(last[name]) for name in STEP.names or ()}

    @property
    def steps(self) -> NDArray[np.void]:
        """The accepted steps, a structured array of dtype ``STEP``, shape (n_steps,)."""
        return self._rows.all

    @property
    def switches(self) -> NDArray[np.void]:
        """The switching points, a structured array of dtype ``SWITCH``."""
        return self._switches.all

    @property
    def times(self) -> FloatArray:
        """When the states of the trajectory are [s], from the first to the last, shape (n_states,)."""
        return np.array([state.time for state in self.thinning.states])

    @property
    def trajectory(self) -> FloatArray:
        """(q, u) evenly over time and about switching points, shape (n_states, n_coordinates + n_dofs)."""
        return np.array([np.concatenate([state.position, state.velocity]) for state in self.thinning.states])

    @property
    def is_finished(self) -> bool:
        """Whether the duration of the plan is reached, up to a part of the shortest step."""
        return self.plan.until - self.state.time <= 1e-3 * self.plan.stepper.min_step

    def append(self, taken: VariableStepTaken, row: tuple[float, ...]) -> None:
        """Add one accepted step with its values in the order of ``STEP``."""
        if taken.switches:
            self.thinning.offer(taken.begin, True)
        self.thinning.offer(taken.end, bool(taken.switches))
        for switch in taken.switches:
            self._switches.append(_switch_row(switch))
        self.state, self.states = taken.end, taken.states
        self._rows.append(row)

    def restore(self, steps: NDArray[np.void], switches: NDArray[np.void], states: LawStates) -> None:
        """Put what was stored in place of everything, the last state of ``thinning`` that after the last step."""
        self._rows, self._switches = Rows(steps), Rows(switches)
        if len(steps):
            self.state, self.states = self.thinning.states[-1], states


def _switch_row(switch: SwitchingPoint) -> tuple[float, ...]:
    return (
        switch.begin,
        switch.end,
        LAWS.index(switch.law),
        switch.contact,
        STATES.index(switch.before),
        STATES.index(switch.after),
    )
