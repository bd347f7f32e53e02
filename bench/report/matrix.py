"""The matrix of solvers and problems as a page: what each method can, and why not where it cannot."""

import math
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...problems.catalog.catalog import load
from ...problems.contact.judge import judge
from ...problems.errors import ProxbenchError
from ...problems.hard import CASE_GROUPS
from ..measure.matrix import BAD_OUTCOMES, Cell
from ..store.outcome import Outcome
from .text import inline

MARKS = {
    Outcome.SOLVED: "✓",
    Outcome.UNSUPPORTED: "·",
    Outcome.RELAXED: "R",
    Outcome.INFEASIBLE: "∅",
    Outcome.OSCILLATING: "O",
    Outcome.DIVERGED: "D",
    Outcome.STALLED: "S",
    Outcome.ITERATION_LIMIT: "I",
    Outcome.TIME_LIMIT: "T",
}
"""One character for each ending; what has none is a fault and spelled out."""

_LEGEND = (
    "✓ solved, · unsupported, R solves its own, relaxed model, ∅ reports that there is no solution, O oscillates, "
    "D diverges, S stalls, I iteration limit, T time limit; behind a mark that is no success stands the order of the "
    "judged residual that was reached."
)


def matrix_page(cells: Sequence[Cell], tolerance: float, command: str, state: str = "") -> str:
    """Return the matrix as a Markdown page.

    Args:
        cells: every solver on every problem.
        tolerance: the judged residual to reach.
        command: the command line that makes the page.
        state: paragraphs about the run that it comes from.
    """
    cells = [
        replace(cell, problem=inline(cell.problem), solver=inline(cell.solver), reason=inline(cell.reason))
        for cell in cells
    ]
    solvers = list(dict.fromkeys(cell.solver for cell in cells))
    problems = list(dict.fromkeys(cell.problem for cell in cells))
    lines = [
        "# What each solver can solve",
        "",
        *state.splitlines(),
        f"{len(problems)} problems, {len(solvers)} solvers, {len(cells)} cells; tolerance, a judged residual of "
        f"{tolerance:g}. Made by `{command}`; times and their limits are those of one machine.",
        "",
        *_summary(cells, solvers),
        "",
        "## Which solver solves which problem",
        "",
        _LEGEND,
        "",
        *_grid(cells, solvers, problems),
        "",
        "## What none of them solves",
        "",
        *_unsolved(cells, problems, tolerance),
        "",
        "## Why not",
        "",
        "Numbers in a reason are those of the first problem that it is given for.",
        "",
        *_reasons(cells, solvers),
    ]
    return "\n".join(lines) + "\n"


def count_bad(cells: Sequence[Cell]) -> int:
    """Return how many cells end in what no cell may: wrong claims, faults, numbers that are not finite."""
    return sum(cell.outcome in BAD_OUTCOMES or not cell.is_finite for cell in cells)


def _summary(cells: Sequence[Cell], solvers: list[str]) -> list[str]:
    counted = [outcome for outcome in MARKS if any(cell.outcome is outcome for cell in cells)]
    rows = [["solver", *(str(outcome) for outcome in counted), "wrong", "not finite", "faults"]]
    for solver in solvers:
        own = [cell for cell in cells if cell.solver == solver]
        wrong = sum(cell.outcome is Outcome.WRONG for cell in own)
        faults = sum(cell.outcome in BAD_OUTCOMES and cell.outcome is not Outcome.WRONG for cell in own)
        counts = [sum(cell.outcome is outcome for cell in own) for outcome in counted]
        rows.append([f"`{solver}`", *map(str, counts), str(wrong), str(sum(not c.is_finite for c in own)), str(faults)])
    return _table(rows)


def _grid(cells: Sequence[Cell], solvers: list[str], problems: list[str]) -> list[str]:
    found = {(cell.problem, cell.solver): cell for cell in cells}
    heads = [str(number) for number, _ in enumerate(solvers, start=1)]
    lines = [f"{number}. `{solver}`" for number, solver in enumerate(solvers, start=1)]
    for group, members in _grouped(problems).items():
        rows = [["problem", *heads]]
        rows += [[name, *(_mark(found.get((name, solver))) for solver in solvers)] for name in members]
        lines += ["", f"**{group}**" if group else "", "", *_table(rows)]
    return lines


def _grouped(problems: list[str]) -> dict[str, list[str]]:
    group_of = {name: group for group, members in CASE_GROUPS.items() for name in members}
    grouped: dict[str, list[str]] = defaultdict(list)
    for name in problems:
        grouped[group_of.get(name, "")].append(name)
    return grouped


def _mark(cell: Cell | None) -> str:
    if cell is None:
        return ""
    mark = MARKS.get(cell.outcome, str(cell.outcome))
    is_plain = cell.outcome in (Outcome.SOLVED, Outcome.UNSUPPORTED, Outcome.INFEASIBLE)
    return mark if is_plain or not 0.0 < cell.residual < math.inf else f"{mark} {_order(cell.residual)}"


def _order(residual: float) -> str:
    """Return the power of ten of a residual, a superscript without the ten: −3 for 2e-3."""
    return str(math.floor(math.log10(residual))).replace("-", "−")


def _unsolved(cells: Sequence[Cell], problems: list[str], tolerance: float) -> list[str]:
    lines = []
    for name in problems:
        own = [cell for cell in cells if cell.problem == name]
        if any(cell.outcome is Outcome.SOLVED for cell in own):
            continue
        best = min(own, key=lambda cell: cell.residual if np.isfinite(cell.residual) else math.inf)
        lines.append(f"* {name}: {_why_unsolved(name, best, tolerance)}")
    return lines or ["Each problem is solved by at least one solver."]


def _why_unsolved(name: str, best: Cell, tolerance: float) -> str:
    try:
        problem = load(name)
    except ProxbenchError:  # a run may hold problems that no catalogue knows
        return f"{best.solver} comes nearest, to {best.residual:.1e}: {best.reason}."
    answer = problem.answer
    if answer is not None and not answer.solvable:
        return "it has no solution, and no solver claims one."
    if answer is not None and answer.impulses and problem.n_rows:
        floor = min(judge(problem, impulses).residual for impulses in answer.impulses)
        if floor > tolerance:
            return (
                f"the known solution itself, rounded to double precision, has a residual of {floor:.1e}; "
                f"{best.solver} comes to {best.residual:.1e}."
            )
    return f"{best.solver} comes nearest, to {best.residual:.1e}: {best.reason}."


def _reasons(cells: Sequence[Cell], solvers: list[str]) -> list[str]:
    lines = []
    for solver in solvers:
        grouped: dict[tuple[str, str], list[Cell]] = defaultdict(list)
        for cell in cells:
            if cell.solver == solver and cell.outcome is not Outcome.SOLVED:
                grouped[str(cell.outcome), re.sub(r"[0-9][0-9.e+-]*", "…", cell.reason)].append(cell)
        if not grouped:
            continue
        rows = [["ended", "reason", "problems"]]
        for (outcome, _), members in grouped.items():
            names = ", ".join(cell.problem.removeprefix("hard-") for cell in members)
            rows.append([outcome, members[0].reason, names])
        lines += [f"### {solver}", "", *_table(rows), ""]
    return lines


def _table(rows: list[list[str]]) -> list[str]:
    head, *body = rows
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *body)]
