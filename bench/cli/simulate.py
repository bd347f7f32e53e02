"""The command ``proxbench simulate``."""

from pathlib import Path
from typing import Annotated, Any

import typer

from .options import PluginFiles

_NUMBER = "[default: of the scene]"

_EFFECTS = ("gravity", "friction", "restitution", "projection")
"""Effects that are on by default, each with a --no-… beside it."""

_OPTIONS = (
    "balls",
    "outlet",
    "seed",
    "gravity",
    "friction",
    "restitution",
    "tangential_restitution",
    "drag",
    "spring",
    "projection",
    "start",
)
"""Options of scenes that the command line passes on under their own name."""

_NUMBERS = ("step_size", "stepper", "solver", "tolerance", "max_iterations", "states")


def simulate(
    context: typer.Context,
    scene: Annotated[str, typer.Argument(help="funnel, pile or woodpecker; with --resume it may be left out.")] = "",
    step_size: Annotated[float | None, typer.Option(help=f"Time step [s]. {_NUMBER}")] = None,
    stepper: Annotated[
        str | None, typer.Option(help="Moreau (fixed step), Extrapolated(tolerance=1e-8) or StepDoubling. " + _NUMBER)
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Simulated time [s]; with --resume, a longer one.")] = None,
    solver: Annotated[str | None, typer.Option(help="Solver with options, SORprox(relaxation=1.5).")] = None,
    tolerance: Annotated[float | None, typer.Option(help="Judged residual that each step shall reach.")] = None,
    max_iterations: Annotated[int | None, typer.Option(help="Iterations of the solver in one step.")] = None,
    states: Annotated[
        int | None, typer.Option(help="States that are kept, evenly over time, at least; twice as many at most.")
    ] = None,
    balls: Annotated[int | None, typer.Option(help="Number of balls.")] = None,
    outlet: Annotated[float | None, typer.Option(help="Radius of the outlet in ball radii; 0 closes it.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the jitter of the start.")] = None,
    gravity: Annotated[float | None, typer.Option(help="Acceleration of weight [m/s²].")] = None,
    no_gravity: Annotated[bool, typer.Option("--no-gravity", help="Leave weight out.")] = False,
    friction: Annotated[float | None, typer.Option(help="Friction coefficient.")] = None,
    no_friction: Annotated[bool, typer.Option("--no-friction", help="Leave friction and rotation out.")] = False,
    restitution: Annotated[float | None, typer.Option(help="Normal restitution, 0 to 1.")] = None,
    no_restitution: Annotated[bool, typer.Option("--no-restitution", help="Leave normal restitution out.")] = False,
    tangential_restitution: Annotated[float | None, typer.Option(help="Tangential restitution, 0 to 1.")] = None,
    drag: Annotated[float | None, typer.Option(help="Add linear drag on each centre [kg/s].")] = None,
    spring: Annotated[float | None, typer.Option(help="Add springs to the middle of the cone's top [N/m].")] = None,
    projection: Annotated[float | None, typer.Option(help="Penetration that may last, in ball radii.")] = None,
    no_projection: Annotated[bool, typer.Option("--no-projection", help="Let penetrations last.")] = False,
    planar: Annotated[bool, typer.Option("--planar", help="Discs in a vertical plane instead of balls.")] = False,
    start: Annotated[str | None, typer.Option(help="Start of the woodpecker: published or cycle.")] = None,
    output: Annotated[Path, typer.Option(help="Result file (.npz), or the folder for it.")] = Path("results"),
    force: Annotated[bool, typer.Option("--force", help="Replace results, recordings and charts that exist.")] = False,
    resume: Annotated[Path | None, typer.Option(help="Result file to go on with.")] = None,
    record: Annotated[
        Path | None, typer.Option(help="Recording to write, ending in .rrd: watch it with rerun.")
    ] = None,
    chart: Annotated[Path | None, typer.Option(help="Chart to write, as CHART.svg and CHART.png.")] = None,
    study: Annotated[
        bool, typer.Option("--study", help="Measure what accuracy costs, over steps, tolerances and solvers.")
    ] = False,
    plugin: PluginFiles = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document, nothing else.")] = False,
    progress: Annotated[bool, typer.Option(help="Show a live summary.")] = True,
) -> int:
    """Simulate a scene step by step; print a table per 0.1 s, or of the switching points where the step is variable.

    Every step is stored in a file that can be resumed.
    """
    from ..variable.command import run_variable, wants_variable
    from .fixed import run_fixed
    from .request import Request
    from .study import run_study_command, wants_study

    options, numbers = _chosen(context.params)
    _refuse_contradictions(context)
    request = Request(scene, options, numbers, duration, output, force, resume, record, chart)
    if wants_study(study, resume):
        return run_study_command(request, as_json, progress)
    if wants_variable(scene, numbers, resume):
        return run_variable(request, as_json, progress)
    return run_fixed(request, as_json, progress)


def _chosen(given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the options of the scene and the numbers of the plan that were asked for; None switches off."""
    from ..errors import BenchError

    options = {name: given[name] for name in _OPTIONS if given[name] is not None}
    for name in _EFFECTS:
        if given[f"no_{name}"]:
            if name in options:
                raise BenchError(f"--{name} and --no-{name} exclude each other; give one of them.")
            options[name] = None
    if given["planar"]:
        options["planar"] = True
    return options, {name: given[name] for name in _NUMBERS if given[name] is not None}


def _refuse_contradictions(context: typer.Context) -> None:
    from ...problems.scenes.registry import SCENES
    from ..errors import BenchError

    given = context.params
    if given["resume"] is None:
        if not given["scene"]:
            raise BenchError(f"name a scene ({', '.join(SCENES)}), or a result file to go on with: --resume FILE.")
        return
    writes_more = given["record"] is not None or given["chart"] is not None  # which --force may replace
    for name in ("output",) if writes_more else ("output", "force"):
        if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE":
            raise BenchError(f"--{name} makes no sense with --resume, which goes on in its own file; leave it out.")
