"""Update the figures of the page on engines, and draw its pictures.

``python tests/speed/engine_charts.py`` draws both pictures of docs/results-engines.md from docs/reference/engines.csv
and docs/reference/thrown-cube.csv. ``--results engines.json`` first replaces the runs of engines.csv that this result
of ``proxbench engines`` has; ``--throw`` first throws the cube again, which takes half a minute and needs the extra
``engines``. ``--table`` prints the best setting of each engine, as the page shows it.

A run that other programs interrupted keeps its processor time, and loses its wall time: the wall time then exceeds the
processor time.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import altair as alt
import numpy as np
import pandas as pd
from proxbench.bench.measure.trajectories.engines.description import ERROR_MARGIN
from proxbench.bench.measure.trajectories.engines.engine import ENGINES, build
from proxbench.bench.measure.trajectories.engines.run import Comparison, read_comparison
from proxbench.bench.measure.trajectories.engines.scenes import SCENES, describe
from proxbench.problems import judge

DOCS = Path(__file__).parents[2] / "docs"
FIGURES, THROWN = DOCS / "reference" / "engines.csv", DOCS / "reference" / "thrown-cube.csv"

KEY = ["scene", "engine", "setting"]
WALL, PROCESSOR = "wall [ms/s]", "processor [ms/s]"
INTERRUPTED = 1.05
"""Wall time of a run over its processor time above which other programs have interrupted it."""

CUBES = {
    "MuJoCo, stiff": ("mujoco", "stiff", "#08519c"),
    "MuJoCo, default": ("mujoco", "default", "#3182bd"),
    "MuJoCo, elliptic": ("mujoco", "elliptic", "#9ecae1"),
    "PyBullet": ("pybullet", "50 iterations", "#d95f02"),
    "DART": ("dart", "ODE contacts", "#7570b3"),
    "Proxbench": ("proxbench", "1e-8", "#111111"),
}
"""Engine, setting and colour of each curve of the thrown cube."""

MIN_RESIDUAL = 1e-10

LEAST_ERROR = 1e-11
"""Smaller errors, in their units, are rounding errors; the page shows 0."""

MAX_OWN_RESIDUAL = 1e-3
"""Residual under the model of an engine above which it did not solve that model; the page shows it in bold."""

MARKS = {
    "mujoco": ("#1f77b4", "circle"),
    "pybullet": ("#d95f02", "square"),
    "rapier": ("#2ca02c", "triangle-up"),
    "dart": ("#7570b3", "diamond"),
    "proxbench": ("#111111", "cross"),
}
"""Colour and shape of the marks of each engine."""

NAMED = {
    ("mujoco", "default"): "default",
    ("mujoco", "elliptic, impratio 100"): "elliptic",
    ("mujoco", "stiff"): "stiff",
    ("mujoco", "stiff, half step"): "half step",
    ("mujoco", "stiff, long step"): "long step",
    ("pybullet", "10 iterations"): "10 iterations",
    ("pybullet", "50 iterations, long step"): "50 iterations, long step",
    ("rapier", "Coulomb, half step"): "all settings",
    ("dart", "ODE contacts, half step"): "half step",
    ("dart", "default"): "default",
    ("dart", "ODE contacts, NSGS"): "NSGS",
    ("dart", "ODE contacts, long step"): "long step",
    ("proxbench", "1e-2"): "1e-2",
    ("proxbench", "1e-8, long step"): "1e-8, two steps",
    ("proxbench", "1e-4, half step"): "1e-4, half step",
}
"""Text beside the marks of the stack that have room for it."""


def figures_of(comparison: Comparison) -> pd.DataFrame:
    """Return a row for each run of a comparison that did not fail."""
    load = max(comparison.load)
    rows = [
        {
            "scene": run.scene,
            "engine": run.engine,
            "version": comparison.versions[run.engine],
            "setting": run.setting,
            "Δt [ms]": 1e3 * run.time_step,
            WALL: 1e3 * run.wall_seconds if run.wall_seconds <= INTERRUPTED * run.processor_seconds else np.nan,
            PROCESSOR: 1e3 * run.processor_seconds,
            "load": round(load, 1),
            "rounds": comparison.rounds,
            "processor": comparison.machine["processor"],
            "own model": run.own_residual,
            "Coulomb": run.residual,
            "Robust": run.solved_residual,
            **run.errors,
        }
        for run in comparison.measurements
        if not run.failure
    ]
    return pd.DataFrame(rows)


def merged(old: pd.DataFrame, new: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of both, new ones in place of old ones, in the order of scenes, engines and settings."""
    rows = pd.concat([new, old]).drop_duplicates(KEY)[old.columns]
    settings = [(engine, one.name) for engine, kind in ENGINES.items() for one in kind.settings]
    places = {(scene, *one): place for place, (scene, one) in enumerate((s, o) for s in SCENES for o in settings)}
    order = [places[tuple(key)] for key in rows[KEY].to_numpy().tolist()]
    return rows.iloc[np.argsort(order, kind="stable")]


def thrown_cube() -> pd.DataFrame:
    """Return the height of the cube [mm] and the residual of each step in contact, for each curve of the picture."""
    description, rows = describe("thrown-cube"), []
    for label, (name, setting, _) in CUBES.items():
        chosen = next(one for one in ENGINES[name].settings if one.name == setting)
        engine = build(name, description, chosen)
        lowest = engine.states().positions[0, 2]
        for step in range(1, round(description.duration / description.step) + 1):
            engine.store_state()
            engine.step()
            solved = engine.solved_problem()
            residual = None if solved is None else judge(solved.problem, solved.impulses).residual
            rows.append((label, step * description.step, 1e3 * (engine.states().positions[0, 2] - lowest), residual))
    return pd.DataFrame(rows, columns=["curve", "time [s]", "height [mm]", "residual"])


def draw_cube(motions: pd.DataFrame) -> alt.VConcatChart:
    """Return the height of the cube over time, and below it the residual of each step in contact."""
    # a colon would be a type, and a bracket a member, in the short names of altair
    shown = motions.set_axis(["curve", "time", "height", "residual"], axis=1)
    shown["residual"] = shown["residual"].clip(lower=MIN_RESIDUAL)
    colours = [colour for _, _, colour in CUBES.values()]
    scale = alt.Scale(domain=list(CUBES), range=colours)
    base = alt.Chart(shown).encode(
        x=alt.X("time:Q", title="time [s]").scale(domain=(0.0, 0.6)).axis(tickCount=6, format=".1f"),
        color=alt.Color("curve:N", title="engine", sort=list(CUBES), scale=scale),
    )
    height = alt.Y("height:Q", title="height above the floor [mm]").scale(domain=(0, 300), clamp=True)
    above = base.mark_line(strokeWidth=2).encode(y=height).properties(width=420, height=200)
    decades = [1.0, 1e-2, 1e-4, 1e-6, 1e-8, MIN_RESIDUAL]
    residual = alt.Y("residual:Q", title="residual, Coulomb’s law").axis(values=decades, format=".0e")
    points = base.transform_filter("isValid(datum.residual)").mark_point(filled=True, size=12, opacity=1)
    below = points.encode(y=residual.scale(type="log", domain=(MIN_RESIDUAL, 1), nice=False))
    return alt.vconcat(above, below.properties(width=420, height=160))


def draw_stack(figures: pd.DataFrame) -> alt.LayerChart:
    """Return the penetration of the stack over processor time, for each setting of the engines."""
    stack = figures[figures["scene"] == "stack"].rename(columns={PROCESSOR: "cost", "penetration [mm]": "deep"})
    stack = stack[["engine", "setting", "cost", "deep"]].dropna()
    stack["name"] = [NAMED.get(key, "") for key in zip(stack["engine"], stack["setting"], strict=True)]
    colours, shapes = zip(*MARKS.values(), strict=True)
    costs, depths = [2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000], [10.0**power for power in range(-6, 3)]
    base = alt.Chart(stack).encode(
        x=alt.X("cost:Q", title="processor time per simulated second [ms]")
        .axis(values=costs)
        .scale(type="log", domain=(2, 2500), nice=False),
        y=alt.Y("deep:Q", title="penetration [mm]")
        .axis(values=depths, format="~g")
        .scale(type="log", domain=(1e-6, 100), nice=False),
    )
    marks = base.mark_point(filled=True, size=70, opacity=1).encode(
        color=alt.Color("engine:N", scale=alt.Scale(domain=list(MARKS), range=colours)),
        shape=alt.Shape("engine:N", scale=alt.Scale(domain=list(MARKS), range=shapes)),
    )
    names = base.mark_text(align="left", dx=7, dy=-6, fontSize=10, color="#444").encode(text="name:N")
    return alt.layer(marks, names).properties(width=520, height=340)


def error_cell(error: str, value: float) -> str:
    """Return an error as the page shows it, ``lift 11 mm``; units of energies are in its text."""
    name, _, unit = error.rstrip("]").partition(" [")
    if name == "balls through":
        return f"{value:.0f} through"
    number = f"{value:.2g}" if value >= LEAST_ERROR else "0"
    return f"{name} {number}" if unit.startswith("m g") else f"{name} {number} {unit}"


def best_rows(figures: pd.DataFrame) -> Iterator[str]:
    """Yield a row of Markdown for the best setting of each engine in each scene.

    Processor time, in italics, decides if the wall time of one of the most accurate settings is not known.
    """
    for scene, engine in figures[["scene", "engine"]].drop_duplicates().itertuples(index=False):
        description = describe(scene)
        rows = figures[(figures["scene"] == scene) & (figures["engine"] == engine)]
        limit = max(description.negligible, ERROR_MARGIN * rows[description.errors[0]].min())
        accurate = rows[rows[description.errors[0]] <= limit]
        clock = WALL if accurate[WALL].notna().all() else PROCESSOR
        best = accurate.sort_values(clock).iloc[0]
        number = f"{float(format(best[clock], '.3g')):.10g}"  # three digits without an exponent
        cost = number if clock == WALL else f"*{number}*"
        errors = ", ".join(error_cell(error, best[error]) for error in description.errors)
        tracks = [f"{best[track]:.1e}" if best[track] > 0.0 else "–" for track in ("own model", "Coulomb")]
        if best["own model"] > MAX_OWN_RESIDUAL:
            tracks[0] = f"**{tracks[0]}**"
        cells = [scene, engine, best["setting"], f"{best['Δt [ms]']:g}", cost, errors, *tracks]
        yield f"| {' | '.join(cells)} |"


def draw(figures: pd.DataFrame, motions: pd.DataFrame, folder: Path) -> None:
    """Draw both pictures into a folder."""
    for chart, name in ((draw_cube(motions), "thrown-cube.svg"), (draw_stack(figures), "mass-ratio-stack.svg")):
        fonts = {"labelFontSize": 11, "titleFontSize": 12}
        styled = chart.configure_axis(**fonts, gridColor="#e5e5e5").configure_legend(**fonts)
        styled.configure_view(stroke=None).save(folder / name)


def main(arguments: Sequence[str] | None = None) -> None:
    """Store new figures, and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", nargs="+", type=Path, default=[], help="results of proxbench engines (.json)")
    parser.add_argument("--throw", action="store_true", help="throw the cube again")
    parser.add_argument("--table", action="store_true", help="print the best settings")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file of the runs")
    parser.add_argument("--charts", type=Path, default=DOCS / "images", help="folder of the pictures")
    options = parser.parse_args(arguments)
    figures = pd.read_csv(options.figures, dtype={"version": str})
    for file in options.results:
        figures = merged(figures, figures_of(read_comparison(file)))
    if options.results:
        figures.to_csv(options.figures, index=False, float_format="%.3g")
    if options.throw:
        thrown_cube().to_csv(THROWN, index=False, float_format="%.4g")
    if options.table:
        print("\n".join(best_rows(figures)))
    draw(figures, pd.read_csv(THROWN), options.charts)


if __name__ == "__main__":
    main()
