"""The command ``proxbench capture``: contact problems from the steps of an engine."""

from collections.abc import Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import options

if TYPE_CHECKING:
    from ....problems.capture.sequence import CaptureSummary
    from ....problems.capture.step import CapturedStep

HEADS = ("step", "laws", "rows", "refused", "own model", "Coulomb", "separation", "iterations", "solver")
"""Columns of the table of judged steps."""

WIDTHS = (6, 5, 5, 7, 9, 7, 10, 10, 0)
"""Widths of these columns [characters]; the last column is not padded."""

_simulation = partial(typer.Option, rich_help_panel="Simulation")


def capture(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="MuJoCo model (.xml, .urdf or .mjb).")],
    duration: Annotated[float, _simulation(metavar="SECONDS", help="Simulated time.")] = 1.0,
    every: Annotated[int, _simulation(metavar="STEPS", help="Capture one in this many steps.")] = 10,
    keyframe: Annotated[str, _simulation(metavar="NAME", help="Keyframe to start from.")] = "",
    seed: Annotated[int | None, _simulation(metavar="SEED", help="Apply random controls with this seed.")] = None,
    output: Annotated[Path, options.output(metavar="FOLDER", help="Folder for the problem files.")] = Path("captured"),
    judge: Annotated[bool, options.flag("--judge", help="Judge the engine's forces in each step.")] = False,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Simulate a model with MuJoCo and store steps as contact problems, with the forces that MuJoCo found.

    If a step cannot be captured, the earlier ones are kept and the exit code is 1.
    Ctrl-C keeps them too.
    """
    from ....problems.capture.sequence import CaptureOptions
    from ....problems.capture.sequence import capture as capture_steps
    from ...errors import InterruptedWorkError
    from ...report.layout.text import counted, print_json

    rows: list[dict[str, Any]] = []
    n_kept = 0

    def show(step: "CapturedStep") -> None:
        nonlocal n_kept
        n_kept += 1
        if not judge:
            return
        row = _step_row(step)
        rows.append(row)
        if not (quiet or as_json):
            _print_row(row, is_first=len(rows) == 1)

    capture_options = CaptureOptions(duration, every, keyframe, seed)
    try:
        summary = capture_steps(model, output, capture_options, force=force, on_step=show)
    except KeyboardInterrupt:
        raise InterruptedWorkError(f"interrupted; kept {counted(n_kept, 'step')} in {output}.") from None
    if as_json:
        print_json({**_as_json(summary), **({"steps": rows} if judge else {})})
    elif quiet:
        print(output)
    else:
        _print_summary(summary, output, judge)
    if summary.error:
        options.print_notes(options.with_option_names(summary.error))
    return int(bool(summary.error))


def _step_row(step: "CapturedStep") -> dict[str, Any]:
    """Return a step as JSON values."""
    return {
        "step": step.problem.provenance["step"],
        "laws": step.problem.laws.n_laws,
        "rows": len(step.forces),
        "refused": len(step.refused),
        **engine_quality(step),
    }


def engine_quality(step: "CapturedStep") -> dict[str, Any]:
    """Return the quality of the engine's forces as JSON values; an infinite residual is ``None``."""
    from ....problems.capture.step import judge_step

    verdict = judge_step(step)
    residuals = {"own model": verdict.own, "Coulomb": verdict.coulomb, "separation": verdict.separation}
    return {
        **{name: value if isfinite(value) else None for name, value in residuals.items()},
        "solver": step.solver,
        "iterations": step.iterations,
    }


def _print_row(row: dict[str, Any], is_first: bool) -> None:
    """Print a judged step as a row of the table, below the heads if it is the first row."""
    if is_first:
        _print_cells(HEADS)
    _print_cells([cell(row[head]) for head in HEADS])


def _print_cells(texts: Sequence[str]) -> None:
    print("  ".join(f"{text:>{width}}" for text, width in zip(texts, WIDTHS, strict=True)))


def cell(value: Any) -> str:
    """Return a JSON value as a cell of a table."""
    return "inf" if value is None else f"{value:.1e}" if isinstance(value, float) else str(value)


def _as_json(summary: "CaptureSummary") -> dict[str, Any]:
    """Return a summary as JSON values."""
    from dataclasses import asdict

    refused = [{"step": step, **asdict(row)} for step, rows in summary.refused_rows.items() for row in rows]
    return {
        "files": [str(file) for file in summary.files],
        "empty_steps": summary.empty,
        "engine_rows": summary.engine_rows,
        "velocity_error": summary.velocity_error,
        "refused": dict(summary.refused),
        "refused_rows": refused,
        "error": summary.error or None,
    }


def _print_summary(summary: "CaptureSummary", output: Path, is_judged: bool) -> None:
    from ....problems.capture.step import STEP_ERROR
    from ...report.layout.text import counted

    if is_judged:
        print(
            "\nown model: residual of the convex program that the engine solves; Coulomb: the judged residual;\n"
            "separation: largest velocity at which a loaded contact opens [m/s], 0 under Coulomb's law\n"
        )
    empty = f", {summary.empty} without contact omitted" if summary.empty else ""
    print(
        f"captured  {counted(len(summary.files), 'step')} into {output}, at most {counted(summary.laws, 'law')}{empty}"
    )
    n_taken = summary.engine_rows - summary.refused.total()
    print(f"rows      {n_taken} of {summary.engine_rows} taken")
    if is_judged:
        print(f"velocity  largest error after a step {summary.velocity_error:.1e}, relative; {STEP_ERROR:g} is allowed")
    for reason, count in summary.refused.items():
        print(f"refused   {count}: {reason}")
    print(f"measure   proxbench run --suite {quote(str(output))}")
