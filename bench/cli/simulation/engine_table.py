"""Markdown tables of a comparison of engines, one per scene."""

from ...measure.trajectories.engines.engine import ENGINES
from ...measure.trajectories.engines.measurement import Measurement
from ...measure.trajectories.engines.run import Comparison
from ...measure.trajectories.engines.scenes import describe
from ...report.layout.text import inline, markdown_table

NO_VALUE = "–"
"""Text of a cell without a value."""


def comparison_tables(comparison: Comparison) -> str:
    """Return one table per scene, with the best setting of each engine in bold, and notes on the measurement."""
    scenes = dict.fromkeys(run.scene for run in comparison.measurements)
    tables = [f"## {scene}\n\n{_scene_table(comparison, scene)}" for scene in scenes]
    return "\n".join([*tables, _notes(comparison)])


def _scene_table(comparison: Comparison, scene: str) -> str:
    """Return the table of a scene: engines in the order of their versions, settings in that of ``ENGINES``."""
    description = describe(scene)
    runs = [run for run in comparison.measurements if run.scene == scene]
    rows = []
    for engine in comparison.versions:
        best = comparison.best(scene, engine)
        by_setting = {run.setting: run for run in runs if run.engine == engine}
        in_order = (by_setting[setting.name] for setting in ENGINES[engine].settings if setting.name in by_setting)
        rows += [_row(run, description.errors, run is best) for run in in_order]
    times, residual_heads = ("wall [ms/s]", "processor [ms/s]"), ("own model", "Coulomb", "Robust")
    headings = ("engine", "setting", "Δt [ms]", *times, *description.errors, *residual_heads)
    return markdown_table(map(inline, headings), rows)


def _row(run: Measurement, errors: tuple[str, ...], is_best: bool) -> list[str]:
    """Return the cells of a run: setting, step, times, errors and residuals, or the reason why it failed."""
    name = f"**{run.setting}**" if is_best else inline(run.setting)
    begin = [run.engine, name, f"{1e3 * run.time_step:g}"]
    if run.failure:
        return [*begin, *[NO_VALUE] * (len(errors) + 4), inline(run.failure)]
    values = (1e3 * run.wall_seconds, 1e3 * run.processor_seconds, *(run.errors[error] for error in errors))
    residuals = (run.own_residual, run.residual, run.solved_residual)
    return [*begin, *(f"{value:.3g}" for value in values), *map(_residual, residuals)]


def _residual(value: float | None) -> str:
    return NO_VALUE if value is None else f"{value:.1e}"


def _notes(comparison: Comparison) -> str:
    """Return notes on the measured times and errors, the versions, and how models differ from hard contact."""
    versions = ", ".join(f"{engine} {version}" for engine, version in comparison.versions.items())
    before, after = comparison.load
    lines = [
        "*wall*, *processor*: time of the steps per simulated second, on one core. *own model*: largest residual of up",
        "to ten steps under the engine's own model, which only MuJoCo publishes; *Coulomb*: under Coulomb's law;",
        "*Robust*: that of Proxbench's solver on the same problems. In bold: the setting with the least wall time",
        "among the most accurate ones of an engine, by the first error.",
        "",
        *(["Interrupted: some runs are missing.", ""] if comparison.is_interrupted else []),
        f"Versions: {versions}. Rounds: {comparison.rounds}. Processor: {comparison.machine['processor']}.",
        f"Load of the machine before and after: {before:.1f}, {after:.1f}.",
        "",
        *(f"* {engine}: {ENGINES[engine].model}." for engine in comparison.versions),
    ]
    return "\n".join(lines) + "\n"
