"""The command ``proxbench simulate``."""

from pathlib import Path
from typing import Annotated, Any

import typer

from .help import OUTPUT, HelpCommand
from .options import Json, PluginFiles, Progress, Quiet, refuse_two_prints

_NUMBERS = ("stepper", "solver", "tolerance", "max_iterations", "states", "step_seconds")

_ARGUMENTS = "proxbench.arguments"

_METHOD = "Method"


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
    duration: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Simulated time.", rich_help_panel=_METHOD)
    ] = None,
    stepper: Annotated[
        str | None,
        typer.Option(metavar="STEPPER", help='Like "Moreau(step=5e-4)" or Extrapolated.', rich_help_panel=_METHOD),
    ] = None,
    solver: Annotated[
        str | None, typer.Option(metavar="SOLVER", help='Like "SORprox(relaxation=1.5)".', rich_help_panel=_METHOD)
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Judged residual that each step shall reach.", rich_help_panel=_METHOD)
    ] = None,
    max_iterations: Annotated[
        int | None, typer.Option(help="Iterations of the solver in one step.", rich_help_panel=_METHOD)
    ] = None,
    step_seconds: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Time of one answer of a plugin in a step.", rich_help_panel=_METHOD),
    ] = None,
    study: Annotated[
        bool, typer.Option("--study", help="Measure what accuracy costs instead.", rich_help_panel=_METHOD)
    ] = False,
    plugin: PluginFiles = None,
    resume: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Go on with this result.", rich_help_panel=OUTPUT)
    ] = None,
    output: Annotated[
        Path, typer.Option(metavar="FILE", help="Result (.npz), or its folder.", rich_help_panel=OUTPUT)
    ] = Path("results"),
    states: Annotated[
        int | None, typer.Option(help="States kept, at least; twice as many at most.", rich_help_panel=OUTPUT)
    ] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Recording to write (.rrd).", rich_help_panel=OUTPUT)
    ] = None,
    chart: Annotated[
        Path | None, typer.Option(metavar="NAME", help="Chart to write, .svg and .png.", rich_help_panel=OUTPUT)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.", rich_help_panel=OUTPUT)] = False,
    quiet: Quiet = False,
    as_json: Json = False,
    progress: Progress = True,
) -> int:
    """Simulate a scene step by step; every step is judged and stored. SCENE -h shows the options of a scene."""
    from .simulation import Request, run_simulation
    from .study import run_study_command, wants_study

    _refuse_contradictions(context)
    refuse_two_prints(quiet, as_json)
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
        if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE":
            raise BenchError(f"--{name} makes no sense with --resume, which goes on in its own file; leave it out.")
