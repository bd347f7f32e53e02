"""Options that commands share, and checks for mutually exclusive options."""

import re
import sys
from collections.abc import Collection, Iterable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup

selection, limits, output = (
    partial(typer.Option, rich_help_panel=topic) for topic in ("Problems and solvers", "Limits", "Output")
)
"""Factories of options, one for each topic of the help page."""

flag = partial(output, metavar="", show_default=False)
"""Factory of output options without a value."""


class Command(TyperCommand):
    """A command whose help page names values by their metavars, not by Python types such as ``<str>``."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, including the help option, without types."""
        return _without_types(super().get_params(ctx))

    def invoke(self, ctx: Any) -> Any:
        """Run the command; raise ``BenchError`` if both ``--quiet`` and ``--json`` are given."""
        specified = [name for name, key in (("quiet", "quiet"), ("json", "as_json")) if ctx.params.get(key)]
        require_exclusive("quiet", ["json"], specified)
        return super().invoke(ctx)


class Group(TyperGroup):
    """The group of all commands, whose help page omits types as in ``Command``."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, including the help option, without types."""
        return _without_types(super().get_params(ctx))


def _without_types(parameters: list[Any]) -> list[Any]:
    """Hide the types of arguments and of the help option, for which typer has no setting."""
    for parameter in parameters:
        if isinstance(parameter, TyperArgument) or parameter.name == "help":
            parameter.display_type_rich = lambda ctx: None
    return parameters


def examples(command: str, *arguments: str) -> str:
    """Return the examples of a help page: ``command`` with each of ``arguments``, one per line."""
    return "\n".join(["Examples:", *(f"  {command} {words}" for words in arguments)])


def require_command(context: typer.Context) -> int:
    """Return 0 if a command follows; otherwise print the help page on standard error and return 2."""
    if context.invoked_subcommand is not None:
        return 0
    from contextlib import redirect_stdout

    with redirect_stdout(sys.stderr):
        print(context.get_help(), end="")
    return 2


def _load_plugin_files(paths: list[Path] | None) -> list[Path] | None:
    """Load the plugin files that ``--plugin`` names, and return their paths unchanged."""
    if paths:
        from ..plugins.files import use_plugin_files

        use_plugin_files(paths)
    return paths


def print_notes(*sentences: str) -> None:
    """Print sentences on standard error, each on a line that begins with the name of the program."""
    for sentence in sentences:
        print(f"proxbench: {sentence}", file=sys.stderr)


def given_parameters(context: typer.Context) -> set[str]:
    """Return the names of the parameters given on the command line."""
    return {name for name in context.params if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"}


_OPTION_NAMES = {
    "results": "output",
    "plugins": "plugin",
    "tolerances": "tolerance",
    "max_seconds": "solve_seconds",
    "seconds": "check_seconds",
}
"""Names of options, without dashes, that differ from those of their parameters in Python."""


def option_name(name: str) -> str:
    """Return the option of a parameter, such as ``"--run-id"``."""
    return f"--{name.replace('_', '-')}"


def with_option_names(message: str) -> str:
    """Return a message in which options replace parameters: ``--force`` for `` `force=True` ``."""
    return re.sub(r"`([a-z_]+)(?:=True)?`", lambda match: option_name(_OPTION_NAMES.get(match[1], match[1])), message)


def require_absent(names: Iterable[str], specified: Collection[str], reason: str) -> None:
    """Raise ``BenchError`` with a reason if one of these parameters is given."""
    from ..errors import BenchError

    for name in names:
        if name in specified:
            option = "SCENE" if name == "scene" else option_name(name)
            raise BenchError(f"{option} {reason}; omit {option}.")


def require_exclusive(name: str, others: Iterable[str], specified: Collection[str]) -> None:
    """Raise ``BenchError`` if a parameter is given together with one of the others."""
    from ..errors import BenchError

    for other in others:
        if name in specified and other in specified:
            raise BenchError(
                f"{option_name(name)} and {option_name(other)} are mutually exclusive; give only one of them."
            )


def _check_residual(name: str) -> str:
    if name != "judged":
        from ..store.frames import check_residual

        check_residual(name)
    return name


PluginFiles = Annotated[
    list[Path] | None,
    selection(
        "--plugin",
        metavar="FILE",
        help="File with solvers, problems or scenes; repeatable.",
        callback=_load_plugin_files,
    ),
]
"""Plugin files, loaded before the command starts."""

Suite = Annotated[str, selection(metavar="SUITE|FOLDER", help="Suite, or folder of problem files.")]
"""Name of a suite, or a folder."""

Solvers = Annotated[
    list[str] | None,
    selection("--solver", metavar="SOLVER", help='Solver, such as "SORprox(relaxation=1.5)"; repeatable.'),
]
"""Names of solvers with options."""

Problems = Annotated[
    list[str] | None, selection("--problem", metavar="PROBLEM", help="Problem, instead of a suite; repeatable.")
]
"""Names of problems."""

Sample = Annotated[int | None, selection(metavar="NUMBER", help="Number of problems to draw.")]
"""Size of a sample."""

Sampling = Annotated[
    Literal["proportional", "even"],
    selection(metavar="HOW", help="Shares of families in a sample: proportional, even."),
]
"""How a sample is divided among families."""

SolveSeconds = Annotated[float, limits(metavar="SECONDS", help="Time limit of one solve.")]
"""Time limit of one solve [s]."""

Runs = Annotated[Path, output("--output", metavar="FOLDER", help="Folder of runs.")]
"""Folder of runs."""

RunId = Annotated[str | None, output("--run-id", metavar="NAME", help="Name of the run; by default, the time.")]
"""Name of a new run."""

Json = Annotated[bool, flag("--json", help="Print one JSON document.")]
"""Print one JSON document on standard output and nothing else."""

Charts = Annotated[bool, flag("--charts/--no-charts", help="Draw charts.")]
"""Draw charts in addition to the tables."""

Residual = Annotated[
    str,
    output(metavar="judged|local", help="Residual that reports use.", callback=_check_residual),
]
"""Residual by which reports measure accuracy."""


def _check_view(name: str) -> str:
    if name != "common":
        from ..report.profiles import check_view

        check_view(name)
    return name


Profiles = Annotated[
    str,
    output(
        metavar="common|all", help="Problems in profiles: those that all solvers support, or all.", callback=_check_view
    ),
]
"""Problems that charts of profiles cover."""

Progress = Annotated[bool, flag("--progress/--no-progress", help="Show progress.")]
"""Show progress on standard error."""

Quiet = Annotated[bool, flag("--quiet", help="Print only failures and file paths.")]
"""Print only failures, such as failed checks, and the paths of written files."""

Force = Annotated[bool, flag("--force", help="Replace existing files.")]
"""Replace files that exist."""
