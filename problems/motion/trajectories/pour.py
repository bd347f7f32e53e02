"""Aggregates of a pour, whose individual trajectories are chaotic: flow rate, mean height, energy.

Two pours that differ in the last bit differ in every ball after some tenths of a second. They still agree in the flow
rate, in the mean height above the outlet, and in the energy lost.
"""

from dataclasses import dataclass, field

import numpy as np

from ...arrays import FloatArray
from ..scenes.scene import Scene
from ..state import State

HEIGHT, ENERGY = "mean height", "energy lost"

UNITS = {"flow rate": "balls/s", HEIGHT: "m", ENERGY: "J"}
"""Units of the aggregates, by name."""

GRID = 400
"""Number of instants in the second half of the duration, over which means are taken."""


@dataclass
class MotionRecorder:
    """A record of the states of a scene, which ``aggregates`` averages.

    Attributes:
        scene: the scene.
        last: the last state.
        displacement: the largest change of a coordinate from the start at any time [m; 1 for quaternions].
    """

    scene: Scene
    last: State = field(init=False)
    displacement: float = field(default=0.0, init=False)
    _columns: dict[str, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._rates = [observable for observable in self.scene.observables if observable.rate]
        self.record(self.scene.start)

    def record(self, state: State) -> None:
        """Record a state."""
        self.last, scene = state, self.scene
        moved = float(np.abs(state.position - scene.start.position).max(initial=0.0))
        self.displacement = max(self.displacement, moved)
        if not scene.n_balls:
            return
        heights = state.position.reshape(scene.n_balls, -1)[:, -1]
        values = {"time": state.time, HEIGHT: float(np.maximum(heights, 0.0).mean())}
        if scene.potential_energy is not None:
            values[ENERGY] = scene.kinetic_energy(state.velocity) + scene.potential_energy(state.position)
        values |= {observable.name: float(observable.compute(state)) for observable in self._rates}
        for name, value in values.items():
            self._columns.setdefault(name, []).append(value)

    def aggregates(self, duration: float) -> dict[str, float]:
        """Return the aggregates over the second half of ``duration`` [s]; a pour that has ended keeps its last state.

        These are the mean rate of each observable that has one, such as balls per second through the outlet; the mean
        height [m] of all balls above the outlet, where balls below it count as 0; and the energy [J] lost since the
        start, if it is known. The last two are means over time.
        """
        columns = {name: np.array(values) for name, values in self._columns.items()}
        time = columns["time"]
        grid = time[0] + duration * np.linspace(0.5, 1.0, GRID)
        results = {}
        for observable in self._rates:
            begin, end = np.interp(grid[[0, -1]], time, columns[observable.name])
            results[observable.rate] = float(end - begin) / (0.5 * duration)
        results[HEIGHT] = _mean(grid, time, columns[HEIGHT])
        if ENERGY in columns:
            results[ENERGY] = float(columns[ENERGY][0]) - _mean(grid, time, columns[ENERGY])
        return results


def _mean(grid: FloatArray, time: FloatArray, values: FloatArray) -> float:
    return float(np.interp(grid, time, values).mean())
