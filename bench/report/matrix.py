"""The matrix of solvers and problems as a page: what each method can, and why not where it cannot."""

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import pandas as pd

from ...problems.contact.judge import judge
from ...problems.errors import ProxbenchError
from ...problems.exchange.catalog import load
from ...problems.hard import CASE_GROUPS
from ..store.outcome import BAD_OUTCOMES, FAULTS, Cell, Outcome
from .layout.text import inline, markdown_table

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

_GROUP_OF = {name: group for group, members in CASE_GROUPS.items() for name in members}

_PAGE = """\
# What each solver can solve

{state}{n_problems} problems, {n_solvers} solvers, {n_cells} cells; tolerance, a judged residual of {tolerance:g}. \
Made by `{command}`; times and their limits are those of one machine.

{summary}
## Which solver solves which problem

✓ solved, · unsupported, R solves its own, relaxed model, ∅ reports that there is no solution, O oscillates, \
D diverges, S stalls, I iteration limit, T time limit; behind a mark that is no success stands the order of the \
judged residual that was reached.

{grid}
## What none of them solves

{unsolved}

## Why not

Numbers in a reason are those of the first problem that it is given for.

{reasons}"""


def matrix_page(cells: Sequence[Cell], tolerance: float, command: str, state: str = "") -> str:
    """Return the matrix as a Markdown page.

    Args:
        cells: every solver on every problem.
        tolerance: the judged residual to reach.
        command: the command line that makes the page.
        state: paragraphs about the run that it comes from.
    """
    found = pd.DataFrame(list(cells), columns=[field.name for field in fields(Cell)])
    for texts in ("problem", "solver", "reason"):
        found[texts] = found[texts].map(inline)
    return _PAGE.format(
        state=state,
        n_problems=found["problem"].nunique(),
        n_solvers=found["solver"].nunique(),
        n_cells=len(found),
        tolerance=tolerance,
        command=command,
        summary=_summary(found),
        grid=_grid(found),
        unsolved=_unsolved(found, tolerance),
        reasons=_reasons(found),
    )


def count_bad(cells: Sequence[Cell]) -> int:
    """Return how many cells end in what no cell may: wrong claims, faults, numbers that are not finite."""
    return sum(cell.outcome in BAD_OUTCOMES or not cell.is_finite for cell in cells)


def _summary(found: pd.DataFrame) -> str:
    outcomes = found["outcome"]
    counted = {str(outcome): outcomes == outcome for outcome in MARKS if (outcomes == outcome).any()}
    counted |= {"wrong": outcomes == Outcome.WRONG, "not finite": ~found["is_finite"], "faults": outcomes.isin(FAULTS)}
    counts = pd.DataFrame(counted).groupby(found["solver"], sort=False).sum()
    return markdown_table(["solver", *counts], [[f"`{solver}`", *row] for solver, *row in counts.itertuples()])


def _grid(found: pd.DataFrame) -> str:
    solvers = found["solver"].unique()
    numbers = range(1, len(solvers) + 1)
    text = "".join(f"{number}. `{solver}`\n" for number, solver in zip(numbers, solvers, strict=True))
    cells = found.to_dict("records")
    marks = {(cell["problem"], cell["solver"]): _mark(cell["outcome"], cell["residual"]) for cell in cells}
    names = found["problem"].drop_duplicates()
    for group, members in names.groupby(names.map(lambda name: _GROUP_OF.get(name, "")), sort=False):
        rows = [[name, *(marks.get((name, solver), "") for solver in solvers)] for name in members]
        text += f"\n**{group}**\n\n" if group else "\n\n\n"
        text += markdown_table(["problem", *numbers], rows)
    return text


def _mark(outcome: Outcome, residual: float) -> str:
    """Return the mark of an ending with the power of ten of the residual, a superscript without the ten."""
    mark = MARKS.get(outcome, str(outcome))
    is_plain = outcome in (Outcome.SOLVED, Outcome.UNSUPPORTED, Outcome.INFEASIBLE)
    if is_plain or not 0.0 < residual < math.inf:
        return mark
    return f"{mark} {math.floor(math.log10(residual))}".replace("-", "−")


def _unsolved(found: pd.DataFrame, tolerance: float) -> str:
    lines = []
    for name, cells in found.groupby("problem", sort=False):
        if (cells["outcome"] == Outcome.SOLVED).any():
            continue
        best = cells.iloc[int(cells["residual"].fillna(math.inf).argmin())]
        lines.append(f"* {name}: {_why_unsolved(str(name), best, tolerance)}")
    return "\n".join(lines) or "Each problem is solved by at least one solver."


def _why_unsolved(name: str, best: "pd.Series[Any]", tolerance: float) -> str:
    nearest = f"{best['solver']} comes nearest, to {best['residual']:.1e}: {best['reason']}."
    try:
        problem = load(name)
    except ProxbenchError:  # a run may hold problems that no catalogue knows
        return nearest
    answer = problem.answer
    if answer is not None and not answer.solvable:
        return "it has no solution, and no solver claims one."
    if answer is not None and answer.impulses and problem.n_rows:
        floor = min(judge(problem, impulses).residual for impulses in answer.impulses)
        if floor > tolerance:
            return (
                f"the known solution itself, rounded to double precision, has a residual of {floor:.1e}; "
                f"{best['solver']} reaches {best['residual']:.1e}."
            )
    return nearest


def _reasons(found: pd.DataFrame) -> str:
    text = ""
    for solver, cells in found.groupby("solver", sort=False):
        failed = cells[cells["outcome"] != Outcome.SOLVED]
        alike = failed["reason"].str.replace(r"[0-9][0-9.e+-]*", "…", regex=True)
        rows = [
            [ended, own["reason"].iloc[0], ", ".join(own["problem"].str.removeprefix("hard-"))]
            for (ended, _), own in failed.groupby([failed["outcome"], alike], sort=False)
        ]
        if rows:
            text += f"### {solver}\n\n{markdown_table(['ended', 'reason', 'problems'], rows)}\n"
    return text
