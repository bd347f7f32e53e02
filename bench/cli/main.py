"""The command line: ``proxbench COMMAND``, as ``proxbench -h`` lists them.

Imports that take long happen inside the commands, so that help is there at once. Exit codes: 0 done, 1 something
measured failed, 2 wrong usage, 130 interrupted.
"""

import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from typer.exceptions import TyperException

from . import fclib, options
from .comparison.compare import compare
from .comparison.matrix import matrix
from .help import HelpCommand, HelpGroup
from .record import record
from .run import print_problems, report_page, report_run, run
from .simulation.command import NO_STUDY, SceneCommand, simulate
from .travel import bundle, merge, rejudge

COMPARE, SIMULATE, SHOW, TRAVEL, LOOK_UP = (
    "Compare and test solvers",
    "Simulate a scene",
    "Show stored results",
    "Send results and put them together",
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
    """Register a command: its topic and summary in the help of the program, and the examples that end its own help."""
    return app.command(name, cls=kind, short_help=summary, epilog=examples, rich_help_panel=topic)


def main() -> None:
    """Run the command line and turn mistakes into one sentence and an exit code."""
    sys.exit(run_command(sys.argv[1:]))


def run_command(arguments: list[str]) -> int:
    """Run one command line; return its exit code."""
    try:
        outcome = app(args=arguments, prog_name="proxbench", standalone_mode=False)
    except TyperException as error:
        return _say(_usage_sentence(error), 2)
    except (typer.Abort, KeyboardInterrupt):
        return _say("interrupted.", 130)
    except BrokenPipeError:
        return 0
    except Exception as error:
        return _say(*_refusal(error))
    return outcome if isinstance(outcome, int) else 0


def _refusal(error: Exception) -> tuple[str, int]:
    """Return the sentence and the exit code of an error that is meant for users; raise any other one again."""
    from ...problems.errors import ProxbenchError
    from ...problems.motion.stepping.step import StepError
    from ...problems.spelling import for_command_line
    from ..errors import FailedSimulationError, InterruptedWorkError

    if not isinstance(error, ProxbenchError):
        raise error
    failed = isinstance(error, FailedSimulationError | StepError)
    return for_command_line(error.sentence), 130 if isinstance(error, InterruptedWorkError) else 1 if failed else 2


def _say(sentence: str, code: int) -> int:
    print(f"proxbench: {sentence}", file=sys.stderr)
    return code


_TAKEN = {"Input should be a valid integer": "a whole number", "Input should be a valid number": "a number"}
"""What an option takes, by how a library begins to say that it got something else."""


def _usage_sentence(error: TyperException) -> str:
    """Say what is wrong with the command line, with the nearest name where a command or an option is unknown."""
    from ...problems.errors import suggestion

    where = getattr(getattr(error, "ctx", None), "command_path", "proxbench")
    message = error.format_message().rstrip(".").partition(" (Possible")[0]
    command = getattr(getattr(error, "ctx", None), "command", None)
    option = getattr(error, "option_name", None)
    if option is not None and command is not None and message.startswith("No such option"):
        known = [name for parameter in command.params for name in parameter.opts]
        return f"there is no option {option}{suggestion(option, known, f'{where} -h')}"
    taken = next((words for began, words in _TAKEN.items() if str(getattr(error, "message", "")).startswith(began)), "")
    if taken:
        return f"{error.param.opts[0]} takes {taken}; see {where} -h"  # type: ignore[attr-defined]
    commands = getattr(command, "commands", None)
    if message.startswith("No such command") and commands:
        wrong = message.split("'")[1]
        return f"there is no command {wrong!r}{suggestion(wrong, commands, 'proxbench -h')}"
    return f"{message}; see {where} --help"


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
    "Say what differs between two runs.",
    """\
proxbench compare results/old results/new --fail-on "time>10%"
proxbench compare results/old results/new --markdown comment.md""",
)(compare)

_command(
    COMPARE,
    "matrix",
    "Show which solver solves which problem, and why not.",
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
    target: Annotated[str, typer.Argument(metavar="NAME|FILE", help="Solver with options, problem, or plugin file.")],
    seconds: Annotated[float, options.limits(metavar="SECONDS", help="Time of one check.")] = 60.0,
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

        def show(what: str, done: int, total: int) -> None:
            shown.name(what, again=True)
            shown.count(done, total)

        subjects = checked(target, seconds, show)
    if as_json:
        print_json(subjects)
    else:
        print_checks(subjects, failed_only=quiet)
    return int(not all(subject["passed"] for subject in subjects))


_command(
    SIMULATE,
    "simulate",
    "Simulate a scene; every step is judged and stored.",
    """\
proxbench simulate "funnel(balls=300, friction=None)" --duration 0.5
proxbench simulate woodpecker --record woodpecker.rrd""",
    SceneCommand,
)(simulate)


@_command(
    SHOW,
    "report",
    "Print the tables and draw the charts of a result.",
    """\
proxbench report results/RUN
proxbench report results/RUN --problem funnel-100
proxbench report results/RUN --html
proxbench report results/RUN --quiet --no-charts""",
)
def report(
    run_dir: Annotated[
        Path, typer.Argument(metavar="RESULT", help="Folder of a run or study, or file of a simulation (.npz).")
    ],
    problem: Annotated[
        list[str] | None,
        options.selection("--problem", metavar="PROBLEM", help="Print the tables of this problem only; repeatable."),
    ] = None,
    html: Annotated[bool, options.output("--html", help="Write one offline page instead, of a run.")] = False,
    baseline: Annotated[str, options.output(metavar="SOLVER", help="What speed-ups are against.")] = "",
    profiles: options.Profiles = "common",
    plugin: options.PluginFiles = None,
    residual: options.Residual = "judged",
    charts: options.Charts = True,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Print the tables of a stored run, study or simulation, and draw its charts again.

    With --problem they are printed of these problems of a run, and no file is written. With --html all of a run goes
    into one page, which needs no network, and nothing else is written.
    """
    from ..errors import BenchError

    options.refuse_two_prints(quiet, as_json)
    if problem and (html or baseline):
        raise BenchError("--problem prints tables alone; leave it out with --html and --baseline.")
    if html and not charts:
        raise BenchError("a page has its charts; leave --no-charts out with --html.")
    if (html or baseline) and run_dir.suffix == ".npz" and not run_dir.is_dir():
        raise BenchError(f"{run_dir} is a simulation; --html and --baseline are for runs.")
    if profiles != "common" and (html or problem or not charts or run_dir.suffix == ".npz"):
        raise BenchError("--profiles is for the charts of a run; leave it out with --html, whose page has both views.")
    if problem and (quiet or run_dir.suffix == ".npz"):
        raise BenchError("--problem prints problems of a run; leave it out with --quiet, and for a simulation.")
    if run_dir.suffix == ".json" and not run_dir.is_dir():
        raise BenchError(NO_STUDY.format(run_dir))
    if run_dir.suffix == ".npz" and not run_dir.is_dir():
        from .simulation.show import report_simulation

        if residual != "judged":
            raise BenchError(f"{run_dir} is a simulation, whose steps have judged residuals; leave --residual out.")
        return report_simulation(run_dir, charts, quiet, as_json)
    from ..runs import load

    if problem:
        return print_problems(load(run_dir), problem, as_json, residual)
    if html:
        return report_page(load(run_dir), quiet, as_json, residual, baseline)
    return report_run(load(run_dir), charts, quiet, as_json, residual, baseline=baseline, profiles=profiles)


_command(
    SHOW,
    "record",
    "Record iterations or a simulation, to watch with rerun.",
    """\
proxbench record funnel-100 --solver NSGS --solver Jprox --output funnel.rrd
proxbench record results/woodpecker.npz""",
)(record)


_command(
    TRAVEL,
    "bundle",
    "Pack a run into one file.",
    """\
proxbench bundle results/RUN
proxbench bundle results/RUN --output mine.bundle""",
)(bundle)

_command(
    TRAVEL,
    "rejudge",
    "Judge a bundle again, from its impulses.",
    """\
proxbench rejudge RUN.bundle
proxbench rejudge RUN.bundle --quiet""",
)(rejudge)

_command(
    TRAVEL,
    "merge",
    "Make one run of several.",
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
        str, typer.Argument(metavar="KIND", help="solvers, suites, problems or scenes; a summary of all if left out.")
    ] = "",
    name: Annotated[str, typer.Argument(metavar="NAME", help="The only one of them to list.")] = "",
    suite: Annotated[str, options.selection(metavar="SUITE", help="List the problems of this suite only.")] = "",
    plugin: options.PluginFiles = None,
    as_json: options.Json = False,
) -> None:
    """List solvers and scenes with their options, suites with their sizes, or problems by family."""
    from ..report.layout.text import print_json
    from .listing import listed, print_listing

    names = listed(what, suite, name)
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
        str, options.selection(metavar="SUITE", help="Make all problems of a suite that come from scenes.")
    ] = "",
    output: Annotated[Path | None, options.output(metavar="FOLDER", help="Where to; the cache if left out.")] = None,
    plugin: options.PluginFiles = None,
    as_json: options.Json = False,
) -> None:
    """Simulate scenes up to the step that a problem is taken from; print each file with the digest of its numbers."""
    from ...problems.exchange.catalog import suite_members
    from ...problems.exchange.storage import read_problem
    from ...problems.hard import HARD_CASES
    from ..errors import BenchError
    from ..generate import generate as make
    from ..report.layout.text import print_json

    chosen = list(names or [])
    if suite:
        chosen += [name for name in suite_members(suite) if name not in HARD_CASES and name not in chosen]
        if not chosen:
            raise BenchError(f"no problem of the suite {suite!r} comes from a scene; its members are always at hand.")
    if not chosen:
        raise BenchError("name the problems to generate, or a --suite.")
    digests = {str(file): read_problem(file).digest for file in make(chosen, output)}
    if as_json:
        print_json(digests)
    else:
        for file, digest in digests.items():
            print(f"{digest[:16]}  {file}")


app.add_typer(fclib.app, name="fclib", short_help="Look over, import and export FCLIB files.", rich_help_panel=LOOK_UP)
