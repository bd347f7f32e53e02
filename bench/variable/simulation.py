"""A simulation with variable steps as far as it has come: accepted steps, switching points, positions, velocities."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...problems.adaptive import SwitchingPoint, VariableStepTaken
from ...problems.law_states import LawStates
from ...problems.laws import FloatArray
from ...problems.moreau import State
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


@dataclass(eq=False)
class VariableSimulation:
    """A simulation as far as it has come.

    Attributes:
        plan: what is simulated, and how.
        file: the result file, None if nothing is stored.
        wall_seconds: wall time of everything.
        state: the last state.
        states: states of the laws in the step that led there, None at the start.
    """

    plan: VariablePlan
    file: Path | None = None
    wall_seconds: float = 0.0
    state: State = field(init=False)
    states: LawStates | None = None
    _rows: list[tuple[float, ...]] = field(default_factory=list, repr=False)
    _switches: list[tuple[float, ...]] = field(default_factory=list, repr=False)
    _states: list[FloatArray] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        self.state = self.plan.scene.start

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
        return dict(zip(STEP.names or (), self._rows[-1], strict=True))

    @property
    def steps(self) -> NDArray[np.void]:
        """The accepted steps, a structured array of dtype ``STEP``, shape (n_steps,)."""
        return np.array(self._rows, dtype=STEP)

    @property
    def switches(self) -> NDArray[np.void]:
        """The switching points, a structured array of dtype ``SWITCH``."""
        return np.array(self._switches, dtype=SWITCH)

    @property
    def trajectory(self) -> FloatArray:
        """(q, u) after every step, shape (n_steps, n_coordinates + n_dofs)."""
        start = self.plan.scene.start
        width = len(start.position) + len(start.velocity)
        return np.array(self._states, dtype=np.float64).reshape(self.n_steps, width)

    @property
    def is_finished(self) -> bool:
        """Whether the duration of the plan is reached, up to a part of the shortest step."""
        return self.plan.until - self.state.time <= 1e-3 * self.plan.stepper.min_step

    def append(self, taken: VariableStepTaken, row: tuple[float, ...]) -> None:
        """Add one accepted step with its values in the order of ``STEP``."""
        self._states.append(np.concatenate([taken.end.position, taken.end.velocity]))
        self._switches.extend(_switch_row(switch) for switch in taken.switches)
        self.state, self.states = taken.end, taken.states
        self._rows.append(row)

    def restore(
        self, steps: NDArray[np.void], switches: NDArray[np.void], trajectory: FloatArray, states: LawStates
    ) -> None:
        """Put what was stored in place of everything."""
        self._rows, self._switches = steps.tolist(), switches.tolist()
        self._states = list(trajectory)
        if self._rows:
            position, velocity = np.split(trajectory[-1], [len(self.plan.scene.start.position)])
            self.state, self.states = State(float(steps["time"][-1]), position, velocity), states


def _switch_row(switch: SwitchingPoint) -> tuple[float, ...]:
    return (
        switch.begin,
        switch.end,
        LAWS.index(switch.law),
        switch.contact,
        STATES.index(switch.before),
        STATES.index(switch.after),
    )
