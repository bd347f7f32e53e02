"""``proxbench record``: recordings of solvers that iterate, and of stored simulations."""

import json
from pathlib import Path
from typing import Annotated

import typer

from .help import OUTPUT
from .options import LIMITS, Json, PluginFiles, Quiet, Solvers, refuse_two_prints


def record(
    problem: Annotated[
        str, typer.Argument(metavar="PROBLEM|FILE", help="Problem to solve, or file of a simulation (.npz).")
    ],
    solver: Solvers = None,
    output: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Recording (.rrd); a simulation's is put beside it.", rich_help_panel=OUTPUT),
    ] = None,
    plugin: PluginFiles = None,
    tolerance: Annotated[float, typer.Option(help="Residual to reach.", rich_help_panel=LIMITS)] = 1e-8,
    max_iterations: Annotated[int, typer.Option(help="Iterations of one solver.", rich_help_panel=LIMITS)] = 1000,
    max_seconds: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time of one solver.", rich_help_panel=LIMITS)
    ] = 60.0,
    still: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the end as a picture (.png) too.", rich_help_panel=OUTPUT),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.", rich_help_panel=OUTPUT)] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Record solvers iterating side by side on one problem, or a stored simulation; watch with: rerun FILE."""
    from ...solvers.interface import Stop
    from ..errors import BenchError
    from ..measure.plan import make_plan
    from ..measure.problems import resolved
    from ..recordings.blueprints import ITERATION
    from ..recordings.solves import record_solves
    from ..recordings.still import refuse_still, write_still

    refuse_two_prints(quiet, as_json)
    if problem.endswith(".npz"):
        from .simulation import record_simulation

        if solver:
            raise BenchError(f"{problem} holds a simulation with its solver; leave --solver out.")
        return record_simulation(Path(problem), output, still, force, as_json)
    for option, given in (("--solver", solver), ("--output", output)):
        if not given:
            raise BenchError(f"a recording of solvers needs {option}; see proxbench record -h.")
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
        for trace in () if quiet else made.traces:
            print(f"{trace.solver}: {trace.sentence}")
        print(f"watch it with: rerun {made.file}")
        if still is not None:
            print(f"still: {still}")
    return int(any(trace.failed for trace in made.traces))
