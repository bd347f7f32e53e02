"""HTML representation of a run in notebooks."""

from html import escape

from ...store.condition import residual_note, steadiness, warnings
from ...store.frames import RunFrames
from ..accuracy import summary_table
from ..cells import shown_summary
from ..layout.text import counted
from ..studies import headline, points_table


def run_html(frames: RunFrames) -> str:
    """Return the warnings, measurement conditions, summary and damaged files of a run as HTML with escaped texts."""
    info = frames.info
    n_problems, n_solvers = len(info.plan.problems), len(info.plan.solvers)
    counts = f"{counted(n_problems, 'problem')}, {counted(n_solvers, 'solver')}"
    if frames.is_study:
        counts = f"{headline(info.plan, info.plan.problems[0])}, {counted(n_solvers, 'method')}"
    lines = [f"<h4>{escape(info.run_id)}: {counts}</h4>"]
    lines += [f"<p><strong>{escape(warning)}</strong></p>" for warning in warnings(frames)]
    lines += [f"<p>{escape(sentence)}</p>" for sentence in (*residual_note(frames), steadiness(frames))]
    if frames.is_study:
        lines.append(points_table(frames).to_html(index=False, border=0, escape=True, na_rep="–"))
    elif len(summary := summary_table(frames)):
        lines.append(shown_summary(summary).to_html(index=False, border=0, escape=True))
    lines += [f"<p>{escape(sentence)}</p>" for sentence in frames.damaged]
    return "\n".join(lines)
