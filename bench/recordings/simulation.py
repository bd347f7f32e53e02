"""What recordings of all simulations share: the timelines ``step`` and ``time``, and the curves of the steps.

A scene whose bodies cannot be drawn is recorded by its coordinates.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Residual
from ...problems.mechanics.state import State
from ...problems.scenes.scene import Scene
from ...problems.stepping.moreau import Step
from ..errors import BenchError
from ..report.palette import PALETTE, rgb
from .blueprints import STEP, TIME, plot, simulation_blueprint
from .contact_states import STATE_COLOURS, ContactState, States, contact_states, count_states, write_state_colours
from .file import RecordingFile

SMALLEST = 1e-16
"""Residuals below are drawn here: the curve is a logarithm."""

BODIES, IMPULSES = "scene/bodies", "scene/impulses"
"""Entities of every simulation."""

MOST_COORDINATES = 12
"""Coordinates that are drawn, the first ones of scenes that name none."""

NOT_STARTED = "the recorder was not started; call its start with the state before the first step."

ENERGIES = ("kinetic", "potential", "total")

COORDINATES = "coordinates"
"""The group of curves of coordinates that have no body to be drawn on."""


class StepRecorder(ABC):
    """Records a simulation: ``start`` once, then a call after each step, in a ``with`` block that ends the file.

    Leaving the block with an error keeps what was recorded until then. If nothing was started, or the file cannot be
    ended, there is none, and a file that was there before stays as it was.

    Args:
        file: the recording, ending in ``.rrd``.
        title: what the viewer calls it.
        about: what is seen, in Markdown.
        force: replace an existing file.
        every: draw bodies and impulses at each such step; curves hold all steps.

    Raises:
        BenchError: if the file exists, is no ``.rrd``, or cannot be written; or if ``every`` is not positive.
    """

    def __init__(self, file: Path, title: str, about: str, force: bool, every: int) -> None:
        if every < 1:
            raise BenchError(f"every must be at least 1, got {every}.")
        self.file = file
        self._recording = RecordingFile(file, force)
        self._title, self._about, self._every = title, about, every
        self._count = 0
        self._times: list[float] = []
        self._curves: dict[str, list[float]] = {}
        self._stream: rr.RecordingStream | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            if self._stream is not None:
                self._finish(self._stream)
                self._write_curves(self._stream)
        except BaseException as problem:
            self._recording.__exit__(type(problem), problem, problem.__traceback__)
            raise
        self._recording.__exit__(None, None, None)

    def start(self, state: State) -> None:
        """Draw the state before the first step."""
        stream = self._recording.begin("simulation", self._title, self._blueprint(state))
        self._stream = stream
        about = rr.TextDocument(self._about, media_type="text/markdown")
        stream.log("about", about, static=True)
        write_state_colours(stream, "scene")
        self._set_up(stream, state)
        self._set_time(stream, state)
        self._draw(stream, state)
        self._note(state, None)

    def __call__(self, step: Step) -> None:
        """Record one step.

        Raises:
            BenchError: if the recorder was not started.
        """
        if self._stream is None:
            raise BenchError(NOT_STARTED)
        self._count += 1
        states = _states(step)
        self._follow(step)
        if self._count % self._every == 0:
            self._show(self._stream, step, states)
        self._note(step.state, step, states)

    def replay(self, times: FloatArray, curves: Mapping[str, FloatArray], drawn: Iterable[tuple[int, Step]]) -> None:
        """Record a simulation that is over, of which some steps are known as a whole; instead of a call for each.

        Args:
            times: the start and the ends of all steps [s], shape (n_steps + 1,).
            curves: values at these times by the name of the curve, nan where nothing is drawn.
            drawn: steps that are drawn in the order of time, with their numbers from 1; what else curves show is known
                of them alone.

        Raises:
            BenchError: if the recorder was not started.
        """
        if self._stream is None:
            raise BenchError(NOT_STARTED)
        at_start = self._curves
        self._times = times.tolist()
        self._curves = {name: values.tolist() for name, values in curves.items()}
        for name in at_start.keys() - curves.keys():
            self._curves[name] = [*at_start[name], *[np.nan] * (len(times) - 1)]
        for number, step in drawn:
            self._count, states = number, _states(step)
            self._follow(step)
            self._show(self._stream, step, states)
            for name, value in {**_counts(states), **self._own_curves(step.state)}.items():
                self._curves[name][number] = value

    def _show(self, stream: rr.RecordingStream, step: Step, states: States | None) -> None:
        self._set_time(stream, step.state)
        self._draw(stream, step.state)
        self._draw_impulses(stream, step, states)

    def _set_time(self, stream: rr.RecordingStream, state: State) -> None:
        stream.set_time(STEP, sequence=self._count)
        stream.set_time(TIME, duration=state.time)

    def _note(self, state: State, step: Step | None, states: States | None = None) -> None:
        """Keep the numbers of one instant for the curves."""
        values = {"step_size": np.log10(state.time - self._times[-1]) if self._times else np.nan}
        self._times.append(state.time)
        values |= _counts(states)
        values["iterations"] = float(step.iterations) if step is not None else 0.0
        values["residual"] = np.log10(max(step_residual(step), SMALLEST)) if step is not None else np.nan
        kinetic, potential = self._energies(state)
        values |= {"energy/kinetic": kinetic, "energy/potential": potential, "energy/total": kinetic + potential}
        values |= self._own_curves(state)
        for name, value in values.items():
            self._curves.setdefault(name, []).append(value)

    def _write_curves(self, stream: rr.RecordingStream) -> None:
        times = np.array(self._times)
        for name, values in self._curves.items():
            kept = np.flatnonzero(~np.isnan(values))
            path, label = f"curves/{name}", name.rpartition("/")[2]
            line = rr.SeriesLines(colors=[_colour_of(name)], names=[label], widths=[2.0])
            stream.log(path, line, static=True)
            at = [rr.TimeColumn(STEP, sequence=kept), rr.TimeColumn(TIME, duration=times[kept])]
            stream.send_columns(path, at, rr.Scalars.columns(scalars=np.array(values)[kept]))

    def _plots(self) -> list[rrb.TimeSeriesView]:
        return [
            plot("active contacts", "/curves/contacts"),
            plot("solver iterations", "/curves/iterations", legend=False),
            plot("log₁₀ residual (judge)", "/curves/residual", legend=False),
            plot("energy [J]", "/curves/energy"),
        ]

    @abstractmethod
    def _blueprint(self, state: State) -> rrb.Blueprint:
        """Return how the file opens."""

    @abstractmethod
    def _set_up(self, stream: rr.RecordingStream, state: State) -> None:
        """Log what does not change."""

    def _follow(self, step: Step) -> None:  # noqa: B027 - few recordings look at all steps
        """Take in a step that may not be drawn."""

    @abstractmethod
    def _draw(self, stream: rr.RecordingStream, state: State) -> None:
        """Log the bodies."""

    @abstractmethod
    def _draw_impulses(self, stream: rr.RecordingStream, step: Step, states: States | None) -> None:
        """Log the impulses."""

    @abstractmethod
    def _energies(self, state: State) -> tuple[float, float]:
        """Return kinetic and potential energy [J]."""

    def _own_curves(self, state: State) -> dict[str, float]:
        """Return further curves."""
        return {}

    def _finish(self, stream: rr.RecordingStream) -> None:  # noqa: B027 - few recordings end with a summary
        """Log what is known only at the end."""


def step_residual(step: Step) -> float:
    """Return the judge's residual of one step, 0 if no contact was active."""
    problem, contacts = step.problem, step.contacts
    if problem is None or contacts is None or problem.factors is None:
        return 0.0
    directions = contacts.directions
    moved: FloatArray = problem.factors.inverse_mass.times(directions.times(step.impulses))
    return Residual(problem)(step.impulses, directions.transposed_times(moved) + problem.free_velocity)


def _states(step: Step) -> States | None:
    """Return what the contacts of a step do, None without any."""
    if step.problem is None:
        return None
    return contact_states(step.problem.layout, step.problem.layout.pad(step.impulses))


def _counts(states: States | None) -> dict[str, float]:
    """Return how many contacts do what, by the name of the curve."""
    counts = np.zeros(len(ContactState), dtype=np.int64) if states is None else count_states(states)
    return {f"contacts/{kind.name.lower()}": float(counts[kind]) for kind in ContactState}


def _colour_of(curve: str) -> tuple[int, int, int]:
    group, _, name = curve.rpartition("/")
    if group == "contacts":
        return rgb(STATE_COLOURS[ContactState[name.upper()]])
    if group == "energy":
        return rgb(PALETTE[(5, 1, 3)[ENERGIES.index(name)]])
    if group == COORDINATES:
        return rgb(PALETTE[sum(name.encode()) % len(PALETTE)])
    return rgb(PALETTE[1] if name == "sleeve" else PALETTE[5])


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
