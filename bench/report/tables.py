"""Tables of a run: the time to each accuracy on each problem, and the summary of each solver."""

import io
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from shlex import quote

import pandas as pd
from rich.console import Console
from rich.text import Text

from ...problems.contact.model import Model
from ..store.condition import residual_note, run_state, steadiness, warnings
from ..store.fields import accuracy_tag
from ..store.frames import CASE, JUDGED, RunFrames
from ..store.outcome import FAULTS, Cell, Outcome
from ..store.plans import PlanRecord
from .accuracy import (
    accuracies,
    compares_all,
    excluded_cases,
    excluded_times,
    families,
    families_table,
    problems_table,
    ratios_table,
    starts_table,
    summary_table,
    threads_by_solver,
    times_to_accuracies,
)
from .cells import (
    TIME,
    all_solve_coulomb,
    shown_families,
    shown_points,
    shown_problems,
    shown_ratios,
    shown_results,
    shown_starts,
    shown_summary,
    standings_of_cells,
    summary_tags,
    time_columns,
)
from .endings import attempted_points, case_endings, join_texts, limit_remedies
from .layout.output_file import write_file
from .layout.terminal_table import column_groups, print_table, wrap_note
from .layout.text import counted, csv_content, inline, latex_table, markdown_frame
from .matrix import matrix_page
from .studies import headline, points_table, print_points

_CASE_COLUMNS = ("problem", "family", "n_contacts", "solver", "threads", "threads_used", "model")
"""Columns of cases in the table of results."""

_MARKS = (
    "Bold: the fastest, if the 95 % intervals of all ratios to it lie above 1.05. ≈: possibly as fast as the fastest. "
    "Solvers are compared with those that use as many threads. tables/ratios has the intervals."
)
"""Legend of the marks of times."""

_BY_MODEL = "By model: the residual of the same solve by the model of the solver."
"""Legend of the residuals under other models than Coulomb's law."""

_FAMILIES = (
    "By family: problems that the judge confirms as solved, of those that the solver supports, and the shifted "
    "geometric mean time over those that all solvers support."
)
"""Legend of the table by family."""

_EXCLUDED_TIMES = "(n): over n of them, because times of the others are excluded; –: over none."
"""Continuation of legends if a mean omits problems because their times are excluded."""

_STARTS = (
    "From zero (cold) and from the answer to the step before (warm): solved steps, and over those solved both ways the "
    "mean iterations, the geometric mean times, their ratio (gain), and how many steps are slower warm by 5 % or more."
)
"""Legend of the table of starts."""

MAX_TABLES = 20
"""Largest number of problems for which each has its own printed table."""


def results_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row per case: time to each accuracy [s], residuals and iterations of the best solve, and how it ended.

    The best solve has the smallest residual by the model of the solver. Wrong claims do not count.

    Columns: problem, family, n_contacts, solver, threads (declared), threads_used (0 if unknown), model,
    ``time_to_1e-02`` … (of ``accuracies``), excluded (accuracies whose times have only excluded rounds), residual (by
    Coulomb's law), model_residual (by the model of the solver) and iterations (all of the best solve), outcome, reason,
    notes (of the finest point with notes).
    """
    levels, limit = accuracies(frames), frames.info.plan.limits.solve_seconds
    times = times_to_accuracies(frames.points, levels, limit)
    cases = frames.cases[list(_CASE_COLUMNS)]
    names = list(zip(cases["problem"], cases["solver"], strict=True))
    seconds = {
        TIME + accuracy_tag(accuracy): pd.Series(times[accuracy].to_dict(), dtype=float).reindex(names).to_numpy()
        for accuracy in levels
    }
    cases_by_tag = {accuracy_tag(accuracy): excluded_cases(frames.points, accuracy, limit) for accuracy in levels}
    excluded = [" ".join(tag for tag, cases_of_tag in cases_by_tag.items() if name in cases_of_tag) for name in names]
    trusted = attempted_points(frames)
    trusted = trusted[trusted["outcome"] != Outcome.WRONG]
    by_model = trusted["model_residual"].where(trusted["model"] != str(Model.COULOMB), trusted["residual"])
    best = trusted.loc[by_model.sort_values(kind="stable").index].drop_duplicates(CASE)
    table = cases.assign(**seconds, excluded=excluded)
    table = table.merge(best[[*CASE, "residual", "model_residual", "iterations"]], how="left", on=CASE)
    return table.astype({"residual": float, "model_residual": float, "iterations": float}).assign(
        **case_endings(frames).reset_index(drop=True)
    )


def write_tables(frames: RunFrames, folder: Path) -> list[Path]:
    """Write all tables as CSV, Parquet, Markdown and LaTeX, and the matrix of solvers and problems; return the files.

    A study has results and a table of its points. The matrix shows claims about judged residuals, so it is written
    only for judged residuals.

    Raises:
        UnwritableError: if a file cannot be written.
        BenchError: if a link in the folder leads out of it.
    """
    files = []
    for name, frame, shown, note in _tables(frames):
        parquet, texts = io.BytesIO(), shown(frame)
        frame.to_parquet(parquet, index=False)
        page = _markdown_head(frames) + markdown_frame(texts) + note
        contents = {
            "csv": csv_content(frame),
            "parquet": parquet.getvalue(),
            "md": page.encode(),
            "tex": latex_table(texts).encode(),
        }
        files += [write_file(folder / f"{name}.{kind}", content) for kind, content in contents.items()]
    if not frames.is_study and frames.residual == JUDGED:
        files.append(write_file(folder / "matrix.md", matrix_of_run(frames).encode()))
    return files


def _tables(frames: RunFrames) -> list[tuple[str, pd.DataFrame, Callable[[pd.DataFrame], pd.DataFrame], str]]:
    """Return the tables of a run: name, numbers, a function that formats them, and a note below."""
    ratios, table = _standings(frames), results_table(frames)
    standings = standings_of_cells(table, ratios)
    formatted_results = partial(shown_results, standings=standings, is_study=frames.is_study, bold="**{}**")
    results = ("results", table, formatted_results, "" if ratios.empty or frames.is_study else f"\n{_MARKS}\n")
    if frames.is_study:
        return [results, ("points", points_table(frames), shown_points, "")]
    summary, starts, by_family = summary_table(frames), starts_table(frames), families_table(frames)
    note = f"\n{_summary_legend(summary)}\n" if len(summary) else ""
    return [
        results,
        ("problems", problems_table(frames), shown_problems, ""),
        ("ratios", ratios, shown_ratios, ""),
        (
            "families",
            by_family,
            partial(shown_families, frames.info.plan.solvers),
            f"\n{_family_legend(by_family)}\n",
        ),
        ("summary", summary, shown_summary, note),
        *([("starts", starts, shown_starts, f"\n{_STARTS}\n")] if len(starts) else []),
    ]


def matrix_of_run(frames: RunFrames) -> str:
    """Return the matrix of solvers and problems of a run as a Markdown page, with the reason for every failure."""
    cells = [
        Cell(row["problem"], row["solver"], Outcome(row["outcome"]), row["residual"], reason=row["reason"])
        for row in results_table(frames).to_dict("records")
    ]
    finest = min(frames.info.plan.tolerances)
    return matrix_page(cells, finest, f"proxbench report {frames.info.run_id}", _markdown_head(frames))


def print_tables(frames: RunFrames, console: Console) -> None:
    """Print the state of the run, a table of each problem, the families and the summary.

    The failures on a problem are explained below its table. With more than ``MAX_TABLES`` problems, a single table
    has one row per problem, and only faults are explained.
    """
    for warning in warnings(frames):
        console.print(Text(warning, style="bold yellow"))
    for sentence in (*residual_note(frames), steadiness(frames)):
        console.print(Text(sentence, style="dim"))
    console.print()
    results = results_table(frames)
    if results.empty:
        console.print(Text("no case of this run is finished"))
        return
    if results["problem"].nunique() > MAX_TABLES and not frames.is_study:
        _print_problems(frames, results, console)
    else:
        unsolved = tuple(outcome for outcome in Outcome if outcome != Outcome.SOLVED)
        explained_outcomes = (*FAULTS, Outcome.UNSUPPORTED) if frames.is_study else unsolved
        _print_each_problem(frames, results, console, explained_outcomes)
    summary = pd.DataFrame() if frames.is_study else summary_table(frames)
    if len(summary):
        if families(frames):
            _print_families(frames, console)
        _print_summary(summary, frames.info.plan, results["problem"].nunique(), console)
        _print_starts(starts_table(frames), console)
    if not frames.is_study:
        for sentence in limit_remedies(results["outcome"], frames.info.plan.limits):
            console.print(Text(sentence, style="yellow"))
    console.print(Text(_legend(frames, list(time_columns(results)), summary), style="dim"))


def print_unfinished(frames: RunFrames, console: Console) -> None:
    """Print the tables of the problems of an unfinished run, without notes."""
    _print_each_problem(frames, results_table(frames), console, ())


def _standings(frames: RunFrames) -> pd.DataFrame:
    """Return the standings of times; in a study, only those of excluded times."""
    return excluded_times(frames) if frames.is_study else ratios_table(frames)


def _print_each_problem(
    frames: RunFrames, results: pd.DataFrame, console: Console, explained_outcomes: Sequence[Outcome]
) -> None:
    """Print a table of each problem, the reasons of cases with these outcomes, and the notes of all cases.

    Without outcomes, print only the tables.
    """
    ratios = _standings(frames)
    for problem, rows in results.groupby("problem", sort=False):
        standings = standings_of_cells(rows, ratios)
        shown = shown_results(rows, standings, frames.is_study)
        shown = shown.drop(columns=["problem", "family", "contacts", "why"], errors="ignore")
        console.print(Text(_headline(frames, str(problem), int(rows["n_contacts"].iloc[0])), style="bold"))
        optional = ("iter.", "solves", "by model", "residual", "error", "ended")
        fastest = {cell for cell, standing in standings.items() if standing == "fastest"}
        print_table(console, shown, left_aligned=("model", "ended"), optional=optional, bold=fastest)
        for row in rows.to_dict("records") if explained_outcomes else ():
            is_explained = row["outcome"] in explained_outcomes
            text = join_texts(row["reason"] if is_explained else "", row["notes"])
            if text:
                note = f"{row['solver']}: {row['outcome']}, {text}" if is_explained else f"{row['solver']}: {text}"
                console.print(Text(wrap_note(note, console.width), style="dim"))
        console.print()
        if frames.is_study:
            print_points(frames, frames.info.plan.trajectory(str(problem)), console)
            console.print()


def _print_problems(frames: RunFrames, results: pd.DataFrame, console: Console) -> None:
    """Print one row per problem, grouped by family, and the faults below."""
    title = "problems: how many of the supporting solvers reach each accuracy, the least time, and the fastest solver"
    if threads_by_solver(frames).nunique() > 1:
        title += " of those with the fewest threads"
    console.print(Text(title, style="bold"))
    shown = shown_problems(problems_table(frames))
    print_table(console, shown, left_aligned=("problem", "family"), optional=("contacts", "residual", "family"))
    for row in results[results["outcome"].isin((*FAULTS, Outcome.WRONG))].to_dict("records"):
        note = f"{row['problem']}, {row['solver']}: {row['outcome']}, {row['reason']}"
        console.print(Text(wrap_note(note, console.width), style="dim"))
    n_with_notes = int((results["notes"] != "").sum())
    if n_with_notes:
        console.print(Text(f"{counted(n_with_notes, 'case')} with notes: see tables/results", style="dim"))
    console.print(
        Text(f"for a single problem: proxbench report {quote(str(frames.folder))} --problem NAME", style="dim")
    )
    console.print()


def _print_families(frames: RunFrames, console: Console) -> None:
    """Print one table per accuracy, with solvers as rows and families as columns, split to fit the width."""
    table = families_table(frames)
    for tag in summary_tags(table):
        cells = shown_families(frames.info.plan.solvers, table, [tag])
        for names in column_groups(cells, console.width):
            console.print(Text(f"by family, to {tag}", style="bold"))
            print_table(console, cells[["solver", *names]])
            console.print()
    console.print(Text(_family_legend(table), style="dim"))
    console.print()


def _print_summary(summary: pd.DataFrame, plan: PlanRecord, count: int, console: Console) -> None:
    """Print the summary over ``count`` problems of a plan, one table per accuracy."""
    is_single = count == 1 and plan.n_available in (1, None)
    title = "summary" if is_single else plan.problems_in_words(count)
    for tag in summary_tags(summary):
        console.print(Text(f"{title}, to {tag}", style="bold"))
        print_table(console, shown_summary(summary, tag), left_aligned=("model",), optional=("wrong",))
        console.print()


def _print_starts(starts: pd.DataFrame, console: Console) -> None:
    """Print the effect of warm starts, if solvers were measured from zero and warm."""
    if len(starts):
        console.print(Text("effect of warm starts", style="bold"))
        print_table(console, shown_starts(starts), left_aligned=("family",), optional=("cold iter.", "warm iter."))
        console.print(Text(_STARTS, style="dim"))
        console.print()


def _headline(frames: RunFrames, problem: str, contacts: int) -> str:
    if frames.is_study:
        return headline(frames.info.plan, problem)
    return f"{problem} · {counted(contacts, 'contact')}"


def _legend(frames: RunFrames, headings: list[str], summary: pd.DataFrame) -> str:
    """Return the legend of the printed tables; ``headings`` are those of the columns of times."""
    columns = f"Columns {headings[0]} to {headings[-1]} give" if len(headings) > 1 else f"Column {headings[0]} gives"
    if frames.is_study:
        return f"{columns} the least median time of a simulation, to that error; – means never reached."
    goal = f"to that {frames.residual} residual"
    times = f"{columns} the least median time, including preparation, {goal}; – means never reached. {_MARKS}"
    times += "" if all_solve_coulomb(frames.cases) else f" {_BY_MODEL}"
    return times if summary.empty else f"{times}\n{_summary_legend(summary)}"


def _summary_legend(summary: pd.DataFrame) -> str:
    """Return the legend of a summary that is not empty."""
    common = int(summary["common"].iloc[0])
    own = "own mean: over all problems that the solver supports."
    if compares_all(summary):
        means = f"mean: shifted geometric mean time over {counted(common, 'problem')}, failures at the time limit."
    elif common:
        common_problems = f"the {counted(common, 'problem')} that all these solvers support"
        means = (
            f"mean of {common}: shifted geometric mean time over {common_problems}, failures at the time limit; {own}"
        )
    else:
        means = f"no problem is supported by all these solvers, so means are not comparable; {own}"
    return (
        "claimed: supported problems that the solver claims to solve; confirmed: those that the judge confirms; "
        f"{means}{f' {_EXCLUDED_TIMES}' if _has_excluded_times(summary) else ''}"
    )


def _family_legend(table: pd.DataFrame) -> str:
    return f"{_FAMILIES} {_EXCLUDED_TIMES}" if _has_excluded_times(table) else _FAMILIES


def _markdown_head(frames: RunFrames) -> str:
    """Return the state of a run as paragraphs above a table."""
    return "".join(f"{inline(sentence)}\n\n" for sentence in run_state(frames))


def _has_excluded_times(summary: pd.DataFrame) -> bool:
    """Return whether a mean omits problems because their times are excluded."""
    return any(
        (summary[f"{number}_{tag}"] < summary[total]).any()
        for tag in summary_tags(summary)
        for number, total in (("mean_problems", "common"), ("own_problems", "problems"))
    )
