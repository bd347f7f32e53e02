"""The Python interface of runs: measure, resume, load, merge and compare."""

import itertools
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..problems.contact.problem import ContactProblem
from ..problems.contact.solver import Solver
from ..problems.exchange.families import Sampling
from .errors import BenchError
from .measure.execution.events import OnEvent
from .measure.plan import make_plan
from .measure.runner import measure, resume_measuring
from .measure.trajectories.plan import make_study_plan
from .plugins.files import use_plugin_files
from .plugins.problems import problem_of_run
from .report.build_report import Report, build_report
from .report.comparison.comparison import SLOWDOWN, Comparison, compare_runs
from .simulation.starts import DEFAULT_START
from .store.bundles.bundle import bundle as bundle
from .store.bundles.bundle import open_run
from .store.bundles.merge import merge as merge_sources
from .store.bundles.rejudge import OnCase
from .store.bundles.rejudge import rejudge as rejudge
from .store.frames import RunFrames, read_frames
from .store.plans import Limits, RunSettings, changed_limits, limit_in_bytes
from .store.store import INVALID_NAME, plain_name


def _ignore(*arguments: object) -> None:
    """Ignore the event."""


@dataclass(frozen=True, eq=False, repr=False)
class Run(RunFrames, os.PathLike[str]):
    """A stored run as it was when it was loaded; usable as the path of its folder or bundle.

    It has the attributes of ``RunFrames``: the frames ``cases``, ``points``, ``rounds``, ``iterations`` and ``errors``,
    the record ``info``, and the messages ``damaged``.
    """

    def __fspath__(self) -> str:
        return str(self.folder)

    def __str__(self) -> str:
        """Return the number of cases by outcome, and the path."""
        from .report.tables import results_table

        endings = results_table(self)["outcome"].value_counts()
        counts = ", ".join(f"{number} {outcome}" for outcome, number in endings.items()) or "none"
        return f"{self.n_finished} of {self.n_planned} cases: {counts}\nstored in {self.folder}"

    def __repr__(self) -> str:
        return f"<Run {str(self.folder)!r}: {self.n_finished} of {self.n_planned} cases>"

    def _repr_html_(self) -> str:
        from .report.page.notebook import run_html

        return run_html(self)

    def report(
        self,
        charts: bool = True,
        residual: str | None = None,
        baseline: str = "",
        page: bool = False,
        *,
        profiles: str = "common",
    ) -> Report:
        """Write tables and charts into the folder of the run, as ``proxbench report`` does, and return them.

        Args:
            charts: draw charts.
            residual: "judged", or "local" (relative to the surroundings of each contact); that of the run if None.
            baseline: reference solver of speed-ups; if empty, the one that solves the most problems.
            page: write the page too, if the run has one; see ``page``.
            profiles: problems that profiles cover, "common" to all solvers or "all".

        Returns:
            The tables and files; ``unwritten`` gives the reason why files are missing.

        Raises:
            BenchError: if the run has no such residual or solver, or a link in its folder leads out of it.
        """
        return build_report(self.judged_by(residual or self.residual), charts, baseline, page, profiles)

    def page(self, residual: str | None = None, baseline: str = "") -> Path:
        """Write one offline HTML page, as ``proxbench report --page`` does, and return its file.

        The arguments are those of ``report``.

        Raises:
            BenchError: if the run has no case, is a study of simulations, or has no such residual or solver.
            UnwritableError: if the page cannot be written.
        """
        from .report.page.assembly import write_page

        return write_page(self.judged_by(residual or self.residual), baseline)

    def plot(self, problem: str) -> Any:
        """Return an altair chart of one problem: time against accuracy, and convergence.

        Raises:
            BenchError: if the run has no such problem, or no solver has a finite residual on it.
        """
        from .report.charts.plots import plot_problem

        return plot_problem(self, problem)

    def plot_profile(self, kind: str = "performance", baseline: str = "", profiles: str = "common") -> Any:
        """Return an altair chart of one kind of profile over the problems of the run.

        Args:
            kind: "performance", "data", "accuracy", "speedup" or "families".
            baseline: reference solver of speed-ups; if empty, the one that solves the most problems.
            profiles: "common" for the problems that all solvers support, or "all".

        Raises:
            BenchError: if there is no such profile or solver, or the run has no case or is a study of simulations.
        """
        from .report.charts.plots import plot_profile

        return plot_profile(self, kind, baseline, profiles)

    def resume(
        self,
        retry_failed: bool = False,
        on_event: OnEvent = _ignore,
        plugins: Sequence[Path | str] = (),
        mix: bool = False,
    ) -> "Run":
        """Measure the missing cases and return the new state of the run; see ``resume``."""
        return resume(self.folder, retry_failed, on_event, plugins, mix)

    def problem(self, name: str) -> ContactProblem:
        """Return a problem of the run, from the run itself if it stores the problem.

        Raises:
            ProblemError: if there is no problem of that name, or its file is damaged.
        """
        return problem_of_run(open_run(self.folder), self.info, name)


def run(
    problems: Sequence[str | Path | ContactProblem] | str | Path | ContactProblem | None = None,
    solvers: Sequence[str | Solver] | str | Solver | None = None,
    suite: str | Path = "quick",
    results: Path | str = "results",
    run_id: str | None = None,
    *,
    tolerances: Sequence[float] | float | None = None,
    limits: Limits | None = None,
    on_event: OnEvent = _ignore,
    plugins: Sequence[Path | str] | Path | str = (),
    solve_seconds: float | None = None,
    case_seconds: float | None = None,
    memory: float | None = None,
    passes: int | None = None,
    seed: int = 0,
    sample: int | None = None,
    sampling: Sampling = "proportional",
    thorough: bool = False,
    shard: str = "",
    executor: Executor | None = None,
) -> Run:
    """Measure solvers on problems, store the results and return them.

    Args:
        problems: names, problem files (.npz, or .hdf5 of FCLIB), folders of such files, problem objects, or one of
            these; the members of ``suite`` if None. Missing problems are generated.
        solvers: names with options, solver objects, or one of these; the default variants if None.
        suite: a named suite, or a folder of problem files; the plan of the run lists unreadable files.
        results: the folder that contains the folder of the run.
        run_id: name of the run; date and time if None.
        tolerances: the ladder, or one tolerance; 1e-2, 1e-4, 1e-6, 1e-8 if None.
        limits: limits of each case.
        on_event: called with each event of the run.
        plugins: plugin files whose solvers and problems can be named, or one of them.
        solve_seconds: time limit of one solve [s]; overrides that of ``limits``.
        case_seconds: time limit of a whole case [s]; overrides that of ``limits``.
        memory: memory limit of a case beyond the memory of the framework [MiB]; overrides that of ``limits``.
        passes: number of passes over all problems; 2 if None. With one pass, ratios of times have no intervals.
        seed: seed of the orders of problems and solvers in each pass, and of the sample.
        sample: number of problems to draw; all if None.
        sampling: divide the sample among families in proportion to their sizes, or evenly.
        thorough: default to ten tolerances, 1e-1 … 1e-10, and five passes.
        shard: for "i/n", measure every n-th problem, beginning with the i-th; ``merge`` combines shards.
        executor: runs each problem as a task, on any machine with this version of Proxbench; None for this process.

    Raises:
        ProxbenchError: before the start, if an argument is unknown or out of range, or the folder cannot be written.
        InterruptedRunError: on Ctrl-C; finished points are kept.
    """
    use_plugin_files(_as_tuple(plugins) or ())
    limits = changed_limits(limits, solve_seconds, case_seconds, limit_in_bytes(memory))
    settings = RunSettings.checked(_as_tuple(tolerances), limits, passes=passes, seed=seed, thorough=thorough)
    plan = make_plan(
        _as_tuple(problems), _as_tuple(solvers), settings, suite=suite, sample=sample, sampling=sampling, shard=shard
    )
    folder = _new_folder(results, run_id)
    measure(plan, folder, on_event, executor)
    return load(folder)


def plot_convergence(
    problem: str | Path | ContactProblem,
    solvers: Sequence[str | Solver] | str | Solver | None = None,
    tolerance: float = 1e-8,
    solve_seconds: float = 5.0,
) -> Any:
    """Solve a problem with each solver and return an altair chart of the judged residual over iterations.

    Args:
        problem: a name, a problem file, or a problem object.
        solvers: names with options, solver objects, or one of these; the default variants if None.
        tolerance: judged residual to reach.
        solve_seconds: time limit of one solve [s].

    Raises:
        ProxbenchError: if the problem or a solver is unknown, or no solver has observable iterates.
    """
    from .report.charts.plots import plot_curves

    with tempfile.TemporaryDirectory() as folder:
        frames = run(problem, solvers, results=folder, tolerances=tolerance, solve_seconds=solve_seconds, passes=1)
    return plot_curves(frames, frames.info.plan.problems[0])


def study(
    scene: str,
    solvers: Sequence[str | Solver] | str | Solver = (),
    results: Path | str = "results",
    run_id: str | None = None,
    *,
    limits: Limits | None = None,
    on_event: OnEvent = _ignore,
    plugins: Sequence[Path | str] | Path | str = (),
    methods: Mapping[str, Sequence[float]] | None = None,
    tolerance: float = 1e-12,
    duration: float | None = None,
    members: Iterable[float] | None = None,
    start: str = DEFAULT_START,
) -> Run:
    """Measure wall time against the accuracy of a motion, over steps, tolerances, steppers and solvers.

    Args:
        scene: name of a scene, with or without options.
        solvers: additional solvers to compare over their tolerances, or one of them.
        results: the folder that contains the folder of the run.
        run_id: name of the run; the scene with date and time if None.
        limits: limits of each case, in which a solve is a simulation; ten minutes per solve and two hours per case if
            None.
        on_event: called with each event of the run.
        plugins: plugin files whose solvers and scenes can be named, or one of them.
        methods: ladders by name, ``{"Moreau with NSGS": (1e-3, 5e-4)}`` over the step [s], or
            ``{"NSGS in Moreau(step=1e-3)": (1e-2, 1e-4)}`` over the tolerance; those of the scene if None.
        tolerance: tolerance of the solvers in those ``methods`` that vary the step.
        duration: simulated time [s]; that of the scene if None.
        members: seeds of a scene of balls, or factors on steps and tolerances, over which errors are computed.
        start: initial impulses of each solve: "warm" (the last impulses), "scaled" (a fraction of them), "cold" (zero)
            or "warm-then-cold".

    Raises:
        ProxbenchError: before the start, if an argument is unknown or out of range, or the folder cannot be written.
        InterruptedRunError: on Ctrl-C; finished points are kept.
    """
    use_plugin_files(_as_tuple(plugins) or ())
    plan = make_study_plan(
        scene,
        _as_tuple(solvers) or (),
        methods=methods,
        tolerance=tolerance,
        duration=duration,
        members=members,
        limits=limits,
        start=start,
    )
    folder = _new_folder(results, run_id, prefix=f"{scene.partition('(')[0]}-study-")
    measure(plan, folder, on_event)
    return load(folder)


def _new_folder(results: Path | str, run_id: str | None, prefix: str = "") -> Path:
    """Return the folder of a new run; without ``run_id``, a number distinguishes runs of the same second."""
    if run_id is None:
        first = Path(results) / f"{prefix}{datetime.now(UTC):%Y%m%d-%H%M%S}"
        numbered = (first.with_name(f"{first.name}-{number}") for number in itertools.count(2))
        return next(folder for folder in itertools.chain([first], numbered) if not folder.exists())
    if not isinstance(run_id, str) or not run_id or run_id != plain_name(run_id):
        raise BenchError(f"`run_id` {run_id!r} {INVALID_NAME}")
    return Path(results) / run_id


def resume(
    run_dir: os.PathLike[str] | str,
    retry_failed: bool = False,
    on_event: OnEvent = _ignore,
    plugins: Sequence[Path | str] | Path | str = (),
    mix: bool = False,
    *,
    executor: Executor | None = None,
) -> Run:
    """Finish an interrupted run: measure the cases that are missing, damaged, or of a problem with another digest.

    Args:
        run_dir: the folder of the run, or the run.
        retry_failed: measure cases again that timed out, crashed, ran out of memory or misbehaved.
        on_event: called with each event of the run.
        plugins: the plugin files of its solvers, or one of them; problems of plugins are stored with the run.
        mix: continue on another machine, or with other versions or sources; reports then contain a warning.
        executor: as in ``run``.

    Returns:
        The new state of the run.

    Raises:
        BenchError: if the folder is not a run, its run.json is damaged, a plugin file of its solvers is not named, is
            missing or has changed, or the machine, versions or sources differ.
        InterruptedRunError: on Ctrl-C.
    """
    resume_measuring(Path(run_dir), retry_failed, on_event, _as_tuple(plugins) or (), mix=mix, executor=executor)
    return load(run_dir)


def load(run_dir: os.PathLike[str] | str) -> Run:
    """Load a stored run from its folder or bundle; ``damaged`` lists damaged and unplanned case files.

    Raises:
        BenchError: if the path is not a run, or its run.json or the bundle is damaged.
    """
    return Run(**vars(read_frames(Path(run_dir))))


def merge(
    sources: Iterable[os.PathLike[str] | str] | os.PathLike[str] | str,
    results: Path | str = "results",
    run_id: str | None = None,
    on_case: OnCase = _ignore,
    on_missing: Callable[[str], None] = lambda sentence: None,
) -> Run:
    """Merge several runs into one, after recomputing their residuals.

    A case that several sources contain counts once, and a finished one replaces an unfinished one.

    Args:
        sources: files of bundles and folders of runs, or one of them.
        results: the folder that contains the folder of the run.
        run_id: name of the run; date and time if None.
        on_case: called with the number of recomputed cases of a source and the total number of its cases.
        on_missing: called with a sentence for each missing shard.

    Raises:
        BenchError: if a source cannot be read or its residuals disagree, sources contradict each other, a problem was
            measured on several machines, or the folder exists or cannot be written.
    """
    folder = _new_folder(results, run_id)
    merge_sources([Path(source) for source in _as_tuple(sources) or ()], folder, on_case, on_missing)
    return load(folder)


def compare(before: os.PathLike[str] | str, after: os.PathLike[str] | str, slowdown: float = SLOWDOWN) -> Comparison:
    """Compare two stored runs: find faster and slower solvers, and problems that are newly or no longer solved.

    Args:
        before: the run to compare with, its folder or its bundle.
        after: the run that may be slower, its folder or its bundle.
        slowdown: smallest relative change of time at which the verdict names a solver, such as 0.1 for 10 %.

    Raises:
        BenchError: if a path is not a run, a run has no cases or is a study, or the runs have nothing in common.
    """
    return compare_runs(read_frames(Path(before)), read_frames(Path(after)), slowdown)


def _as_tuple(value: Any) -> tuple[Any, ...] | None:
    """Return one or several values as a tuple; None for None."""
    if value is None:
        return None
    return (value,) if isinstance(value, str) or not isinstance(value, Iterable) else tuple(value)
