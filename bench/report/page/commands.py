"""Commands that measure a run, or a case of it, again."""

import shlex
from collections.abc import Iterable, Sequence
from itertools import groupby

from ....problems.catalog.catalog import suite_members
from ....problems.errors import ProblemError
from ...store.records import RunRecord

MEBIBYTE = 2**20


def run_command(run: RunRecord) -> str:
    """Return the command that measures a run again, in lines; files, folders and plugins must be where they were."""
    plan = run.plan
    selection = [("suite", plan.suite)] if plan.suite else [("problem", name) for name in plan.problems]
    if plan.suite and 0 < len(plan.problems) < _size(plan.suite):
        selection.append(("sample", str(len(plan.problems))))
    return _command(selection, plan.solvers, run)


def case_command(run: RunRecord, problem: str, solver: str) -> str:
    """Return the command that measures one problem with one solver under the limits of a run."""
    return _command([("problem", problem)], [solver], run)


def _command(selection: Iterable[tuple[str, str]], solvers: Sequence[str], run: RunRecord) -> str:
    plan, limits = run.plan, run.plan.limits
    options = [
        *selection,
        *(("solver", name) for name in solvers),
        *(("tolerance", f"{tolerance:g}") for tolerance in plan.tolerances),
        ("passes", str(plan.passes)),
        ("seed", str(plan.seed)),
        ("solve-seconds", f"{limits.solve_seconds:g}"),
        ("case-seconds", f"{limits.case_seconds:g}"),
        ("memory", str(round(limits.memory_bytes / MEBIBYTE))),
        *(("plugin", file) for file in dict.fromkeys(use.file for use in run.plugins if use.file)),
    ]
    lines = groupby((f"--{name} {_quoted(value)}" for name, value in options), key=lambda one: one.split()[0])
    return " \\\n  ".join(["proxbench run", *(" ".join(of_one) for _, of_one in lines)])


def _quoted(value: str) -> str:
    """Return a value as one word of a shell, in double quotes where it has single ones and nothing else."""
    return f'"{value}"' if "'" in value and not set('"$`\\!\n') & set(value) else shlex.quote(value)


def _size(suite: str) -> int:
    """Return how many problems a named suite has; 0 for a folder."""
    try:
        return len(suite_members(suite))
    except ProblemError:
        return 0
