"""Commands that repeat a run, one of its cases, or another measurement, on several lines."""

import shlex
from collections.abc import Iterable
from pathlib import Path

from ...store.records import RunRecord

LINE_BREAK = " \\\n  "
"""Line continuation of a shell command."""


def repeat_command(run: RunRecord) -> str:
    """Return the command that repeats a run, provided that files, folders and plugins have not moved."""
    plan = run.plan
    if plan.requested and not plan.missing_shards:
        selection = [option("suite" if plan.suite else "problem", name) for name in plan.requested]
        selection += sample_options(plan.sample, plan.sampling)
        selection += [option("shard", plan.shard)] if plan.shard else []
    else:  # the selection is unknown, or the run is merged from different ones or from some shards
        selection = [option("problem", name) for name in plan.problems]
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
        "solve-seconds": shortest(limits.solve_seconds),
        "case-seconds": shortest(limits.case_seconds),
        "memory": round(limits.memory_bytes / 2**20),
    }
    lines = [
        " ".join(option("tolerance", shortest(tolerance)) for tolerance in plan.tolerances),
        " ".join(option(name, value) for name, value in options.items()),
        *plugin_options(use.file for use in run.plugins if use.file),
    ]
    return LINE_BREAK.join(lines)


def sample_options(sample: int | None, sampling: str) -> list[str]:
    """Return the options that draw a sample of problems; none without a sample."""
    return [] if sample is None else [option("sample", sample), option("sampling", sampling)]


def plugin_options(files: Iterable[str | Path]) -> list[str]:
    """Return an option for each plugin file."""
    return [option("plugin", file) for file in dict.fromkeys(files)]


def option(name: str, value: object) -> str:
    """Return an option with its value, quoted for a shell."""
    text = str(value)
    in_double_quotes = "'" in text and not set('"$`\\!\n') & set(text)
    return f'--{name} "{text}"' if in_double_quotes else f"--{name} {shlex.quote(text)}"


def shortest(value: float) -> str:
    """Return a text that is read as ``value``, with at most six digits if these suffice."""
    text = f"{value:g}"
    return text if float(text) == value else repr(float(value))
