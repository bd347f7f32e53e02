"""Charts for a notebook: one problem, one kind of profile, or the convergence on one problem."""

import altair as alt

from ....problems.errors import suggestion
from ...errors import BenchError
from ...store.frames import RunFrames
from ..profiles import COMMON, baseline_of, check_view, profile_tables
from .problems import convergence, has_drawable_rows, problem_chart, trajectory_chart
from .profiles import profile_charts


def plot_problem(frames: RunFrames, problem: str) -> alt.VConcatChart:
    """Return the charts of time against accuracy and of convergence on a problem; see ``Run.plot``.

    Raises:
        BenchError: if no solver has a finite residual on the problem.
    """
    problem_frames = frames.only([problem])
    if not has_drawable_rows(problem_frames, problem):
        raise BenchError(f"no solver has a finite residual on {problem}; plot another problem.")
    return (
        trajectory_chart(problem_frames, problem) if problem_frames.is_study else problem_chart(problem_frames, problem)
    )


def plot_profile(frames: RunFrames, kind: str, baseline: str = "", profiles: str = COMMON) -> alt.VConcatChart:
    """Return the chart of one kind of profile; see ``Run.plot_profile``.

    Args:
        frames: the run.
        kind: the profile, or "families".
        baseline: the solver with which others are compared; chosen by ``baseline_of`` if empty.
        profiles: problems that profiles cover, "common" to all solvers or "all".

    Raises:
        BenchError: for a study of simulations, a run without cases, or an unknown kind, baseline or view.
    """
    check_view(profiles)
    if frames.is_study:
        raise BenchError(f"{frames.folder} is a study of simulations, which has no profiles; plot one of its problems.")
    reference_solver = baseline_of(frames, baseline)
    charts = profile_charts(frames, profile_tables(frames, reference_solver), reference_solver, profiles)
    if kind == "families" and kind not in charts:
        raise BenchError(
            f"{frames.folder} has too few families for a profile of families; plot one of {', '.join(charts)}."
        )
    if kind not in charts:
        raise BenchError(f"there is no profile {kind!r}{suggestion(kind, charts)}")
    return charts[kind]


def plot_curves(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return the chart of the judged residual over iterations on a problem; see ``bench.plot_convergence``.

    Raises:
        BenchError: if no solver shows its iterates on the problem.
    """
    if not (frames.iterations["problem"] == problem).any():
        solvers = ", ".join(frames.cases["solver"][frames.cases["problem"] == problem])
        raise BenchError(
            f"no iterates of {solvers} were recorded on {problem}; choose a solver that shows its iterates."
        )
    return convergence(frames, problem)
