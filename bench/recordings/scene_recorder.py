"""Recordings of simulations: the timelines ``step`` and ``time``, the curves of all steps, and the drawings of scenes.

If the bodies of a scene are unknown, its coordinates are recorded.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.step import Step
from ..report.charts.palette import PALETTE, rgb
from .blueprints import STEP, TIME, plot, set_axis_range, simulation_blueprint
from .contact_states import STATE_COLOURS, ContactState, States, contact_states, count_states, write_state_colours
from .file import RecordingFile, write_curve

MIN_RESIDUAL = 1e-16
"""Lower bound of the values of logarithmic curves."""

BODIES, IMPULSES = "scene/bodies", "scene/impulses"
"""Entities of every simulation."""

NO_IMPULSES = rr.Arrows3D(vectors=np.zeros((0, 3)), origins=np.zeros((0, 3)))
"""Arrows of a step without impulses."""

MAX_COORDINATES = 12
"""Largest number of curves of a scene without named coordinates."""

COORDINATES = "coordinates"
"""Group of curves of the coordinates of a scene without known bodies."""

COLOURS = {
    **{f"contacts/{state.name.lower()}": colour for state, colour in STATE_COLOURS.items()},
    "energy/kinetic": PALETTE[5],
    "energy/potential": PALETTE[1],
    "energy/total": PALETTE[3],
    "angles/sleeve": PALETTE[1],
}
"""Colours of curves; other curves, except coordinates, have ``PALETTE[5]``."""

MIN_SPANS = {COORDINATES: 1e-6, "angles": 1e-6, "energy": 1e-9, "residual": 0.2, "step_size": 0.2}
"""Smallest span of the axis of a group of curves: 1 µm, 1 µrad, 1 nJ, and a fifth of a decade."""

MIN_OBSERVED = 1e-9
"""Smallest span of the axis of an observable, in its own unit; smaller variations are rounding errors."""

MIN_SPAN_RATIO = 1e-4
"""Smallest span of an axis relative to its largest value, so that constant curves do not show rounding errors."""

Entities = Iterable[tuple[str, rr.AsComponents]]
"""Entity paths with their components."""


class SceneRecorder:
    """Record a finished simulation: curves of all steps, and the bodies and impulses of some.

    Subclasses draw the bodies. A failed recording leaves no file behind, and does not change an existing file.

    Args:
        scene: the simulated scene.
        file: the recording, ending in ``.rrd``.
        force: replace an existing file.
        every: number of steps between drawn steps, which determines the playback speed.
    """

    def __init__(self, scene: Scene, file: Path, force: bool = False, every: int = 1) -> None:
        self.scene, self._file, self._force, self._every = scene, file, force, every
        self._observables = [observable for observable in scene.observables if observable.label]
        self._curves: dict[str, dict[int, float]] = {}
        self._exponents: dict[str, int] = {}
        self._last_state, self._step_number, self._step_seconds = scene.start, 0, scene.step_size

    @property
    def title(self) -> str:
        """Name of the recording in the viewer."""
        return self.scene.name

    def record(self, steps: NDArray[np.void], drawn: Iterable[tuple[int, Step]]) -> None:
        """Write the recording.

        Args:
            steps: one row per step: time, iterations, residual, kinetic_energy, potential_energy, observables.
            drawn: the steps to draw, in order, with their numbers from 1.

        Raises:
            BenchError: if the file exists, does not end in ``.rrd``, or cannot be written.
        """
        start = self.scene.start
        times = np.array([start.time, *steps["time"]])
        curves = step_curves(self.scene, steps, times)
        for observable in self._observables:
            self._exponents[observable.name] = exponent = (
                unit_exponent(curves[observable.name]) if has_unit(observable.label) else 0
            )
            curves[observable.name] = curves[observable.name] / 10.0**exponent
        self._curves = {name: dict(enumerate(values.tolist())) for name, values in curves.items()}
        plots = self._plots()
        with RecordingFile(self._file, self._force) as recording:
            blueprint = self._blueprint(plots)
            stream = recording.begin("simulation", self.title, blueprint)
            write_state_colours(stream, "scene")
            _log(stream, self._scenery(), static=True)
            self._draw_step(stream, 0, Step(start, None, np.zeros(0), None, None, 0))
            for number, step in drawn:
                self._step_number, self._step_seconds = number, float(times[number] - times[number - 1])
                self._draw_step(stream, number, step)
            about = rr.TextDocument(f"**{self.title}**\n\n{self._explanation()}", media_type="text/markdown")
            _log(stream, [("about", about), *self._summary()], static=True)
            for number, entities in self._final_entities():
                stream.set_time(STEP, sequence=number)
                stream.set_time(TIME, duration=float(times[number]))
                _log(stream, entities)
            self._write_curves(stream, times)
            if not any(self._values("contacts")):
                plots = [view for view in plots if view.origin != "/curves/contacts"]
            if self._widen_axes(plots):
                stream.send_blueprint(self._blueprint(plots), make_active=False)

    def _blueprint(self, plots: Sequence[rrb.TimeSeriesView]) -> rrb.Blueprint:
        return simulation_blueprint(self._views(), plots, self._every, self._is_stacked)

    def _explanation(self) -> str:
        """Return the explanation, in Markdown."""
        return "The bodies of this scene are not known; its coordinates are drawn over time."

    def _draw_step(self, stream: rr.RecordingStream, number: int, step: Step) -> None:
        """Draw a step, and store the curves of its contacts and its state."""
        states, counted_states = None, None
        if step.problem is not None:
            layout = step.problem.layout
            states = contact_states(layout, layout.pad(step.impulses))
            counted_states = states[~layout.is_bilateral]
        stream.set_time(STEP, sequence=number)
        stream.set_time(TIME, duration=step.state.time)
        _log(stream, self._bodies(step.state))
        _log(stream, self._impulses(step, states))
        self._last_state = step.state
        for name, value in (_counts(counted_states) | self._own_curves(step.state)).items():
            self._curves.setdefault(name, {})[number] = value

    def _write_curves(self, stream: rr.RecordingStream, times: FloatArray) -> None:
        for name, points in self._curves.items():
            step_numbers = [step for step, value in points.items() if not np.isnan(value)]
            columns = [rr.TimeColumn(STEP, sequence=step_numbers), rr.TimeColumn(TIME, duration=times[step_numbers])]
            label, colour = name.rpartition("/")[2], _colour_of(name)
            write_curve(
                stream, f"curves/{name}", columns, [points[step] for step in step_numbers], label=label, colour=colour
            )

    def _widen_axes(self, plots: Sequence[rrb.TimeSeriesView]) -> bool:
        """Widen the axes of constant curves, to avoid magnified rounding errors; return whether the layout changes."""
        has_changed = False
        spans = MIN_SPANS | {name: MIN_OBSERVED / 10.0**exponent for name, exponent in self._exponents.items()}
        for view in plots:
            group = str(view.origin).rpartition("/")[2]
            span = spans.get(group)  # counts have none
            if span is not None and (heights := axis_range(self._values(group), span)) is not None:
                set_axis_range(view, heights)
                has_changed = True
        return has_changed

    def _values(self, group: str) -> list[float]:
        """Return all known values of a group of curves."""
        curves = (points for name, points in self._curves.items() if name.partition("/")[0] == group)
        return [value for points in curves for value in points.values() if np.isfinite(value)]

    def _views(self) -> Sequence[rrb.Spatial3DView]:
        """Return the spatial views."""
        return ()

    @property
    def _is_stacked(self) -> bool:
        """Whether one spatial view is above the other."""
        return False

    def _plots(self) -> list[rrb.TimeSeriesView]:
        """Return the plots."""
        return [
            *(
                plot(
                    scaled_label(observable.label, self._exponents[observable.name]),
                    f"/curves/{observable.name}",
                    legend=False,
                )
                for observable in self._observables
            ),
            plot("active contacts", "/curves/contacts"),
            plot("solver iterations", "/curves/iterations", legend=False),
            plot("log₁₀ residual (judge)", "/curves/residual", legend=False),
            plot("energy [J]", "/curves/energy"),
        ]

    def _scenery(self) -> Entities:
        """Return the static entities."""
        return ()

    def _bodies(self, state: State) -> Entities:
        """Return the bodies; ``_last_state`` is the previously drawn state."""
        return ()

    def _impulses(self, step: Step, states: States | None) -> Entities:
        """Return the impulses of a step; ``states`` are the states of its contacts."""
        return ()

    def _own_curves(self, state: State) -> dict[str, float]:
        """Return additional curves."""
        return {}

    def _summary(self) -> Entities:
        """Return the static entities that are known only at the end."""
        return ()

    def _final_entities(self) -> Iterable[tuple[int, Entities]]:
        """Return the numbers of steps with those of their entities that are known only at the end."""
        return ()


def step_curves(scene: Scene, steps: NDArray[np.void], times: FloatArray) -> dict[str, FloatArray]:
    """Return the values of all steps by the name of the curve; NaN is not drawn.

    Args:
        scene: the simulated scene.
        steps: one row per step.
        times: the start and the ends of all steps [s], shape (n_steps + 1,).
    """
    start = scene.start
    kinetic = np.array([scene.kinetic_energy(start.velocity), *steps["kinetic_energy"]])
    energies = {"energy/kinetic": kinetic}
    if scene.potential_energy is not None:
        potential = np.array([scene.potential_energy(start.position), *steps["potential_energy"]])
        energies |= {"energy/potential": potential, "energy/total": kinetic + potential}
    return {
        "step_size": np.array([np.nan, *np.log10(np.diff(times))]),
        "iterations": np.array([0.0, *steps["iterations"]]),
        "residual": np.array([np.nan, *np.log10(np.maximum(steps["residual"], MIN_RESIDUAL))]),
        **energies,
        **{
            observable.name: np.array([observable.compute(start), *steps[observable.name]])
            for observable in scene.observables
            if observable.label
        },
    }


def unit_exponent(values: FloatArray) -> int:
    """Return the exponent, a multiple of 3, of the unit in which values below 1e-3 are drawn; 0 for larger values.

    Values below ``MIN_OBSERVED`` are zero up to rounding, and are drawn in the unit of ``MIN_OBSERVED``.
    """
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=MIN_OBSERVED))
    return 3 * math.floor(math.log10(largest) / 3.0) if largest < 1e-3 else 0


def has_unit(label: str) -> bool:
    """Return whether a label ends with a unit in brackets."""
    return label.endswith("]")


def scaled_label(label: str, exponent: int) -> str:
    """Return a label whose unit, in brackets, is multiplied by a power of ten."""
    if not exponent or not has_unit(label):
        return label
    power = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return label.replace("[", f"[10{power} ")


def axis_range(values: Sequence[float], smallest_span: float) -> tuple[float, float] | None:
    """Return the range of the axis for nearly constant values; None if their range suffices, or without values."""
    if not values:
        return None
    low, high = min(values), max(values)
    span = max(smallest_span, MIN_SPAN_RATIO * max(abs(low), abs(high)))
    middle = round((low + high) / 2.0 / span) * span
    return (middle - span, middle + span) if high - low < span else None


def step_size_plot() -> rrb.TimeSeriesView:
    """Return the plot of the step size, for scenes with variable steps."""
    return plot("log₁₀ step size [s]", "/curves/step_size", legend=False)


def arrows(
    vectors: FloatArray, points: FloatArray, states: States, lengths: FloatArray | float, reference: float
) -> rr.Arrows3D:
    """Return impulses as arrows at the contacts, with lengths that grow with the square root of the impulses.

    Args:
        vectors: Λ in space [N s], shape (n, 3).
        points: positions of the contacts [m], shape (n, 3).
        states: states of the contacts, shape (n,).
        lengths: lengths of the arrow of an impulse ``reference`` [m], a number or shape (n,).
        reference: reference impulse [N s].
    """
    size = np.linalg.norm(vectors, axis=1)
    stretch = lengths * np.sqrt(size / reference) / np.maximum(size, 1e-300)
    return rr.Arrows3D(vectors=vectors * stretch[:, None], origins=points, class_ids=states)


def _log(stream: rr.RecordingStream, entities: Entities, static: bool = False) -> None:
    for path, shape in entities:
        stream.log(path, shape, static=static)


def _counts(states: States | None) -> dict[str, float]:
    """Return the number of contacts in each state, by the name of the curve."""
    counts = [0] * len(ContactState) if states is None else count_states(states)
    return {f"contacts/{state.name.lower()}": float(counts[state]) for state in ContactState}


def _colour_of(curve: str) -> tuple[int, int, int]:
    group, _, name = curve.rpartition("/")
    if group == COORDINATES:
        return rgb(PALETTE[sum(name.encode()) % len(PALETTE)])
    return rgb(COLOURS.get(curve, PALETTE[5]))


class CoordinateRecorder(SceneRecorder):
    """Record the coordinates of a scene; see ``SceneRecorder``."""

    @property
    def _coordinate_indices(self) -> Mapping[str, int]:
        count = min(len(self.scene.start.position), MAX_COORDINATES)
        return self.scene.coordinates or {f"q{index}": index for index in range(count)}

    def _plots(self) -> list[rrb.TimeSeriesView]:
        return [plot("coordinates", f"/curves/{COORDINATES}"), *super()._plots(), step_size_plot()]

    def _own_curves(self, state: State) -> dict[str, float]:
        return {
            f"{COORDINATES}/{name}": float(state.position[index]) for name, index in self._coordinate_indices.items()
        }
