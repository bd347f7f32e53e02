"""Recordings of scenes whose bodies cannot be drawn: curves of their coordinates beside those of every simulation."""

from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from ...problems.mechanics.state import State
from ...problems.scenes.scene import Scene
from ...problems.stepping.moreau import Step
from .blueprints import plot, simulation_blueprint
from .contact_states import States
from .simulation import COORDINATES, StepRecorder

MOST_COORDINATES = 12
"""Coordinates that are drawn, the first ones of scenes that name none."""


class CoordinateRecorder(StepRecorder):
    """Records the coordinates of a scene; see ``StepRecorder``.

    Args:
        scene: the scene.
        file: the recording.
        force: replace an existing file.
        every: draw coordinates at each such step.
    """

    def __init__(self, scene: Scene, file: Path, force: bool = False, every: int = 1) -> None:
        about = f"**{scene.name}**\n\nThe bodies of this scene are not known; its coordinates are drawn over time."
        super().__init__(file, scene.name, about, force, every)
        count = min(len(scene.start.position), MOST_COORDINATES)
        self._scene = scene
        self._names = scene.coordinates or {f"q{index}": index for index in range(count)}

    def _blueprint(self, state: State) -> rrb.Blueprint:
        plots = [
            plot("coordinates", f"/curves/{COORDINATES}"),
            *self._plots(),
            plot("log₁₀ step size [s]", "/curves/step_size", legend=False),
        ]
        return simulation_blueprint([], plots, self._every)

    def _set_up(self, stream: rr.RecordingStream, state: State) -> None:
        """There is nothing that does not change."""

    def _draw(self, stream: rr.RecordingStream, state: State) -> None:
        """There are no bodies."""

    def _draw_impulses(self, stream: rr.RecordingStream, step: Step, states: States | None) -> None:
        """There are no places for them."""

    def _energies(self, state: State) -> tuple[float, float]:
        return self._scene.kinetic_energy(state.velocity), self._scene.potential_energy(state.position)

    def _own_curves(self, state: State) -> dict[str, float]:
        return {f"{COORDINATES}/{name}": float(state.position[index]) for name, index in self._names.items()}
