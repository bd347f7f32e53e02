"""A run as a notebook shows it: its state and its summary on one page."""

from html import escape

from ...store.condition import basis, steadiness, warnings
from ...store.frames import RunFrames
from ..accuracy import shown_means, summary_table
from ..cells import duration
from ..studies import headline, points_table


def run_page(frames: RunFrames) -> str:
    """Return the summary of a run as HTML, all texts escaped; what is missing from it stands above."""
    info = frames.info
    n_problems, n_solvers = len(info.plan.problems), len(info.plan.solvers)
    counts = f"{n_problems} problems, {n_solvers} solvers"
    if frames.is_study:
        counts = f"{headline(info.plan, info.plan.problems[0])}, {n_solvers} methods"
    lines = [f"<h4>{escape(info.run_id)}: {counts}</h4>"]
    lines += [f"<p><strong>{escape(warning)}</strong></p>" for warning in warnings(frames)]
    lines += [f"<p>{escape(sentence)}</p>" for sentence in (*basis(frames), steadiness(frames))]
    if frames.is_study:
        lines.append(points_table(frames).to_html(index=False, border=0, escape=True, na_rep="–"))
    elif len(summary := summary_table(frames)):
        heads = {"success": "says", "correct": "true"} | {key: head for head, key in shown_means(summary).items()}
        kinds = {key: key.rpartition("_") for key in summary.columns}
        shown = {key: f"{heads[kind]} {accuracy}" for key, (kind, _, accuracy) in kinds.items() if kind in heads}
        texts = {key: summary[key].map(duration if "mean_time" in key else _share) for key in shown}
        table = summary.assign(**texts)[["solver", "model", "problems", *shown, "wrong"]].rename(columns=shown)
        lines.append(table.to_html(index=False, border=0, escape=True))
    lines += [f"<p>{escape(sentence)}</p>" for sentence in frames.damaged]
    return "\n".join(lines)


def _share(part: float) -> str:
    return f"{100 * part:.0f} %"
