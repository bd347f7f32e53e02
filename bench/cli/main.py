"""The command line: ``proxbench run | report | record | generate | simulate | list | check | matrix``.

Imports that take long happen inside the commands, so that help is there at once. Exit codes: 0 done, 1 something
measured failed, 2 wrong usage, 130 interrupted.
"""

import json
import sys
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.exceptions import TyperException

from .matrix import matrix
from .options import PluginFiles
from .simulate import simulate

app = typer.Typer(
    name="proxbench",
    help="Measure numerical solvers for frictional contact: real problems, one judge, time against true accuracy.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on standard output, nothing else.")]
Charts = Annotated[bool, typer.Option("--charts/--no-charts", help="Draw charts beside the tables.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors and where the results are.")]


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
        return _say(str(error), _exit_code(error))
    return outcome if isinstance(outcome, int) else 0


def _exit_code(error: Exception) -> int:
    """Return the exit code of an error that has a sentence for users; raise any other one again."""
    from ...problems.errors import ProxbenchError
    from ...problems.stepping.moreau import StepError
    from ..errors import FailedSimulationError, InterruptedWorkError

    if isinstance(error, InterruptedWorkError):
        return 130
    if isinstance(error, FailedSimulationError | StepError):
        return 1
    if isinstance(error, ProxbenchError):
        return 2
    raise error


def _say(sentence: str, code: int) -> int:
    print(f"proxbench: {sentence}", file=sys.stderr)
    return code


def _usage_sentence(error: TyperException) -> str:
    """Say what is wrong with the command line, with the nearest name where a command or an option is unknown."""
    from ...problems.errors import suggestion

    message = error.format_message().rstrip(".").partition(" (Possible")[0]
    command = getattr(getattr(error, "ctx", None), "command", None)
    option = getattr(error, "option_name", None)
    if option is not None and command is not None and message.startswith("No such option"):
        known = [name for parameter in command.params for name in parameter.opts]
        return f"there is no option {option}{suggestion(option, known)}"
    commands = getattr(command, "commands", None)
    if message.startswith("No such command") and commands:
        wrong = message.split("'")[1]
        return f"there is no command {wrong!r}{suggestion(wrong, commands)}"
    where = getattr(getattr(error, "ctx", None), "command_path", "proxbench")
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


@app.command("list", short_help="List solvers, problems, suites and scenes.")
def list_names(
    what: Annotated[str, typer.Argument(help="problems, solvers, suites or scenes; all if left out.")] = "",
    plugin: PluginFiles = None,
    as_json: Json = False,
) -> None:
    """List what there is: solvers and scenes with their options, suites, problems."""
    from .listing import listed, print_listing

    names = listed(what)
    if as_json:
        print(json.dumps(names, indent=1, ensure_ascii=False))
    else:
        print_listing(names)


@app.command(short_help="Remake problems from their scenes.")
def generate(
    names: Annotated[list[str] | None, typer.Argument(help="Problems to remake from their scenes.")] = None,
    suite: Annotated[str, typer.Option(help="Remake all members of a suite that come from scenes.")] = "",
    output: Annotated[Path | None, typer.Option(help="Folder to write to; the cache folder if left out.")] = None,
    plugin: PluginFiles = None,
    as_json: Json = False,
) -> None:
    """Remake problems from their scenes; prints each file with the digest of its numbers."""
    from ...problems.catalog.catalog import suite_members
    from ...problems.catalog.storage import read_problem
    from ...problems.hard import HARD_CASES
    from ..errors import BenchError
    from ..generate import generate as make

    chosen = list(names or [])
    if suite:
        chosen += [name for name in suite_members(suite) if name not in HARD_CASES and name not in chosen]
        if not chosen:
            raise BenchError(f"no problem of the suite {suite!r} comes from a scene; its members are always at hand.")
    if not chosen:
        raise BenchError("name the problems to generate, or a --suite.")
    digests = {str(file): read_problem(file).digest for file in make(chosen, output)}
    if as_json:
        print(json.dumps(digests, indent=1))
    else:
        for file, digest in digests.items():
            print(f"{digest[:16]}  {file}")


@app.command(short_help="Measure solvers on problems.")
def run(
    context: typer.Context,
    suite: Annotated[str, typer.Option(help="Suite of problems.")] = "quick",
    problem: Annotated[list[str] | None, typer.Option(help="Problem instead of a suite; may be repeated.")] = None,
    solver: Annotated[
        list[str] | None, typer.Option(help="Solver with options, SORprox(relaxation=1.5); may be repeated.")
    ] = None,
    tolerance: Annotated[list[float] | None, typer.Option(help="Tolerance of the ladder; may be repeated.")] = None,
    results: Annotated[Path, typer.Option(help="Folder in which the folder of the run is made.")] = Path("results"),
    run_id: Annotated[str, typer.Option(help="Name of the run; date and time if left out.")] = "",
    resume: Annotated[Path | None, typer.Option(help="Folder of a run to finish; only what is missing.")] = None,
    retry_failed: Annotated[bool, typer.Option(help="With --resume: measure failed cases again.")] = False,
    solve_seconds: Annotated[float, typer.Option(help="Time limit of one solve [s].")] = 0.5,
    case_seconds: Annotated[float, typer.Option(help="Time limit of one case [s].")] = 60.0,
    memory: Annotated[int, typer.Option(help="Memory limit of one case [MB].")] = 2048,
    record: Annotated[
        bool, typer.Option("--record", help="Record how the iterations behave, one file a problem.")
    ] = False,
    plugin: PluginFiles = None,
    charts: Charts = True,
    quiet: Quiet = False,
    as_json: Json = False,
    progress: Annotated[bool, typer.Option(help="Show a progress bar.")] = True,
) -> int:
    """Measure solvers on problems; print the tables, and write tables and charts beside the results."""
    from rich.console import Console

    from ..measure import runner
    from ..measure.plan import Limits
    from ..report.progress import RunProgress

    _refuse_contradictions(context)
    _refuse_two_prints(quiet, as_json)
    with RunProgress(Console(stderr=True), hidden=not progress or quiet or as_json) as shown:
        if resume is not None:
            folder = runner.resume(resume, retry_failed, on_event=shown)
        else:
            limits = Limits(solve_seconds, case_seconds, memory * 2**20)
            folder = runner.run(problem, solver, suite, results, run_id or None, tolerance, limits, on_event=shown)
    if record:
        from ..recordings.solves import record_run

        record_run(folder)
    return _report(folder, charts, quiet, as_json)


@app.command(short_help="Record solvers iterating side by side, or a stored simulation.")
def record(
    problem: Annotated[str, typer.Argument(help="Problem to solve, or result file of a simulation (.npz).")],
    solver: Annotated[
        list[str] | None, typer.Option(help="Solver with options, SORprox(relaxation=1.5); repeat it to compare.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Recording to write, ending in .rrd; of a simulation, beside it if left out.")
    ] = None,
    plugin: PluginFiles = None,
    tolerance: Annotated[float, typer.Option(help="Judged residual to reach.")] = 1e-8,
    max_iterations: Annotated[int, typer.Option(help="Largest number of iterations of each solver.")] = 1000,
    max_seconds: Annotated[float, typer.Option(help="Largest time of each solver [s].")] = 60.0,
    still: Annotated[Path | None, typer.Option(help="Picture of its end to draw as well, ending in .png.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing recording and picture.")] = False,
    as_json: Json = False,
) -> int:
    """Record what solvers do in each iteration, side by side, or a stored simulation, to watch it with: rerun FILE."""
    from ...solvers.interface import Stop
    from ..errors import BenchError
    from ..measure.plan import make_plan, resolved
    from ..recordings.blueprints import ITERATION
    from ..recordings.solves import record_solves
    from ..recordings.still import refuse_still, write_still

    if problem.endswith(".npz"):
        from .stored_simulations import record_simulation

        if solver:
            raise BenchError(f"{problem} holds a simulation with its solver; leave --solver out.")
        return record_simulation(Path(problem), output, force, as_json)
    for option, given in (("--solver", solver), ("--output", output)):
        if not given:
            raise BenchError(f"a recording of solvers needs {option}; see proxbench record --help.")
    assert solver is not None
    assert output is not None
    if still is not None:
        refuse_still(still, force)
    plan = make_plan([problem], solver, tolerances=[tolerance])
    stop = Stop(tolerance, max_iterations, max_seconds)
    made = record_solves(resolved(plan.problems[0]), plan.solvers, stop, output, force)
    if still is not None:
        write_still(made.file, still, ITERATION)
    if as_json:
        document = {"file": str(made.file), "solves": made.summary()} | ({} if still is None else {"still": str(still)})
        print(json.dumps(document, indent=1, ensure_ascii=False))
    else:
        for trace in made.traces:
            print(f"{trace.solver}: {trace.sentence}")
        print(f"watch it with: rerun {made.file}")
        if still is not None:
            print(f"still: {still}")
    return int(any(trace.failed for trace in made.traces))


_STORED_WITH_THE_RUN = (
    "suite",
    "problem",
    "solver",
    "tolerance",
    "results",
    "run_id",
    "solve_seconds",
    "case_seconds",
    "memory",
)
"""Options that --resume takes from the stored run."""


def _refuse_contradictions(context: typer.Context) -> None:
    """Raise a BenchError if one option of ``run`` would make it ignore another."""
    from ..errors import BenchError

    given = {
        name for name in context.params if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"
    }
    if "resume" in given:
        for name in _STORED_WITH_THE_RUN:
            if name in given:
                option = name.replace("_", "-")
                raise BenchError(f"--{option} is stored with the run and cannot be changed by --resume; leave it out.")
    elif "retry_failed" in given:
        raise BenchError("--retry-failed needs the run whose failed cases are measured again: --resume RUN.")
    if {"suite", "problem"} <= given:
        raise BenchError("--suite and --problem exclude each other; give one of them.")


app.command(short_help="Simulate a scene, every step judged; resumable.")(simulate)
app.command(short_help="Hold every solver against every hard case.")(matrix)


@app.command(short_help="Hold solvers and problems to what they owe.")
def check(
    target: Annotated[
        str, typer.Argument(help="Solver (with options) or problem, or a plugin file.", metavar="NAME|FILE")
    ],
    seconds: Annotated[float, typer.Option(help="Time limit of one check [s].")] = 60.0,
    plugin: PluginFiles = None,
    as_json: Json = False,
) -> int:
    """Hold a solver or problem to what it owes its users; exit code 1 if a check fails."""
    from rich.console import Console

    from ..conformance.run import checked, print_checks
    from ..report.progress import ProgressBar

    with ProgressBar(Console(stderr=True), hidden=as_json) as shown:

        def show(what: str, done: int, total: int) -> None:
            shown.name(what, again=True)
            shown.count(done, total)

        subjects = checked(target, seconds, show)
    if as_json:
        print(json.dumps(subjects, indent=1, ensure_ascii=False))
    else:
        print_checks(subjects)
    return int(not all(subject["passed"] for subject in subjects))


@app.command(short_help="Print tables and draw charts of what is stored.")
def report(
    run_dir: Annotated[
        Path, typer.Argument(help="Folder of a stored run, file of a study (.json) or of a simulation (.npz).")
    ],
    plugin: PluginFiles = None,
    charts: Charts = True,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Print the tables of a stored run, study or simulation, and draw its charts again."""
    _refuse_two_prints(quiet, as_json)
    if run_dir.suffix == ".json":
        from .study import report_study

        return report_study(run_dir, charts, quiet, as_json)
    if run_dir.suffix == ".npz" and not run_dir.is_dir():
        from .stored_simulations import report_simulation

        return report_simulation(run_dir, as_json)
    return _report(run_dir, charts, quiet, as_json)


def _refuse_two_prints(quiet: bool, as_json: bool) -> None:
    from ..errors import BenchError

    if quiet and as_json:
        raise BenchError("--quiet and --json exclude each other; give one of them.")


def _report(run_dir: Path, charts: bool, quiet: bool, as_json: bool) -> int:
    """Write and print what a run has to show; return 1 if something measured failed."""
    from rich.console import Console

    from ..report.presenting import FILE_WIDTH
    from ..report.tables import print_tables, results_table, summary_table, write_tables
    from ..store.frames import load
    from ..store.outcome import FAULTS, Outcome

    frames = load(run_dir)
    tables = write_tables(frames, run_dir / "tables")
    drawn: list[Path] = []
    if charts:
        from ..report.charts import write_charts  # altair takes a second to import

        drawn = write_charts(frames, run_dir / "charts")
    for sentence in frames.damaged:
        print(f"proxbench: {sentence}", file=sys.stderr)
    if as_json:
        document: dict[str, Any] = {
            "run": str(run_dir),
            "info": frames.info,
            "results": json.loads(results_table(frames).to_json(orient="records")),
            "summary": json.loads(summary_table(frames).to_json(orient="records")),
            "files": [str(file) for file in (*tables, *drawn)],
            "damaged": frames.damaged,
        }
        print(json.dumps(document, indent=1, ensure_ascii=False))
    else:
        console = Console(width=None if sys.stdout.isatty() else FILE_WIDTH)
        if not quiet:
            print_tables(frames, console)
            console.print()
        places = [f"results  {run_dir}", f"tables   {run_dir / 'tables'}"]
        if charts:
            places.append(f"charts   {run_dir / 'charts'}")
        if (run_dir / "recordings").is_dir():
            places.append(f"watch    rerun {run_dir / 'recordings'}/NAME.rrd")
        console.print("\n".join(places), soft_wrap=True)
    failed = frames.cases["outcome"].isin(FAULTS).any() or (frames.points["outcome"] == Outcome.WRONG).any()
    return int(failed)
