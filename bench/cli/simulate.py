"""The command ``proxbench simulate``."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from . import options
from .help import HelpCommand

_NUMBERS = ("stepper", "solver", "tolerance", "max_iterations", "states", "step_seconds")

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
    from ...problems.scenes.registry import SCENES

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
    solver: Annotated[str | None, _method(metavar="SOLVER", help='Like "SORprox(relaxation=1.5)".')] = None,
    tolerance: Annotated[float | None, _method(help="Judged residual that each step shall reach.")] = None,
    max_iterations: Annotated[int | None, _method(help="Iterations of the solver in one step.")] = None,
    step_seconds: Annotated[
        float | None, _method(metavar="SECONDS", help="Time of one answer of a plugin in a step.")
    ] = None,
    study: Annotated[bool, _method("--study", help="Measure what accuracy costs instead.")] = False,
    plugin: options.PluginFiles = None,
    resume: Annotated[Path | None, options.output(metavar="FILE", help="Go on with this result.")] = None,
    output: Annotated[Path, options.output(metavar="FILE", help="Result (.npz), or its folder.")] = Path("results"),
    states: Annotated[int | None, options.output(help="States kept, at least; twice as many at most.")] = None,
    record: Annotated[Path | None, options.output(metavar="FILE", help="Recording to write (.rrd).")] = None,
    chart: Annotated[Path | None, options.output(metavar="NAME", help="Chart to write, .svg and .png.")] = None,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Simulate a scene step by step; every step is judged and stored. SCENE -h shows the options of a scene."""
    from .simulation import Request, run_simulation
    from .study import run_study_command, wants_study

    _refuse_contradictions(context)
    options.refuse_two_prints(quiet, as_json)
    numbers = {name: context.params[name] for name in _NUMBERS if context.params[name] is not None}
    request = Request(scene, numbers, duration, output, force, resume, record, chart)
    if wants_study(study, resume):
        return run_study_command(request, as_json, progress)
    return run_simulation(request, as_json, quiet, progress)


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
        if name in options.given(context):
            raise BenchError(f"--{name} makes no sense with --resume, which goes on in its own file; leave it out.")
