"""Commands that repeat a run or one of its cases, on several lines."""

import shlex

from ....problems.errors import ProblemError
from ....problems.exchange.catalog import suite_members
from ...store.records import RunRecord

LINE_BREAK = " \\\n  "
"""Line continuation of a shell command."""


def repeat_command(run: RunRecord) -> str:
    """Return the command that repeats a run, provided that files, folders and plugins have not moved."""
    plan = run.plan
    selection = [option("suite", plan.suite)] if plan.suite else [option("problem", name) for name in plan.problems]
    if plan.shard:
        selection.append(option("shard", plan.shard))
    elif plan.suite and 0 < len(plan.problems) < _suite_size(plan.suite):
        selection.append(option("sample", len(plan.problems)))
    solvers = [option("solver", name) for name in plan.solvers]
    return LINE_BREAK.join(["proxbench run", *selection, *solvers, protocol_options(run)])


def protocol_options(run: RunRecord) -> str:
    """Return the options of a run except for its problems and solvers.

    To repeat a case, add these options to ``proxbench run`` with its problem and its solver.
    """
    plan, limits = run.plan, run.plan.limits
    options = {
        "passes": plan.passes,
        "seed": plan.seed,
        "solve-seconds": f"{limits.solve_seconds:g}",
        "case-seconds": f"{limits.case_seconds:g}",
        "memory": round(limits.memory_bytes / 2**20),
    }
    lines = [
        " ".join(option("tolerance", f"{tolerance:g}") for tolerance in plan.tolerances),
        " ".join(option(name, value) for name, value in options.items()),
        *(option("plugin", file) for file in dict.fromkeys(use.file for use in run.plugins if use.file)),
    ]
    return LINE_BREAK.join(lines)


def option(name: str, value: object) -> str:
    """Return an option with its value, quoted for a shell."""
    text = str(value)
    in_double_quotes = "'" in text and not set('"$`\\!\n') & set(text)
    return f'--{name} "{text}"' if in_double_quotes else f"--{name} {shlex.quote(text)}"


def _suite_size(suite: str) -> int:
    """Return the number of problems of a named suite; 0 for a folder."""
    try:
        return len(suite_members(suite))
    except ProblemError:
        return 0
