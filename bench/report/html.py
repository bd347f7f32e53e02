"""A run as a notebook shows it: its state and its summary on one page."""

from html import escape

from ...problems.spelling import for_python
from ..store.condition import steadiness, warnings
from ..store.frames import RunFrames
from .studies import headline, points_table
from .tables import duration, summary_table

_HEADS = {"success": "says", "correct": "true", "mean_time": "mean"}


def run_page(frames: RunFrames) -> str:
    """Return the summary of a run as HTML, all texts escaped; what is missing from it stands above."""
    info = frames.info
    n_problems, n_solvers = len(info.plan.problems), len(info.plan.solvers)
    counts = f"{n_problems} problems, {n_solvers} solvers"
    if frames.is_study:
        counts = f"{headline(info.plan.trajectories[0])}, {n_solvers} methods"
    lines = [f"<h4>{escape(info.run_id)}: {counts}</h4>"]
    lines += [f"<p><strong>{escape(for_python(warning))}</strong></p>" for warning in warnings(frames)]
    lines.append(f"<p>{escape(steadiness(info))}</p>")
    if frames.is_study:
        lines.append(points_table(frames).to_html(index=False, border=0, escape=True, na_rep="–"))
    elif len(summary := summary_table(frames)):
        shown = {key: head for key in summary.columns if (head := _head(key))}
        texts = {key: summary[key].map(duration if key.startswith("mean") else _share) for key in shown}
        table = summary.assign(**texts).rename(columns={**shown, "problems": "cases"})
        lines.append(table.to_html(index=False, border=0, escape=True))
    lines += [f"<p>{escape(sentence)}</p>" for sentence in frames.damaged]
    return "\n".join(lines)


def _share(part: float) -> str:
    return f"{100 * part:.0f} %"


def _head(key: str) -> str:
    """Return what a column of the summary about an accuracy is called: ``"true 1e-04"``; empty for other columns."""
    kind, _, accuracy = key.rpartition("_")
    return f"{_HEADS[kind]} {accuracy}" if kind in _HEADS else ""
