"""Aggregates of a pour, where single trajectories mean nothing: flow rate, mean height, energy.

Two pours that differ in the last bit differ in every ball after some tenths of a second; what they have in common is
how fast balls leave, how high the others lie on average, and how much energy is lost.
"""

from dataclasses import dataclass, field

import numpy as np

from ...arrays import FloatArray
from ..scenes.scene import Scene
from ..state import State

FLOW, HEIGHT, ENERGY = "flow rate", "mean height", "energy lost"

UNITS = {FLOW: "balls/s", HEIGHT: "m", ENERGY: "J"}

GRID = 400
"""Points in time that means are taken over, in the second half of the duration."""


@dataclass
class Watch:
    """Notes states of a scene as they come; ``aggregates`` averages them.

    Attributes:
        scene: the scene.
        last: the last state.
    """

    scene: Scene
    last: State = field(init=False)
    _rows: list[tuple[float, float, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.note(self.scene.start)

    def note(self, state: State) -> None:
        """Note a state."""
        self.last = state
        scene = self.scene
        if not scene.n_balls:
            return
        through = 0 if scene.balls_through is None else scene.balls_through(state.position)
        energy = np.nan
        if scene.potential_energy is not None:
            energy = scene.kinetic_energy(state.velocity) + scene.potential_energy(state.position)
        heights = state.position.reshape(scene.n_balls, -1)[:, -1]
        self._rows.append((state.time, float(through), float(np.maximum(heights, 0.0).mean()), energy))

    def aggregates(self, duration: float) -> dict[str, float]:
        """Return the aggregates over the second half of ``duration`` [s]; a pour that ended earlier stays as it was.

        Flow rate in balls a second, where there is an outlet; the mean height [m] of all balls above it, those below
        counting as at it; the energy [J] lost since the start, where the scene knows it. The last two are means over
        time.
        """
        time, through, height, energy = np.array(self._rows).T
        grid = time[0] + duration * np.linspace(0.5, 1.0, GRID)
        begin, end = np.interp(grid[[0, -1]], time, through)
        found = {HEIGHT: _mean(grid, time, height)}
        if self.scene.potential_energy is not None:
            found[ENERGY] = float(energy[0]) - _mean(grid, time, energy)
        return found if self.scene.balls_through is None else {FLOW: float(end - begin) / (0.5 * duration), **found}


def _mean(grid: FloatArray, time: FloatArray, values: FloatArray) -> float:
    return float(np.interp(grid, time, values).mean())
