"""Recordings of solves: several solvers side by side on one problem, or on each problem of a stored run."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Solver, Stop
from ...problems.representation import counted
from ..errors import BenchError
from ..plugins.descriptions import solver_spec
from ..plugins.problems import problem_of_run
from ..plugins.remote_solver import open_solver
from ..plugins.solver_specs import SolverSpec
from ..report.charts.palette import on_dark, rgb, solver_style
from ..store.bundles.bundle import open_run, output_folder
from ..store.outcome import Outcome
from ..store.store import check_links_inside, plain_name
from .blueprints import BODIES, ITERATION, Camera, solves_blueprint
from .contact_points import Bodies, ContactPoints, find_contact_points
from .contact_states import STATE_COLOURS, ContactState, contact_states, write_state_colours
from .file import SUFFIX, RecordingFile, write_curve
from .scene_recorder import MIN_RESIDUAL
from .traces import Trace, trace_solve

MAX_GROWTH = 1e2
"""Bound of the curves of diverging solvers, relative to the largest initial value of any solver."""

FIRST_POINTS = {"residual": 0, "complementarity": 1, "step_change": 1}
"""Index of the first point of each curve; at Λ = 0 only the residual is meaningful."""

ARROW_SIZES = 3.0
"""Length of the arrow, in body sizes, for the 90 % quantile of the impulses of closed contacts."""

NO_ARROWS = "No arrow is drawn, because no last iterate is finite and nonzero."
"""Sentence in place of the scale of arrows if there are none."""

MAX_ARROW_LENGTH = 3.0
"""Bound of arrow lengths relative to ``ARROW_SIZES``, so that diverging solvers do not hide others."""

GLASS = (150, 170, 200, 60)
"""Colour of balls, transparent to show the impulses between them."""

LINES = (150, 170, 200)
"""Colour of bodies that are not balls."""

TOLERANCE = 1e-8
"""Tolerance of solves recorded from a run; most solvers need too many iterations for its finest tolerance."""

MAX_ITERATIONS = 1000
"""Iteration limit of solves recorded from a run."""

FOLDER = "recordings"
"""Name of the folder of recordings in the folder of a run."""


@dataclass(frozen=True)
class RecordedSolves:
    """A finished recording of solves.

    Attributes:
        file: path of the recording.
        traces: traces of the solvers, in the given order.
        contact_points: positions of the contacts.
    """

    file: Path
    traces: tuple[Trace, ...]
    contact_points: ContactPoints

    def summary(self) -> list[dict[str, Any]]:
        """Return solver, iterations, residual and ending of each solve; None for missing and infinite values."""
        return [
            {
                "solver": trace.solver,
                "iterations": trace.iterations[-1] if trace.iterations else None,
                "residual": trace.residual[-1] if np.isfinite(trace.residual[-1:]).any() else None,
                "ended": trace.ending,
            }
            for trace in self.traces
        ]


def record_solves(
    problem: ContactProblem,
    solvers: Sequence[str | Solver | SolverSpec],
    stop: Stop,
    file: Path,
    force: bool = False,
    *,
    contact_points: ContactPoints | None = None,
) -> RecordedSolves:
    """Solve ``problem`` with each solver from zero, and write the iterations as a recording.

    Curves contain the first thousand iterations, and arrows the first twenty. Both continue with a geometric sequence
    of iterations and the last one. If a solver raises an exception, or does not support the problem, the recording and
    its trace report this; the remaining solvers are still recorded.

    Args:
        problem: the contact problem.
        solvers: one or more solvers, or their names.
        stop: stop criterion of each solve; observing does not count towards its time limit.
        file: the recording, ending in ``.rrd``.
        force: replace an existing file.
        contact_points: positions of the contacts; computed by ``find_contact_points`` if None.

    Raises:
        BenchError: before solving, if there are no solvers or contacts, ``contact_points`` have another number of
            contacts, or the file exists (without ``force``), does not end in ``.rrd``, or cannot be written.
    """
    if not solvers:
        raise BenchError("name at least one solver to record.")
    if not problem.n_contacts:
        raise BenchError(f"the problem {problem.name!r} has no contacts; record another problem.")
    found_points = contact_points if contact_points is not None else find_contact_points(problem)
    if len(found_points.positions) != problem.n_contacts:
        raise BenchError(
            f"there are {len(found_points.positions)} contact points, but the problem {problem.name!r} has "
            f"{problem.n_contacts}."
        )
    specs = [solver_spec(solver) for solver in solvers]
    traces: list[Trace] = []
    with RecordingFile(file, force) as recording:
        for solver in specs:
            with open_solver(solver, stop.max_seconds) as opened_solver:
                traces.append(trace_solve(problem, opened_solver, stop))
        longest = max((trace.iterations[-1] for trace in traces if trace.iterations), default=0)
        ceilings = _ceilings(traces)
        names, heights = [trace.solver for trace in traces], _residual_heights(traces, ceilings["residual"])
        blueprint = solves_blueprint(names, longest, _camera(found_points), heights)
        stream = recording.begin("solve", f"{problem.name}: {', '.join(names)}", blueprint)
        reference = _reference_impulse(traces)
        if found_points.bodies is not None:
            _write_bodies(stream, found_points.bodies, found_points.size)
        scale = ARROW_SIZES * found_points.size / reference if reference else 0.0
        for index, trace in enumerate(traces):
            _write_curves(stream, trace, index, ceilings)
            _write_contacts(stream, problem, found_points, trace, index, scale)
        about = _about(problem, found_points, traces, reference)
        stream.log("about", rr.TextDocument(about, media_type="text/markdown"), static=True)
    return RecordedSolves(file, tuple(traces), found_points)


def record_run(run_dir: PathLike[str] | str) -> list[RecordedSolves]:
    """Solve the problems of a run again, with observed iterates, and write recordings into its folder.

    Cases that timed out, crashed or misbehaved in the run are omitted. Recordings of an earlier call are replaced.

    Raises:
        BenchError: if the folder is not a run, cannot be written, or its folder of recordings links to a place outside.
        SolverError: for a solver object that cannot be created from its name.
        ProblemError: for a damaged problem of the run.
    """
    store, folder = open_run(Path(run_dir)), output_folder(Path(run_dir))
    run = store.read_run()
    cases, _ = store.read_cases()
    measured_cases = {(case.problem, case.solver) for case in cases if case.outcome is Outcome.MEASURED}
    check_links_inside(folder / FOLDER, folder)
    stop = Stop(TOLERANCE, MAX_ITERATIONS, run.plan.limits.solve_seconds)
    recordings = []
    for name in run.plan.problems:
        solvers = [solver for solver in run.plan.solvers if (name, solver) in measured_cases]
        if solvers and (problem := problem_of_run(store, run, name)).n_contacts:
            file = folder / FOLDER / f"{plain_name(name)}{SUFFIX}"
            recordings.append(record_solves(problem, solvers, stop, file, force=True))
    return recordings


def _write_curves(stream: rr.RecordingStream, trace: Trace, index: int, ceilings: dict[str, float]) -> None:
    """Write residual, complementarity and step change of one solver, and the states of its contacts."""
    if not trace.iterations:
        return
    colour = on_dark(solver_style(index).colour)
    for name, first in FIRST_POINTS.items():
        iterations = [rr.TimeColumn(ITERATION, sequence=trace.iterations[first:])]
        values = np.asarray(getattr(trace, name)[first:])
        clipped = np.clip(np.where(np.isnan(values), np.inf, values), MIN_RESIDUAL, ceilings[name])
        write_curve(stream, f"curves/{name}/{index}", iterations, np.log10(clipped), label=trace.solver, colour=colour)
    iterations = [rr.TimeColumn(ITERATION, sequence=trace.iterations)]
    counts = np.asarray(trace.state_counts, dtype=np.float64)
    for state in ContactState:
        name = state.name.lower()
        write_curve(
            stream, f"states/{index}/{name}", iterations, counts[:, state], label=name, colour=rgb(STATE_COLOURS[state])
        )


def _ceilings(traces: Sequence[Trace]) -> dict[str, float]:
    """Return the upper bound of each curve."""
    ceilings = {}
    for name, first in FIRST_POINTS.items():
        first_values = [value for trace in traces for value in getattr(trace, name)[first : first + 2]]
        largest = max((value for value in first_values if np.isfinite(value)), default=1.0)
        ceilings[name] = max(MAX_GROWTH * largest, MIN_RESIDUAL)
    return ceilings


def _residual_heights(traces: Sequence[Trace], ceiling: float) -> tuple[float, float] | None:
    """Return the range of log₁₀ residuals, with room above for a legend; None if no residual is finite."""
    residuals = [value for trace in traces for value in trace.residual if np.isfinite(value)]
    if not residuals:
        return None
    low, high = np.log10(np.clip([min(residuals), max(residuals)], MIN_RESIDUAL, ceiling))
    span = max(float(high - low), 1.0)
    return float(low) - 0.05 * span, float(high) + (0.15 + 0.12 * len(traces)) * span


def _write_contacts(
    stream: rr.RecordingStream,
    problem: ContactProblem,
    contact_points: ContactPoints,
    trace: Trace,
    index: int,
    scale: float,
) -> None:
    """Write one solver's contacts as dots and impulses as arrows, coloured by state."""
    root = f"solvers/{index}"
    write_state_colours(stream, root)
    if not trace.shown:
        return
    origins, dot, shaft = contact_points.positions, 0.14 * contact_points.size, 0.09 * contact_points.size
    dots = rr.Points3D.from_fields(positions=origins, radii=[dot], show_labels=False)
    stream.log(f"{root}/contacts", dots, static=True)
    shafts = rr.Arrows3D.from_fields(origins=origins, radii=[shaft], show_labels=False)
    stream.log(f"{root}/impulses", shafts, static=True)
    states = np.stack([contact_states(problem.layout, lanes) for lanes in trace.impulses])
    arrows = np.stack([_arrows(contact_points, lanes, scale) for lanes in trace.impulses])
    iterations = [rr.TimeColumn(ITERATION, sequence=trace.shown)]
    lengths = [problem.n_contacts] * len(trace.shown)
    dot_columns = rr.Points3D.columns(class_ids=states.ravel()).partition(lengths)
    stream.send_columns(f"{root}/contacts", iterations, dot_columns)
    arrow_columns = rr.Arrows3D.columns(vectors=arrows.reshape(-1, 3), class_ids=states.ravel()).partition(lengths)
    stream.send_columns(f"{root}/impulses", iterations, arrow_columns)


def _write_bodies(stream: rr.RecordingStream, bodies: Bodies, size: float) -> None:
    """Write balls as translucent spheres, other bodies as dots, scaled by ``size`` [m], joined to their contacts."""
    balls = bodies.is_ball
    if balls.any():
        shape = rr.Ellipsoids3D(
            centers=bodies.centres[balls],
            half_sizes=np.repeat(bodies.radii[balls], 3).reshape(-1, 3),
            colors=[GLASS],
            fill_mode=rr.components.FillMode.Solid,
            show_labels=False,
        )
        stream.log(f"{BODIES}/balls", shape, static=True)
    if not balls.all():
        centres = rr.Points3D(bodies.centres[~balls], radii=[0.2 * size], colors=[LINES])
        stream.log(f"{BODIES}/centres", centres, static=True)
        arms = rr.LineStrips3D(bodies.arms.astype(np.float32), radii=[0.03 * size], colors=[LINES])
        stream.log(f"{BODIES}/arms", arms, static=True)


def _arrows(contact_points: ContactPoints, lanes: FloatArray, scale: float) -> FloatArray:
    """Return arrows [m], shape (n_contacts, 3), limited by ``MAX_ARROW_LENGTH``; zero for infinite and NaN values."""
    vectors = scale * contact_points.vectors(np.where(np.isfinite(lanes), np.clip(lanes, -1e100, 1e100), 0.0))
    lengths = np.linalg.norm(vectors, axis=1)
    longest = MAX_ARROW_LENGTH * ARROW_SIZES * contact_points.size
    limited: FloatArray = vectors * (longest / np.maximum(lengths, longest))[:, None]
    return limited


def _reference_impulse(traces: Sequence[Trace]) -> float:
    """Return the 90 % quantile of the impulses [N s] of the most accurate last iterate that is not zero, or 0."""
    with np.errstate(over="ignore"):  # diverging impulses may be too large to be squared
        last = [(trace.residual[-1], np.linalg.norm(trace.impulses[-1], axis=1)) for trace in traces if trace.impulses]
    candidates = [(residual, lengths) for residual, lengths in last if np.isfinite(lengths).all() and lengths.any()]
    if not candidates:
        return 0.0
    _, lengths = min(candidates, key=lambda candidate: candidate[0])
    return float(np.quantile(lengths[lengths > 0], 0.9))


def _camera(contact_points: ContactPoints) -> Camera:
    """Return a camera that shows most contacts, with room for arrows; distant outliers are ignored."""
    low, high = np.quantile(contact_points.positions, (0.03, 0.97), axis=0)
    distance = 0.85 * float(np.linalg.norm(high - low)) + 8.0 * contact_points.size
    return Camera.around(low, high, distance, (0.0, -0.93, 0.37))


def _about(problem: ContactProblem, contact_points: ContactPoints, traces: Sequence[Trace], reference: float) -> str:
    """Return the explanation beside the curves, in Markdown."""
    scale = f"An arrow as long as {ARROW_SIZES:g} bodies is {reference:.2g} N s." if reference else NO_ARROWS
    lines = [
        f"**{problem.name}**: {counted(problem.n_contacts, 'contact')}, {counted(problem.n_rows, 'row')}.",
        "",
        "Arrows are the impulses of the iterate; **teal** contacts stick, **orange** ones slip, **grey** ones are open."
        f" {scale}",
        "",
    ]
    for trace in traces:
        relaxed = "" if trace.model == "coulomb" else f" ({trace.model} model)"
        lines.append(f"* **{trace.solver}**{relaxed}: {trace.sentence}")
    return "\n".join([*lines, "", contact_points.origin, ""])
