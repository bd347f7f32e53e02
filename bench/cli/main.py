"""The command line: ``proxbench COMMAND``; ``proxbench -h`` lists the commands.

Commands import slow libraries when they run, so that help appears immediately. Exit codes: 0 success, 1 a failed case
or another negative result, 2 wrong usage, 130 interrupted.
"""

import gc
import os
import sys
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any

import typer
from typer.exceptions import TyperException
from typer.main import get_command

from . import options
from .catalog import generate, list_names
from .comparison.check import check
from .comparison.compare import compare
from .comparison.matrix import matrix
from .compilation.warm import warm
from .exchange.bundles import bundle, merge, rejudge
from .exchange.capture import capture
from .exchange.problem_files import export_files, import_files, info
from .record import record
from .report import report
from .run import run
from .simulation.command import simulate
from .simulation.engines import engines
from .simulation.statics import statics

LOOK_UP = "Find or generate problems"
"""Heading of the last group of commands."""

COMMANDS: dict[str, dict[str, tuple[Callable[..., Any], *tuple[str, ...]]]] = {
    "Compare and test solvers": {
        "run": (
            run,
            '--suite hard --solver NSGS --solver "SORprox(relaxation=1.5)"',
            "--resume results/RUN --retry-failed",
        ),
        "compare": (
            compare,
            'results/old results/new --fail-on "time>10%"',
            "results/old results/new --markdown comment.md",
        ),
        "matrix": (matrix, "--suite woodpecker --solver Lemke --solver NSGS", "--output matrix.md"),
        "check": (check, '"SORprox(relaxation=1.5)"', "my_solver.py --quiet"),
    },
    "Simulate a scene": {
        "simulate": (
            simulate,
            '"funnel(balls=300, friction=None)" --duration 0.5',
            "woodpecker --recording woodpecker.rrd",
        ),
        "statics": (
            statics,
            '"block_on_incline(slope=0.3)" --friction',
            '"stack(friction=0.3)" --push 1,0,0',
        ),
        "engines": (engines, "thrown-cube stack --output engines.md", "pile --engine pybullet --engine proxbench"),
    },
    "Show stored results": {
        "report": (
            report,
            "results/RUN",
            "results/RUN --problem funnel-100",
            "results/RUN --page",
            "results/RUN --quiet --no-charts",
        ),
        "record": (
            record,
            "funnel-100 --solver NSGS --solver Jprox --output funnel.rrd",
            "results/woodpecker.npz",
        ),
    },
    "Send and combine results": {
        "bundle": (bundle, "results/RUN", "results/RUN --output mine.bundle"),
        "rejudge": (rejudge, "RUN.bundle", "RUN.bundle --quiet"),
        "merge": (merge, "theirs.bundle --run-id theirs", "results/shard-1 results/shard-2 --run-id whole"),
    },
    LOOK_UP: {
        "list": (list_names, "solvers", "solvers SORprox", "scenes funnel", "problems --suite hard"),
        "generate": (generate, "funnel-1000", "--suite woodpecker --output problems"),
        "info": (info, "fclib-library/Boxes", "mine.npz --json"),
        "import": (
            import_files,
            "fclib fclib-library --output problems",
            "kamino dump.npz --indefinite project --output stack.npz",
        ),
        "export": (export_files, "fclib funnel-100 pile-300 --output problems", "json mine.npz --output mine.json"),
        "capture": (capture, "model.xml --duration 2 --every 10 --output steps", "humanoid.xml --seed 0 --judge"),
        "warm": (warm, "--quiet", "--json"),
    },
}
"""Each command by topic and name, with examples of its arguments."""

INTERRUPTED = 130
"""Exit code of a command that Ctrl-C interrupted."""

OBJECTS_OF_IMPORTS = 250_000
"""Number of objects after which garbage is first collected, more than the imports of most commands create."""

app = typer.Typer(
    name="proxbench",
    cls=options.Group,
    help="Measure numerical solvers for frictional contact: real problems, one judge, time against true accuracy.",
    epilog=options.examples("proxbench", "run", "list solvers", "run -h"),
    context_settings={"help_option_names": ["-h", "--help"]},
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def main() -> None:
    """Run the command line and exit; print a user error as one sentence on standard error."""
    _postpone_collection()
    try:
        sys.exit(run_command(sys.argv[1:]))
    finally:
        gc.freeze()  # otherwise, the interpreter searches all modules for garbage when it exits, which takes 0.2 s


def _postpone_collection() -> None:
    """Collect garbage only when ``OBJECTS_OF_IMPORTS`` objects exist, then as usual: imports create no garbage."""
    thresholds, is_postponed = gc.get_threshold(), gc.get_threshold()[0] > 0

    def collect_as_usual(*_: object) -> None:
        nonlocal is_postponed
        if is_postponed:
            gc.set_threshold(*thresholds)
        is_postponed = False

    if is_postponed:
        gc.callbacks.append(collect_as_usual)  # it stays there: other callbacks may miss a call when one is removed
        if sys.platform != "win32":
            os.register_at_fork(after_in_child=collect_as_usual)
        gc.set_threshold(OBJECTS_OF_IMPORTS, *thresholds[1:])


def run_command(arguments: list[str]) -> int:
    """Run one command line and return its exit code."""
    try:
        outcome = command_line()(args=arguments, prog_name="proxbench", standalone_mode=False)
    except TyperException as error:
        return _print_error(_usage_error(error, arguments), 2)
    except (typer.Abort, KeyboardInterrupt):
        return _print_error("interrupted.", INTERRUPTED)
    except BrokenPipeError:
        return 0
    except Exception as error:
        return _print_error(*_user_error(error))
    if outcome == INTERRUPTED:  # typer turns KeyboardInterrupt into this code
        return _print_error("interrupted.", INTERRUPTED)
    return outcome if isinstance(outcome, int) else 0


@cache
def command_line() -> Callable[..., Any]:
    """Return the parser of the command line, which takes typer 30 ms to build."""
    return get_command(app)


def _user_error(error: Exception) -> tuple[str, int]:
    """Return the message and exit code of an error that a user can cause; raise other errors again."""
    from ...problems.errors import ProxbenchError
    from ...problems.motion.stepping.step import StepError
    from ..errors import FailedSimulationError, InterruptedWorkError

    if not isinstance(error, ProxbenchError):
        raise error
    code = 1 if isinstance(error, FailedSimulationError | StepError) else 2
    if isinstance(error, InterruptedWorkError):
        code = INTERRUPTED
    return options.with_option_names(str(error)), code


def _print_error(message: str, code: int) -> int:
    print(f"proxbench: {message}", file=sys.stderr)
    return code


def _usage_error(error: TyperException, arguments: list[str]) -> str:
    """Return the message of typer as one sentence that names the help page of the command."""
    message = (
        " ".join(error.format_message().split())
        .replace(". Choose from:", "; choose from")
        .rstrip(".")
        .replace("Input should", "it must")
        .replace("Value error, ", "")
    )
    message = message[:1].lower() + message[1:].partition(", unable to parse")[0].replace(". Did", ", did").rstrip("?")
    context = getattr(error, "ctx", None)
    if context is not None:
        command = context.command_path
    else:  # the parser has no context if the value of an option is missing
        known = [word for word in arguments[:1] if any(word in commands for commands in COMMANDS.values())]
        command = " ".join(["proxbench", *known])
    return f"{message}; see {command} -h."


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", metavar="", help="Print the version.")] = False,
) -> int:
    if version:
        from importlib import metadata

        print(f"proxbench {metadata.version('proxbench')}")
        raise typer.Exit
    return options.require_command(context)


for _topic, _commands in COMMANDS.items():
    for _name, (_function, *_examples) in _commands.items():
        _epilog = options.examples(f"proxbench {_name}", *_examples)
        app.command(_name, cls=options.Command, epilog=_epilog, rich_help_panel=_topic)(_function)
