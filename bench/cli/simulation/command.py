"""The command ``proxbench simulate``."""

from functools import partial
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from .. import options
from ..report import report_run

_PLAN_ARGUMENTS = ("stepper", "tolerance", "max_iterations", "start", "states", "step_seconds")
"""Options that are arguments of ``make_simulation_plan`` under the same name."""

_LIMITS = ("solve_seconds", "case_seconds")
"""Options that apply only to a study."""

_NOT_IN_A_STUDY = {*_PLAN_ARGUMENTS, "recording", "chart", "force"} - {"start"}
"""Options that apply only to a single simulation."""

_STORED = ("scene", "solver", "duration", "start", *_LIMITS)
"""Parameters that are stored with a study."""

_method = partial(typer.Option, rich_help_panel="Method")


def simulate(
    context: typer.Context,
    scene: Annotated[
        str, typer.Argument(metavar="SCENE", help='Like "funnel(balls=300)"; not needed with --resume.')
    ] = "",
    duration: Annotated[float | None, _method(metavar="SECONDS", help="Simulated time.")] = None,
    stepper: Annotated[str | None, _method(metavar="STEPPER", help='Like "Moreau(step=5e-4)" or Extrapolated.')] = None,
    solver: Annotated[
        list[str] | None,
        _method(metavar="SOLVER", help='Like "SORprox(relaxation=1.5)"; repeatable in a study.'),
    ] = None,
    tolerance: Annotated[float | None, _method(metavar="NUMBER", help="Judged residual to reach in each step.")] = None,
    max_iterations: Annotated[
        int | None, _method(metavar="NUMBER", help="Iteration limit of the solver in one step.")
    ] = None,
    start: Annotated[
        str | None, _method(metavar="START", help="Initial impulses of a step: warm, cold, warm-then-cold or scaled.")
    ] = None,
    step_seconds: Annotated[
        float | None, _method(metavar="SECONDS", help="Time limit of one request to a plugin.")
    ] = None,
    study: Annotated[
        bool, _method("--study", metavar="", show_default=False, help="Measure what accuracy costs.")
    ] = False,
    solve_seconds: Annotated[
        float | None, options.limits(metavar="SECONDS", help="Time limit of one simulation of a study.")
    ] = None,
    case_seconds: Annotated[
        float | None, options.limits(metavar="SECONDS", help="Time limit of one curve of a study.")
    ] = None,
    plugin: options.PluginFiles = None,
    resume: Annotated[Path | None, options.output(metavar="RESULT", help="Resume this result file or study.")] = None,
    output: Annotated[
        Path, options.output(metavar="FILE", help="Result file (.npz), or folder for it or for a study.")
    ] = Path("results"),
    states: Annotated[
        int | None, options.output(metavar="NUMBER", help="Minimum number of stored states; at most twice as many.")
    ] = None,
    recording: Annotated[Path | None, options.output(metavar="FILE", help="Recording to write (.rrd).")] = None,
    chart: Annotated[Path | None, options.output(metavar="NAME", help="Chart to write, .svg and .png.")] = None,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Simulate a scene step by step; every step is judged and stored.

    The command "proxbench list scenes NAME" shows the options of a scene.
    """
    from .show import Request, run_simulation

    _require_consistent_options(context)
    if study or (resume is not None and resume.is_dir()):
        return _run_study(context, quiet, as_json, progress)
    plan_arguments = {name: context.params[name] for name in _PLAN_ARGUMENTS if context.params[name] is not None}
    if solver is not None:
        plan_arguments["solver"] = solver[0]
    request = Request(scene, plan_arguments, duration, output, force, resume, recording, chart)
    return run_simulation(request, as_json, quiet, progress)


def _run_study(context: typer.Context, quiet: bool, as_json: bool, progress: bool) -> int:
    """Start or resume a study, and print its report like that of a run."""
    from msgspec.structs import replace

    from ... import runs
    from ...measure.trajectories.plan import LIMITS as DEFAULTS
    from ...simulation.starts import DEFAULT_START
    from ..progress import RunProgress

    arguments = context.params
    with RunProgress(not progress or quiet or as_json) as bar:
        if arguments["resume"] is not None:
            _require_study(arguments["resume"])
            measured_study = runs.resume(arguments["resume"], on_event=bar)
        else:
            changed = {name: arguments[name] for name in _LIMITS if arguments[name] is not None}
            limits = replace(DEFAULTS, **changed)
            scene, solvers, duration = arguments["scene"], arguments["solver"] or (), arguments["duration"]
            start = arguments["start"] or DEFAULT_START
            measured_study = runs.study(
                scene, solvers, arguments["output"], limits=limits, on_event=bar, duration=duration, start=start
            )
    return report_run(measured_study, True, quiet, as_json)


def _require_study(folder: Path) -> None:
    """Raise ``BenchError`` unless a folder holds a study."""
    from ...errors import BenchError
    from ...store.store import Store

    if not Store.open(folder).read_run().plan.trajectories:
        raise BenchError(
            f"{folder} is a run over contact problems, not a simulation; "
            f"resume it with: proxbench run --resume {quote(str(folder))}"
        )


def _require_consistent_options(context: typer.Context) -> None:
    """Raise ``BenchError`` if options of ``simulate`` contradict each other."""
    from ....problems.motion.scenes.registry import SCENES
    from ...errors import BenchError

    values, specified = context.params, options.given_parameters(context)
    resume, output = values["resume"], values["output"]
    is_study = values["study"] or (resume is not None and resume.is_dir())
    if resume is None and not values["scene"]:
        raise BenchError(f"name a scene ({', '.join(SCENES)}), or a result to resume: --resume RESULT.")
    if resume is not None and values["study"] and not resume.is_dir():
        raise BenchError(f"{resume} is not a study; omit --study, or name the folder of a study.")
    if not is_study:
        options.require_absent(_LIMITS, specified, "limits a study, but this is a single simulation")
        if len(values["solver"] or ()) > 1:
            raise BenchError("a simulation has one solver; name one, or compare several with --study.")
    else:
        options.require_absent(sorted(_NOT_IN_A_STUDY), specified, "is for a single simulation, but this is a study")
        if output.suffix in (".json", ".npz"):
            raise BenchError(f"a study is stored in a folder, but --output names the file {output}; name a folder.")
    if resume is not None:
        if is_study:
            options.require_absent(_STORED, specified, "is stored with the study and cannot be changed")
        other_outputs = {"recording", "chart"} & specified  # --force may replace these files
        reason = "has no effect with --resume, which writes to the resumed file"
        options.require_absent(("output",) if other_outputs else ("output", "force"), specified, reason)
