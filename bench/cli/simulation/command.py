"""The command ``proxbench simulate``."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import options
from ..help import HelpCommand
from ..report import report_run

_NUMBERS = ("stepper", "tolerance", "max_iterations", "start", "states", "step_seconds")

_LIMITS = {"solve_seconds", "case_seconds"}
"""Options of a study alone."""

_NOT_IN_A_STUDY = {*_NUMBERS, "recording", "chart", "force"} - {"start"}

_WHY = {
    **dict.fromkeys(("stepper", "tolerance", "max_iterations"), "a study varies steppers and tolerances itself"),
    "states": "a study keeps no states of its simulations",
    "step_seconds": "a study limits no single answers of plugins, but --solve-seconds and --case-seconds",
    "recording": "a study is of many simulations and has no recording",
}
"""Why not."""

_STORED = {"scene", "solver", "duration", "start", *_LIMITS}
"""What a study that goes on has from its folder."""

_ARGUMENTS = "proxbench.arguments"

_method = partial(typer.Option, rich_help_panel="Method")


class SceneCommand(HelpCommand):
    """A command whose help shows the options of the scene that is named before ``--help``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Keep the arguments for the help, which is printed before they are parsed."""
        ctx.meta[_ARGUMENTS] = list(args)
        rest: list[str] = super().parse_args(ctx, args)
        return rest

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options of the scene with their meaning and default, else those of the command."""
        for word in ctx.meta.get(_ARGUMENTS, ()):
            rows = _scene_options(word)
            if rows:
                with formatter.section(f"Options of the scene, {word.partition('(')[0]}(option=value, …)"):
                    formatter.write_dl(rows)
                return
        super().format_options(ctx, formatter)


def _scene_options(word: str) -> list[tuple[str, str]]:
    from ....problems.motion.scenes.registry import SCENES

    name = word.partition("(")[0]
    if name not in SCENES:
        return []
    return [
        (f"{key}={option.default!r}", option.meaning + ("; None: off" if option.can_be_off else ""))
        for key, option in SCENES[name].options.items()
    ]


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
    tolerance: Annotated[float | None, _method(help="Judged residual that each step shall reach.")] = None,
    max_iterations: Annotated[int | None, _method(help="Iterations of the solver in one step.")] = None,
    start: Annotated[
        str | None, _method(metavar="START", help="First impulses of a step: warm, cold or warm-then-cold.")
    ] = None,
    step_seconds: Annotated[
        float | None, _method(metavar="SECONDS", help="Time of one answer of a plugin in a step.")
    ] = None,
    study: Annotated[bool, _method("--study", help="Measure what accuracy costs instead.")] = False,
    solve_seconds: Annotated[
        float | None, options.limits(metavar="SECONDS", help="Time of one simulation of a study.")
    ] = None,
    case_seconds: Annotated[float | None, options.limits(metavar="SECONDS", help="Time of one curve of it.")] = None,
    plugin: options.PluginFiles = None,
    resume: Annotated[Path | None, options.output(metavar="RESULT", help="Go on with this file, or study.")] = None,
    output: Annotated[
        Path, options.output(metavar="FILE", help="Result (.npz), or the folder for it or for a study.")
    ] = Path("results"),
    states: Annotated[int | None, options.output(help="States kept, at least; twice as many at most.")] = None,
    recording: Annotated[Path | None, options.output(metavar="FILE", help="Recording to write (.rrd).")] = None,
    chart: Annotated[Path | None, options.output(metavar="NAME", help="Chart to write, .svg and .png.")] = None,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Simulate a scene step by step; every step is judged and stored. SCENE -h shows the options of a scene."""
    from .show import Request, run_simulation

    _refuse_contradictions(context)
    options.refuse_two_prints(quiet, as_json)
    if study or (resume is not None and resume.is_dir()):
        return _run_study(context, quiet, as_json, progress)
    numbers = {name: context.params[name] for name in _NUMBERS if context.params[name] is not None}
    if solver is not None:
        numbers["solver"] = solver[0]
    request = Request(scene, numbers, duration, output, force, resume, recording, chart)
    return run_simulation(request, as_json, quiet, progress)


def _run_study(context: typer.Context, quiet: bool, as_json: bool, progress: bool) -> int:
    """Begin a study or go on with one, and show it as any run."""
    from msgspec.structs import replace
    from rich.console import Console

    from ... import runs
    from ...measure.trajectories.plan import LIMITS as DEFAULTS
    from ...simulation.starts import DEFAULT_START
    from ..progress import RunProgress

    given = context.params
    with RunProgress(Console(stderr=True), hidden=not progress or quiet or as_json) as shown:
        if given["resume"] is not None:
            _require_study(given["resume"])
            made = runs.resume(given["resume"], on_event=shown)
        else:
            changed = {name: given[name] for name in _LIMITS if given[name] is not None}
            limits = replace(DEFAULTS, **changed)
            scene, solvers, duration = given["scene"], given["solver"] or (), given["duration"]
            start = given["start"] or DEFAULT_START
            made = runs.study(
                scene, solvers, given["output"], limits=limits, on_event=shown, duration=duration, start=start
            )
    return report_run(made, True, quiet, as_json)


def _require_study(folder: Path) -> None:
    """Check that a folder holds a study.

    Raises:
        BenchError: if it is no run, or a run over contact problems.
    """
    from ...errors import BenchError
    from ...store.store import Store

    if not Store.open(folder).read_run().plan.trajectories:
        raise BenchError(
            f"{folder} is a run over contact problems, not a simulation; "
            f"resume it with: proxbench run --resume {folder}"
        )


def _refuse_contradictions(context: typer.Context) -> None:
    from ....problems.motion.scenes.registry import SCENES
    from ...errors import BenchError

    given, resume = context.params, context.params["resume"]
    named = options.given(context)
    is_study = given["study"] or (resume is not None and resume.is_dir())
    if resume is None and not given["scene"]:
        raise BenchError(f"name a scene ({', '.join(SCENES)}), or a result to resume: --resume RESULT.")
    if resume is not None and given["study"] and not resume.is_dir():
        raise BenchError(f"{resume} holds no study, which is the folder of a run; leave --study out, or name one.")
    for name in sorted(named & (_NOT_IN_A_STUDY if is_study else _LIMITS)):
        why = _WHY.get(name, "a study is a run, whose files have their places in its folder")
        raise BenchError(f"{why if is_study else 'only a study has such a limit'}; leave {_option(name)} out.")
    if resume is not None and is_study:
        for name in sorted(named & _STORED):
            raise BenchError(f"{_option(name)} is stored with the study and cannot be changed; leave it out.")
    if is_study and given["output"].suffix in (".json", ".npz"):
        raise BenchError(f"a study is a folder in --output, not the file {given['output']}; name the folder.")
    if not is_study and len(given["solver"] or ()) > 1:
        raise BenchError("a simulation has one solver; name one, or compare them with --study.")
    writes_more = given["recording"] is not None or given["chart"] is not None  # which --force may replace
    for name in ("output",) if writes_more else ("output", "force"):
        if resume is not None and name in named:
            raise BenchError(f"--{name} makes no sense with --resume, which goes on in its own place; leave it out.")


def _option(name: str) -> str:
    return "SCENE" if name == "scene" else options.spelled(name)
