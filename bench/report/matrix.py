"""The matrix of solvers and problems as a page and as a table, with the reasons for failures."""

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import pandas as pd

from ...problems.contact.judge import judge
from ...problems.errors import ProxbenchError
from ...problems.exchange.catalog import load
from ...problems.exchange.families import family_of
from ..store.outcome import BAD_OUTCOMES, WRONG_FACTOR, Cell, Outcome
from .layout.text import counted, inline, markdown_table

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
"""One character for each ending; faults, wrong claims and other endings are spelled out."""

MAX_NAMED_SOLVERS = 4
"""Largest number of solvers that the table of reasons names; if there are more, it names one fewer and a count."""

MAX_REASON_LENGTH = 160
"""Largest number of characters of a reason; longer ones are reduced to the first and the last two clauses."""

_NONE_BAD = "No solver makes a wrong claim, returns numbers that are not finite, crashes, hangs or misbehaves."
"""Sentence below the table of outcomes if no cell is bad, see ``count_bad``."""

_PAGE = """\
# What each solver can solve

{state}{counts}. The tolerance is {tolerance:g}. A cell is solved if the solver reports a solution and the judged \
residual is at most {limit:g}, infeasible if the solver reports that there is none, and relaxed if the answer \
satisfies the solver's own model, but not Coulomb friction. The command `{command}` writes this page. \
Which cells reach the time limit depends on the machine.

{summary}
{grid}
## Problems that no solver solves

{unsolved}

## Reasons

Every outcome except solved and infeasible has a reason. The numbers in a reason are those of the first cell with \
this reason.

{reasons}"""
"""The page; ``grid`` is one of the two sections that follow."""

_FAMILIES = """\
## Solved problems by family

Each column counts the problems of a family that the solver solves, out of those that it supports. A dash means that \
it supports none. [{table}]({table}) contains the result of every solver on every problem.

{counts}"""
"""Section of counts by family, for a page with a link to the table of all cells."""

_GRID = """\
## Which solver solves which problem

✓ solved, · unsupported, R solves its own, relaxed model, ∅ reports that there is no solution, O oscillates, \
D diverges, S stalls, I iteration limit, T time limit. The number after a failure is the order of magnitude of the \
judged residual.

{cells}"""
"""Section that shows all cells."""


def matrix_page(cells: Sequence[Cell], tolerance: float, command: str, state: str = "", table: str = "") -> str:
    """Return the matrix as a Markdown page.

    Args:
        cells: every solver on every problem.
        tolerance: the judged residual to reach.
        command: the command line that writes the page.
        state: paragraphs about the run from which the matrix comes.
        table: link to the file of ``matrix_table``; the page then counts by family. Without a link, it shows all
            cells.
    """
    frame = pd.DataFrame(list(cells), columns=[field.name for field in fields(Cell)])
    for column in ("problem", "solver", "reason"):
        frame[column] = frame[column].map(inline)
    grid = _FAMILIES.format(table=table, counts=_family_counts(frame)) if table else _GRID.format(cells=_grid(frame))
    return _PAGE.format(
        state=state,
        counts=f"{counted(frame['problem'].nunique(), 'problem')}, {counted(frame['solver'].nunique(), 'solver')}, "
        f"{counted(len(frame), 'cell')}",
        tolerance=tolerance,
        limit=WRONG_FACTOR * tolerance,
        command=command,
        summary=_summary(frame),
        grid=grid,
        unsolved=_unsolved(frame, tolerance),
        reasons=_reasons(frame),
    )


def matrix_table(cells: Sequence[Cell]) -> pd.DataFrame:
    """Return the outcome of every cell: one row per problem with its family, one column per solver.

    A failure is followed by the order of magnitude of the judged residual, as in ``"stalled 1e-05"``.
    """
    outcomes: dict[str, dict[str, str]] = {}
    for cell in cells:
        row = {"problem": cell.problem, "family": _family(cell.problem)}
        outcomes.setdefault(cell.problem, row)[cell.solver] = _outcome_text(cell)
    return pd.DataFrame(outcomes.values())


def count_bad(cells: Sequence[Cell]) -> int:
    """Return the number of cells with wrong claims, faults, or numbers that are not finite."""
    return sum(cell.outcome in BAD_OUTCOMES or not cell.is_finite for cell in cells)


def _summary(frame: pd.DataFrame) -> str:
    """Return the table of the outcomes of each solver."""
    rows = []
    for solver, own in frame.groupby("solver", sort=False):
        counts = own["outcome"].value_counts()
        other_outcomes = [
            f"{counts[outcome]} {outcome}"
            for outcome in Outcome
            if outcome in counts.index and outcome != Outcome.SOLVED
        ]
        n_infinite = int((~own["is_finite"]).sum())
        other_outcomes += [f"{n_infinite} not finite"] if n_infinite else []
        rows.append([f"`{solver}`", counts.get(Outcome.SOLVED, 0), ", ".join(other_outcomes)])
    table = markdown_table(["solver", "solved", "other outcomes"], rows)
    has_bad_outcome = frame["outcome"].isin(BAD_OUTCOMES).any() or not frame["is_finite"].all()
    return table if has_bad_outcome else f"{table}\n{_NONE_BAD}\n"


def _family_counts(frame: pd.DataFrame) -> str:
    """Return the table of solved and supported problems of each solver by family."""
    families = frame["problem"].map(lambda name: _family(name) or "others")
    names = families.drop_duplicates()
    is_supported = frame["outcome"] != Outcome.UNSUPPORTED
    rows = []
    for solver, own in frame.groupby("solver", sort=False):
        supported = is_supported[own.index].groupby(families[own.index]).sum()
        solved = (own["outcome"] == Outcome.SOLVED).groupby(families[own.index]).sum()
        counts = [f"{solved[name]}/{supported[name]}" if supported.get(name, 0) else "–" for name in names]
        rows.append([f"`{solver}`", *counts])
    return markdown_table(["solver", *names], rows)


def _grid(frame: pd.DataFrame) -> str:
    """Return the numbered solvers, and a table of the marks of all cells for each family."""
    solvers = frame["solver"].unique()
    text = "".join(f"{number}. `{solver}`\n" for number, solver in enumerate(solvers, 1))
    cells = frame.to_dict("records")
    marks = {(cell["problem"], cell["solver"]): _mark(cell["outcome"], cell["residual"]) for cell in cells}
    names = frame["problem"].drop_duplicates()
    for group, members in names.groupby(names.map(_family), sort=False):
        rows = [[name, *(marks.get((name, solver), "") for solver in solvers)] for name in members]
        text += f"\n**{group}**\n\n" if group else "\n\n\n"
        text += markdown_table(["problem", *range(1, len(solvers) + 1)], rows)
    return text


def _family(problem: str) -> str:
    """Return the family of a problem within its suite; empty for suites that are not divided into families."""
    return family_of(problem).partition(": ")[2]


def _mark(outcome: Outcome, residual: float) -> str:
    """Return the mark of an ending, followed by the power of ten of the residual of a failure."""
    mark = MARKS.get(outcome, str(outcome))
    order = _residual_order(outcome, residual)
    return mark if order is None else f"{mark} {order}".replace("-", "−")


def _outcome_text(cell: Cell) -> str:
    order = _residual_order(cell.outcome, cell.residual)
    return str(cell.outcome) if order is None else f"{cell.outcome} 1e{order:+03d}"


def _residual_order(outcome: Outcome, residual: float) -> int | None:
    """Return the power of ten of a failure's residual; None for other endings and without a residual."""
    has_no_order = outcome in (Outcome.SOLVED, Outcome.UNSUPPORTED, Outcome.INFEASIBLE)
    return None if has_no_order or not 0.0 < residual < math.inf else math.floor(math.log10(residual))


def _unsolved(frame: pd.DataFrame, tolerance: float) -> str:
    """Return a list of the problems that no solver solves, with explanations."""
    lines = []
    for name, cells in frame.groupby("problem", sort=False):
        if (cells["outcome"] == Outcome.SOLVED).any():
            continue
        lines.append(f"* {name}: {_why_unsolved(str(name), cells, tolerance)}")
    return "\n".join(lines) or "Each problem is solved by at least one solver."


def _why_unsolved(name: str, cells: pd.DataFrame, tolerance: float) -> str:
    """Return why no solver solves a problem with these cells."""
    best = cells.iloc[int(cells["residual"].fillna(math.inf).argmin())]
    nearest_text = _nearest_text(best)
    try:
        problem = load(name)
    except ProxbenchError:  # a run may contain problems that are in no catalogue
        return nearest_text
    answer = problem.answer
    if answer is not None and not answer.solvable:
        wrong = [f"`{solver}`" for solver in cells.loc[cells["outcome"] == Outcome.WRONG, "solver"]]
        claims = f"{_solver_names(wrong)} wrongly {'claims' if len(wrong) == 1 else 'claim'} one"
        return f"it has no solution, {'but ' + claims if wrong else 'and no solver claims one'}."
    if answer is not None and answer.impulses and problem.n_rows:
        floor = min(judge(problem, impulses).residual for impulses in answer.impulses)
        if floor > tolerance:
            return (
                f"the known solution itself, rounded to double precision, has a residual of {floor:.1e}; "
                f"{best['solver']} reaches {best['residual']:.1e}."
            )
    return nearest_text


def _nearest_text(best: "pd.Series[Any]") -> str:
    """Return a sentence on the cell with the smallest judged residual, which is NaN if no solver returned impulses."""
    reason = str(best["reason"]).removesuffix(".")
    if math.isnan(best["residual"]):
        return f"no solver returns impulses; {best['solver']}: {reason}."
    return f"{best['solver']} comes nearest, to {best['residual']:.1e}: {reason}."


def _reasons(frame: pd.DataFrame) -> str:
    """Return the table of reasons; reasons that differ only in numbers share a row."""
    failed = frame[~frame["outcome"].isin([Outcome.SOLVED, Outcome.INFEASIBLE])]
    patterns = failed["reason"].str.replace(r"[0-9][0-9.e+-]*", "…", regex=True)
    groups = [own for _, own in failed.groupby([failed["outcome"], patterns], sort=False)]
    groups.sort(key=lambda own: (str(own["outcome"].iloc[0]), -len(own)))
    rows = [
        [
            own["outcome"].iloc[0],
            len(own),
            _shortened(own["reason"].iloc[0]),
            _solver_names(list(own["solver"].unique())),
        ]
        for own in groups
    ]
    return (
        markdown_table(["outcome", "cells", "reason", "solvers"], rows)
        if rows
        else "Every cell is solved or infeasible.\n"
    )


def _shortened(reason: str) -> str:
    """Return the first and the last two clauses of a long reason; composite solvers give one clause per part."""
    clauses = reason.split("; ")
    is_long = len(reason) > MAX_REASON_LENGTH and len(clauses) > 2
    return f"{clauses[0]}; …; {clauses[-2]}; {clauses[-1]}" if is_long else reason


def _solver_names(solvers: Sequence[str]) -> str:
    if len(solvers) <= MAX_NAMED_SOLVERS:
        return ", ".join(solvers)
    return f"{', '.join(solvers[: MAX_NAMED_SOLVERS - 1])} and {len(solvers) - MAX_NAMED_SOLVERS + 1} others"
