"""``proxbench record``: recordings of solvers that iterate, and of stored simulations."""

from pathlib import Path
from typing import Annotated

import typer

from . import options


def record(
    problem: Annotated[
        str, typer.Argument(metavar="PROBLEM|FILE", help="Problem to solve, or file of one or of a simulation.")
    ],
    solver: options.Solvers = None,
    output: Annotated[
        Path | None, options.output(metavar="FILE", help="Recording (.rrd); a simulation's is put beside it.")
    ] = None,
    plugin: options.PluginFiles = None,
    tolerance: Annotated[float, options.limits(help="Residual to reach.")] = 1e-8,
    max_iterations: Annotated[int, options.limits(help="Iterations of one solver.")] = 1000,
    max_seconds: Annotated[float, options.limits(metavar="SECONDS", help="Time of one solver.")] = 60.0,
    still: Annotated[Path | None, options.output(metavar="FILE", help="Draw the end as a picture (.png) too.")] = None,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Record solvers iterating side by side on one problem, or a stored simulation; watch with: rerun FILE."""
    from ...problems.contact.solver import Stop
    from ..measure.plan import make_plan
    from ..plugins.problems import resolved
    from ..recordings.blueprints import ITERATION, STEP
    from ..recordings.solves import record_solves
    from ..recordings.still import refuse_still, write_still
    from ..report.layout.text import print_json
    from ..simulation.file import is_result
    from ..store.plans import RunSettings
    from .simulation.show import record_simulation

    options.refuse_two_prints(quiet, as_json)
    is_simulation = problem.endswith(".npz") and is_result(Path(problem))
    _refuse_contradictions(problem, is_simulation, solver, output)
    if still is not None:
        refuse_still(still, force)
    file, made = output or Path(problem).with_suffix(".rrd"), None
    if is_simulation:
        record_simulation(Path(problem), file, force)
    else:
        plan = make_plan([problem], solver, RunSettings.checked([tolerance]))
        stop = Stop(tolerance, max_iterations, max_seconds)
        made = record_solves(resolved(plan.problems[0]), plan.solvers, stop, file, force)
    if still is not None:
        write_still(file, still, STEP if is_simulation else ITERATION)
    traces = () if made is None else made.traces
    if as_json:
        solves = {} if made is None else {"solves": made.summary()}
        print_json({"file": str(file), **solves, **({} if still is None else {"still": str(still)})})
    else:
        for trace in () if quiet else traces:
            print(f"{trace.solver}: {trace.sentence}")
        print(f"watch it with: rerun {file}")
        if still is not None:
            print(f"still: {still}")
    return int(any(trace.failed for trace in traces))


def _refuse_contradictions(problem: str, is_simulation: bool, solver: list[str] | None, output: Path | None) -> None:
    from ..errors import BenchError

    if is_simulation:
        if solver:
            raise BenchError(f"{problem} holds a simulation with its solver; leave --solver out.")
        return
    for option, given in (("--solver", solver), ("--output", output)):
        if not given:
            raise BenchError(f"a recording of solvers needs {option}; see proxbench record -h.")
