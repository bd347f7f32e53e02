"""What recordings of all simulations share: the timelines ``step`` and ``time``, and the curves of the steps.

A scene whose bodies cannot be drawn is recorded by its coordinates.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ...problems.arrays import FloatArray
from ...problems.contact.residual import Residual
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.step import Step
from ..errors import BenchError
from ..report.charts.palette import PALETTE, rgb
from .blueprints import STEP, TIME, plot, set_heights, simulation_blueprint
from .contact_states import STATE_COLOURS, ContactState, States, contact_states, count_states, write_state_colours
from .file import RecordingFile, write_curve

SMALLEST = 1e-16
"""Residuals below are drawn here: the curve is a logarithm."""

BODIES, IMPULSES = "scene/bodies", "scene/impulses"
"""Entities of every simulation."""

NO_IMPULSES = rr.Arrows3D(vectors=np.zeros((0, 3)), origins=np.zeros((0, 3)))

MOST_COORDINATES = 12
"""Coordinates that are drawn, the first ones of scenes that name none."""

COORDINATES = "coordinates"
"""The group of curves of coordinates that have no body to be drawn on."""

COLOURS = {
    **{f"contacts/{state.name.lower()}": colour for state, colour in STATE_COLOURS.items()},
    "energy/kinetic": PALETTE[5],
    "energy/potential": PALETTE[1],
    "energy/total": PALETTE[3],
    "angles/sleeve": PALETTE[1],
}
"""Of curves; others have ``PALETTE[5]``."""

SMALLEST_SPANS = {COORDINATES: 1e-6, "angles": 1e-6, "energy": 1e-9, "residual": 0.2, "step_size": 0.2}
"""Least span of the axis of a group of curves: 1 µm, 1 µrad, 1 nJ, and a fifth of a decade of logarithms."""

SMALLEST_RATIO = 1e-6
"""Least span of an axis over its largest value: what varies less is drawn as a level line, not as its rounding."""

Entities = Iterable[tuple[str, rr.AsComponents]]
"""What is logged, and where."""


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
        self._curves: dict[str, dict[int, float]] = {}
        self._stream: rr.RecordingStream | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with self._recording:
            if self._stream is not None:
                self._log(self._summary(), static=True)
                self._write_curves(self._stream)
                self._frame_curves(self._stream)

    def start(self, state: State) -> None:
        """Draw the state before the first step."""
        blueprint = simulation_blueprint(self._views(state), self._plots(), self._every)
        self._stream = self._recording.begin("simulation", self._title, blueprint)
        self._first = self._last = state
        self._times = [state.time]
        write_state_colours(self._stream, "scene")
        about = rr.TextDocument(self._about, media_type="text/markdown")
        self._log([("about", about), *self._scenery(state)], static=True)
        self._draw(state)
        self._note({"iterations": 0.0} | self._energy_curves(state) | _counts(None) | self._own_curves(state))

    def __call__(self, step: Step) -> None:
        """Record one step.

        Raises:
            BenchError: if the recorder was not started.
        """
        self._started()
        self._count += 1
        self._times.append(step.state.time)
        values = {
            "step_size": np.log10(step.state.time - self._last.time),
            "iterations": float(step.iterations),
            "residual": np.log10(max(_residual(step), SMALLEST)),
        }
        self._note(values | self._energy_curves(step.state))
        self._take(step, is_drawn=self._count % self._every == 0)

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
        self._started()
        self._times = times.tolist()
        self._curves |= {name: dict(enumerate(values.tolist())) for name, values in curves.items()}
        for number, step in drawn:
            self._count = number
            self._take(step)

    def _started(self) -> rr.RecordingStream:
        if self._stream is None:
            raise BenchError("the recorder was not started; call its start with the state before the first step.")
        return self._stream

    def _take(self, step: Step, is_drawn: bool = True) -> None:
        """Draw a step, or only follow it, and note what is known of its contacts and its state."""
        states = None
        if step.problem is not None:
            states = contact_states(step.problem.layout, step.problem.layout.pad(step.impulses))
        self._follow(step)
        if is_drawn:
            self._draw(step.state)
            self._log(self._impulses(step, states))
        self._last = step.state
        self._note(_counts(states) | self._own_curves(step.state))

    def _draw(self, state: State) -> None:
        self._started().set_time(STEP, sequence=self._count)
        self._started().set_time(TIME, duration=state.time)
        self._log(self._bodies(state))

    def _log(self, entities: Entities, static: bool = False) -> None:
        for path, shape in entities:
            self._started().log(path, shape, static=static)

    def _note(self, values: Mapping[str, float]) -> None:
        """Keep points of curves at the step that was taken last."""
        for name, value in values.items():
            self._curves.setdefault(name, {})[self._count] = value

    def _energy_curves(self, state: State) -> dict[str, float]:
        kinetic, potential = self._energies(state)
        if potential is None:
            return {"energy/kinetic": kinetic}
        return {"energy/kinetic": kinetic, "energy/potential": potential, "energy/total": kinetic + potential}

    def _write_curves(self, stream: rr.RecordingStream) -> None:
        times = np.array(self._times)
        for name, points in self._curves.items():
            kept = [step for step, value in points.items() if not np.isnan(value)]
            at = [rr.TimeColumn(STEP, sequence=kept), rr.TimeColumn(TIME, duration=times[kept])]
            label, colour = name.rpartition("/")[2], _colour_of(name)
            write_curve(stream, f"curves/{name}", label, colour, at, [points[step] for step in kept])

    def _frame_curves(self, stream: rr.RecordingStream) -> None:
        """Widen the axes of level curves, over which the viewer spreads rounding, with labels of 16 digits."""
        plots, is_framed = self._plots(), False
        for view in plots:
            group = str(view.origin).rpartition("/")[2]
            span = SMALLEST_SPANS.get(group)  # counts have none
            if span is not None and (heights := heights_of(self._values(group), span)) is not None:
                set_heights(view, heights)
                is_framed = True
        if is_framed:
            blueprint = simulation_blueprint(self._views(self._first), plots, self._every)
            stream.send_blueprint(blueprint, make_active=False)

    def _values(self, group: str) -> list[float]:
        """Return all values of a group of curves that are known."""
        curves = (points for name, points in self._curves.items() if name.partition("/")[0] == group)
        return [value for points in curves for value in points.values() if np.isfinite(value)]

    def _views(self, state: State) -> Sequence[rrb.Spatial3DView]:
        """Return the views in space."""
        return ()

    def _plots(self) -> list[rrb.TimeSeriesView]:
        """Return the plots beside them."""
        return [
            plot("active contacts", "/curves/contacts"),
            plot("solver iterations", "/curves/iterations", legend=False),
            plot("log₁₀ residual (judge)", "/curves/residual", legend=False),
            plot("energy [J]", "/curves/energy"),
        ]

    def _scenery(self, state: State) -> Entities:
        """Return what does not change, given the first state."""
        return ()

    def _follow(self, step: Step) -> None:  # noqa: B027 - few recordings look at all steps
        """Take in a step that may not be drawn."""

    def _bodies(self, state: State) -> Entities:
        """Return the bodies."""
        return ()

    def _impulses(self, step: Step, states: States | None) -> Entities:
        """Return the impulses of a step, whose contacts are in ``states``."""
        return ()

    @abstractmethod
    def _energies(self, state: State) -> tuple[float, float | None]:
        """Return kinetic and potential energy [J], None for one that is not known."""

    def _own_curves(self, state: State) -> dict[str, float]:
        """Return further curves."""
        return {}

    def _summary(self) -> Entities:
        """Return what is known only at the end."""
        return ()


def heights_of(values: Sequence[float], smallest_span: float) -> tuple[float, float] | None:
    """Return between what to plot values that hardly vary; None where they need no more than what they span."""
    if not values:
        return None
    low, high = min(values), max(values)
    span = max(smallest_span, SMALLEST_RATIO * max(abs(low), abs(high)))
    middle = round((low + high) / 2.0 / span) * span
    return (middle - span, middle + span) if high - low < span else None


def step_size_plot() -> rrb.TimeSeriesView:
    """Return the plot of the step size, for scenes that variable steps go through."""
    return plot("log₁₀ step size [s]", "/curves/step_size", legend=False)


def arrows(
    vectors: FloatArray, points: FloatArray, states: States, lengths: FloatArray | float, reference: float
) -> rr.Arrows3D:
    """Return impulses as arrows at the contacts, which grow with their root.

    Args:
        vectors: Λ in space [N s], shape (n, 3).
        points: of the contacts [m], shape (n, 3).
        states: of the contacts, shape (n,).
        lengths: of the arrow of an impulse ``reference`` [m], one or shape (n,).
        reference: [N s].
    """
    size = np.linalg.norm(vectors, axis=1)
    stretch = lengths * np.sqrt(size / reference) / np.maximum(size, 1e-300)
    return rr.Arrows3D(vectors=vectors * stretch[:, None], origins=points, class_ids=states)


def _residual(step: Step) -> float:
    """Return the judge's residual of one step, 0 if no contact was active."""
    if step.problem is None:
        return 0.0
    return Residual(step.problem).judged(step.problem, step.impulses)


def _counts(states: States | None) -> dict[str, float]:
    """Return how many contacts do what, by the name of the curve."""
    counts = [0] * len(ContactState) if states is None else count_states(states)
    return {f"contacts/{state.name.lower()}": float(counts[state]) for state in ContactState}


def _colour_of(curve: str) -> tuple[int, int, int]:
    group, _, name = curve.rpartition("/")
    if group == COORDINATES:
        return rgb(PALETTE[sum(name.encode()) % len(PALETTE)])
    return rgb(COLOURS.get(curve, PALETTE[5]))


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

    def _plots(self) -> list[rrb.TimeSeriesView]:
        return [plot("coordinates", f"/curves/{COORDINATES}"), *super()._plots(), step_size_plot()]

    def _energies(self, state: State) -> tuple[float, float | None]:
        known = self._scene.potential_energy
        return self._scene.kinetic_energy(state.velocity), None if known is None else known(state.position)

    def _own_curves(self, state: State) -> dict[str, float]:
        return {f"{COORDINATES}/{name}": float(state.position[index]) for name, index in self._names.items()}
