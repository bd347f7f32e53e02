"""The command ``proxbench record``: recordings of iterating solvers and of stored simulations."""

from pathlib import Path
from typing import Annotated

import typer

from . import options


def record(
    problem: Annotated[
        str, typer.Argument(metavar="PROBLEM|FILE", help="Problem, problem file, or result of a simulation.")
    ],
    solver: options.Solvers = None,
    output: Annotated[
        Path | None, options.output(metavar="FILE", help="Recording to write (.rrd); required for solvers.")
    ] = None,
    plugin: options.PluginFiles = None,
    tolerance: Annotated[float, options.limits(metavar="NUMBER", help="Residual to reach.")] = 1e-8,
    max_iterations: Annotated[int, options.limits(metavar="NUMBER", help="Iteration limit of one solver.")] = 1000,
    solve_seconds: options.SolveSeconds = 60.0,
    still: Annotated[
        Path | None, options.output(metavar="FILE", help="Also draw the last frame as a picture (.png).")
    ] = None,
    film: Annotated[
        Path | None, options.output(metavar="FILE", help="Also draw the spatial views as an animation (.webp).")
    ] = None,
    frames: Annotated[int, options.output(metavar="NUMBER", min=2, help="Frames of the film, 20 per second.")] = 60,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Record the iterations of solvers on a problem, or a stored simulation.

    Open the recording with: rerun FILE
    """
    from ...problems.contact.solver import Stop
    from ..measure.plan import make_plan
    from ..plugins.problems import resolve_problem
    from ..recordings.blueprints import ITERATION, STEP, TIME
    from ..recordings.pictures import FILM_SUFFIX, STILL_SUFFIX, check_picture_path, write_film, write_still
    from ..recordings.solves import record_solves
    from ..report.layout.text import print_json
    from ..simulation.file import is_result
    from ..store.plans import RunSettings
    from .simulation.show import record_simulation

    is_simulation = problem.endswith(".npz") and is_result(Path(problem))
    _require_consistent_options(problem, is_simulation, solver, output)
    for picture, suffix in ((still, STILL_SUFFIX), (film, FILM_SUFFIX)):
        if picture is not None:
            check_picture_path(picture, suffix, force)
    file, recording = output or Path(problem).with_suffix(".rrd"), None
    if is_simulation:
        record_simulation(Path(problem), file, force)
    else:
        plan = make_plan([problem], solver, RunSettings.checked([tolerance]))
        stop = Stop(tolerance, max_iterations, solve_seconds)
        recording = record_solves(resolve_problem(plan.problems[0]), plan.solvers, stop, file, force)
    if still is not None:
        write_still(file, still, STEP if is_simulation else ITERATION)
    if film is not None:
        write_film(file, film, TIME if is_simulation else ITERATION, frames)
    pictures = {name: str(path) for name, path in (("still", still), ("film", film)) if path is not None}
    traces = () if recording is None else recording.traces
    if as_json:
        solves = {} if recording is None else {"solves": recording.summary()}
        print_json({"file": str(file), **solves, **pictures})
    else:
        for trace in () if quiet else traces:
            print(f"{trace.solver}: {trace.sentence}")
        print(f"open it with: rerun {file}")
        for name, path in pictures.items():
            print(f"{name}: {path}")
    return int(any(trace.has_failed for trace in traces))


def _require_consistent_options(
    problem: str, is_simulation: bool, solver: list[str] | None, output: Path | None
) -> None:
    """Raise ``BenchError`` if options of ``record`` contradict the recorded problem or simulation, or are missing."""
    from ..errors import BenchError

    if is_simulation:
        if solver:
            raise BenchError(f"{problem} is a stored simulation; omit --solver, or simulate with that solver.")
        return
    if problem.endswith(".bundle") or (Path(problem) / "run.json").is_file():
        raise BenchError(f"{problem} is a run; to record iterations during a run, use: proxbench run --record")
    missing = [option for option, value in (("--solver", solver), ("--output", output)) if not value]
    if missing:
        raise BenchError(f"recording solvers requires {' and '.join(missing)}; see proxbench record -h.")
