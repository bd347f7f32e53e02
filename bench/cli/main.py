"""The command line: ``proxbench COMMAND``, as ``proxbench -h`` lists them.

Commands import slow libraries when they run, so that help appears at once. Exit codes: 0 success, 1 a measured case
failed, 2 wrong usage, 130 interrupted.
"""

import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from typer.exceptions import TyperException

from . import options
from .comparison.compare import compare
from .comparison.matrix import matrix
from .exchange import fclib
from .exchange.bundles import bundle, merge, rejudge
from .exchange.capture import capture
from .help import HelpCommand, HelpGroup
from .record import record
from .report import report
from .run import run
from .simulation.command import SceneCommand, simulate
from .warm import warm

COMPARE, SIMULATE, SHOW, EXCHANGE, LOOK_UP = (
    "Compare and test solvers",
    "Simulate a scene",
    "Show stored results",
    "Send and combine results",
    "Find or make problems",
)
"""Topics of commands."""

app = typer.Typer(
    name="proxbench",
    help="Measure numerical solvers for frictional contact: real problems, one judge, time against true accuracy.",
    epilog="""\
proxbench run              measure the default solvers on a few problems
proxbench list solvers     solvers and their options
proxbench COMMAND -h       options and examples of a command""",
    cls=HelpGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Command = TypeVar("Command", bound=Callable[..., Any])


def _command(
    topic: str, name: str, summary: str, examples: str, kind: type[HelpCommand] = HelpCommand
) -> Callable[[Command], Command]:
    """Register a command under a topic of the program's help, with a summary and examples."""
    return app.command(name, cls=kind, short_help=summary, epilog=examples, rich_help_panel=topic)


def main() -> None:
    """Run the command line and exit; a mistake is one sentence on standard error."""
    sys.exit(run_command(sys.argv[1:]))


def run_command(arguments: list[str]) -> int:
    """Run one command line and return its exit code."""
    try:
        outcome = app(args=arguments, prog_name="proxbench", standalone_mode=False)
    except TyperException as error:
        return _print_error(_usage_error(error, arguments), 2)
    except (typer.Abort, KeyboardInterrupt):
        return _print_error("interrupted.", 130)
    except BrokenPipeError:
        return 0
    except Exception as error:
        return _print_error(*_user_error(error))
    return outcome if isinstance(outcome, int) else 0


def _user_error(error: Exception) -> tuple[str, int]:
    """Return the message and exit code of an error that a user can cause; raise any other one again."""
    from ...problems.errors import ProxbenchError
    from ...problems.motion.stepping.step import StepError
    from ..errors import FailedSimulationError, InterruptedWorkError

    if not isinstance(error, ProxbenchError):
        raise error
    failed = isinstance(error, FailedSimulationError | StepError)
    return options.spell_options(str(error)), 130 if isinstance(error, InterruptedWorkError) else 1 if failed else 2


def _print_error(message: str, code: int) -> int:
    print(f"proxbench: {message}", file=sys.stderr)
    return code


_NUMBERS: dict[str, tuple[str, Callable[[str], object]]] = {
    "Input should be a valid integer": ("a whole number", int),
    "Input should be a valid number": ("a number", float),
}
"""What an option takes, and what reads it, by the beginning of the message of typer."""


def _usage_error(error: TyperException, arguments: list[str]) -> str:
    """Return the message for a command line that cannot be parsed, with the nearest name of a command or option."""
    from ...problems.errors import suggestion

    message = error.format_message().rstrip(".").partition(" (Possible")[0]
    command = getattr(getattr(error, "ctx", None), "command", None)
    where = _command_path(getattr(error, "ctx", None), arguments)
    option = getattr(error, "option_name", None)
    if option is not None and command is not None and message.startswith("No such option"):
        known = [name for parameter in command.params for name in parameter.opts]
        return f"there is no option {option}{suggestion(option, known, f'{where} -h')}"
    if option is not None and "requires an argument" in message:
        return f"{option} needs a value; see {where} -h."
    if option is not None and "does not take a value" in message:
        return f"{option} takes no value; see {where} -h."
    for beginning, (kind, read) in _NUMBERS.items():
        if str(getattr(error, "message", "")).startswith(beginning):
            names = error.param.opts  # type: ignore[attr-defined]
            return f"{names[0]} takes {kind}, not {_unreadable_value(arguments, names, read)!r}; see {where} -h."
    commands = getattr(command, "commands", None)
    if message.startswith("No such command") and commands:
        wrong = message.split("'")[1]
        return f"there is no command {wrong!r}{suggestion(wrong, commands, f'{where} -h')}"
    if message.startswith("Got unexpected extra argument"):
        return f"unexpected argument {message.partition('(s) (')[2].rstrip(')').split()[0]!r}; see {where} -h."
    if message.startswith("Missing argument"):
        return f"name {message.split(chr(39))[1]}, the missing argument; see {where} -h."
    return f"{message.replace('Value error, ', '')}; see {where} -h."


def _command_path(context: Any, arguments: list[str]) -> str:
    """Return the command as its user typed it; the parser has no context for some errors."""
    if context is not None:
        return str(context.command_path)
    known = {command.name for command in app.registered_commands}
    return f"proxbench {arguments[0]}" if arguments and arguments[0] in known else "proxbench"


def _unreadable_value(arguments: list[str], names: list[str], read: Callable[[str], object]) -> str:
    """Return the first value of an option that ``read`` does not take."""
    for name in names:
        for position, word in enumerate(arguments):
            option, separator, value = word.partition("=")
            if option == name:
                value = value if separator else arguments[position + 1]
                try:
                    read(value)
                except ValueError:
                    return value
    return ""


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> int:
    if version:
        print(f"proxbench {metadata.version('proxbench')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help(), file=sys.stderr)
        return 2
    return 0


_command(
    COMPARE,
    "run",
    "Measure solvers on problems: time against accuracy.",
    """\
proxbench run --suite hard --solver NSGS --solver "SORprox(relaxation=1.5)"
proxbench run --resume results/RUN --retry-failed""",
)(run)

_command(
    COMPARE,
    "compare",
    "Compare two runs.",
    """\
proxbench compare results/old results/new --fail-on "time>10%"
proxbench compare results/old results/new --markdown comment.md""",
)(compare)

_command(
    COMPARE,
    "matrix",
    "Show which solver solves which problem.",
    """\
proxbench matrix --suite woodpecker --solver Lemke --solver NSGS
proxbench matrix --output matrix.md""",
)(matrix)


@_command(
    COMPARE,
    "check",
    "Test a solver or problem for conformance.",
    """\
proxbench check "SORprox(relaxation=1.5)"
proxbench check my_solver.py --quiet""",
)
def check(
    target: Annotated[str, typer.Argument(metavar="NAME|FILE", help="Solver, problem, or plugin file.")],
    check_seconds: Annotated[float, options.limits(metavar="SECONDS", help="Time limit of one check.")] = 60.0,
    plugin: options.PluginFiles = None,
    quiet: Annotated[bool, options.output("--quiet", help="Print failed checks only.")] = False,
    as_json: options.Json = False,
) -> int:
    """Test a solver or problem for conformance; the exit code is 1 if a check fails."""
    from rich.console import Console

    from ..conformance.run import checked, print_checks
    from ..report.layout.text import print_json
    from .progress import ProgressBar

    options.refuse_two_prints(quiet, as_json)
    with ProgressBar(Console(stderr=True), hidden=quiet or as_json) as shown:

        def show(check: str, done: int, total: int) -> None:
            shown.name(check, again=True)
            shown.count(done, total)

        subjects = checked(target, check_seconds, show)
    if as_json:
        print_json(subjects)
    else:
        print_checks(subjects, failed_only=quiet)
    return int(not all(subject["passed"] for subject in subjects))


_command(
    SIMULATE,
    "simulate",
    "Simulate a scene; judge and store every step.",
    """\
proxbench simulate "funnel(balls=300, friction=None)" --duration 0.5
proxbench simulate woodpecker --recording woodpecker.rrd""",
    SceneCommand,
)(simulate)


_command(
    SHOW,
    "report",
    "Print the tables and draw the charts of a result.",
    """\
proxbench report results/RUN
proxbench report results/RUN --problem funnel-100
proxbench report results/RUN --page
proxbench report results/RUN --quiet --no-charts""",
)(report)

_command(
    SHOW,
    "record",
    "Record iterations or a simulation for rerun.",
    """\
proxbench record funnel-100 --solver NSGS --solver Jprox --output funnel.rrd
proxbench record results/woodpecker.npz""",
)(record)


_command(
    EXCHANGE,
    "bundle",
    "Pack a run into one file.",
    """\
proxbench bundle results/RUN
proxbench bundle results/RUN --output mine.bundle""",
)(bundle)

_command(
    EXCHANGE,
    "rejudge",
    "Recompute the residuals of a bundle.",
    """\
proxbench rejudge RUN.bundle
proxbench rejudge RUN.bundle --quiet""",
)(rejudge)

_command(
    EXCHANGE,
    "merge",
    "Combine bundles and runs into one run.",
    """\
proxbench merge theirs.bundle --run-id theirs
proxbench merge results/shard-1 results/shard-2 --run-id whole""",
)(merge)


@_command(
    LOOK_UP,
    "list",
    "List solvers, suites, problems and scenes.",
    """\
proxbench list solvers
proxbench list solvers SORprox
proxbench list problems --suite hard""",
)
def list_names(
    what: Annotated[
        str, typer.Argument(metavar="KIND", help="solvers, suites, problems or scenes; all by default.")
    ] = "",
    name: Annotated[str, typer.Argument(metavar="NAME", help="List this one only.")] = "",
    suite: Annotated[str, options.selection(metavar="SUITE", help="List the problems of this suite only.")] = "",
    plugin: options.PluginFiles = None,
    as_json: options.Json = False,
) -> None:
    """List solvers and scenes with their options, suites with their sizes, and problems by family."""
    from ..report.layout.text import print_json
    from .listing import listing_rows, print_listing

    names = listing_rows(what, suite, name)
    if as_json:
        print_json(names)
    else:
        print_listing(names)


@_command(
    LOOK_UP,
    "generate",
    "Make problems from their scenes.",
    """\
proxbench generate funnel-1000
proxbench generate --suite woodpecker --output problems""",
)
def generate(
    names: Annotated[list[str] | None, typer.Argument(metavar="PROBLEM", help="Problems to make.")] = None,
    suite: Annotated[
        str, options.selection(metavar="SUITE", help="Make all problems of this suite that come from scenes.")
    ] = "",
    output: Annotated[
        Path | None, options.output(metavar="FOLDER", help="Folder for the files; the cache by default.")
    ] = None,
    plugin: options.PluginFiles = None,
    as_json: options.Json = False,
) -> None:
    """Simulate scenes up to the steps that problems are taken from; print each file with the digest of its problem."""
    from ...problems.exchange.catalog import suite_members
    from ...problems.exchange.storage import read_problem
    from ...problems.hard import HARD_CASES
    from ..errors import BenchError
    from ..generate import generate as make
    from ..report.layout.text import print_json
    from .exchange.fclib import print_files

    chosen = list(names or [])
    if suite:
        chosen += [name for name in suite_members(suite) if name not in HARD_CASES and name not in chosen]
        if not chosen:
            raise BenchError(f"no problem of the suite {suite!r} comes from a scene; load its problems by name.")
    if not chosen:
        raise BenchError("name the problems to generate, or a --suite.")
    digests = {str(file): read_problem(file).digest for file in make(chosen, output)}
    if as_json:
        print_json(digests)
    else:
        print_files(digests)


_command(
    LOOK_UP,
    "capture",
    "Capture problems from a MuJoCo model.",
    """\
proxbench capture model.xml --duration 2 --every 10 --output steps
proxbench capture humanoid.xml --seed 0 --judge""",
)(capture)

_command(
    LOOK_UP,
    "warm",
    "Compile all kernels into the cache.",
    """\
proxbench warm --quiet
proxbench warm --json""",
)(warm)

app.add_typer(fclib.app, name="fclib", short_help="Inspect, import and export FCLIB files.", rich_help_panel=LOOK_UP)
