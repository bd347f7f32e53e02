"""Figures and pictures of the page on engines can be reproduced from the stored files."""

from pathlib import Path

import engine_charts
import msgspec
import pandas as pd
import pytest
from engine_charts import FIGURES, INTERRUPTED, KEY, PROCESSOR, WALL, best_rows, main
from proxbench.bench.measure.machine import this_machine
from proxbench.bench.measure.trajectories.engines.measurement import Measurement
from proxbench.bench.measure.trajectories.engines.run import Comparison


def stored(file: Path, setting: str, ratio: float) -> Path:
    """Write a result with one run of the stack in Proxbench, whose wall time is ``ratio`` times its 7 s."""
    errors = {"penetration [mm]": 1e-3, "drift [mm]": 2.0, "last speed [mm/s]": 3.0}
    seconds = {"wall_seconds": 7.0 * ratio, "processor_seconds": 7.0}
    run = Measurement(scene="stack", engine="proxbench", setting=setting, time_step=2e-3, errors=errors, **seconds)
    machine = msgspec.to_builtins(this_machine())
    made = Comparison(measurements=(run,), versions={"proxbench": "1.2"}, rounds=1, load=(1.5, 0.0), machine=machine)
    file.write_bytes(msgspec.json.encode(made))
    return file


@pytest.mark.parametrize(
    ("ratio", "is_kept"), [pytest.param(0.99 * INTERRUPTED, True, marks=pytest.mark.slow), (1.01 * INTERRUPTED, False)]
)
def test_a_new_run_replaces_the_old_one_and_has_a_wall_time_unless_it_was_interrupted(
    ratio: float, is_kept: bool, tmp_path: Path
) -> None:
    old = pd.read_csv(FIGURES)
    file = tmp_path / "engines.csv"
    old.to_csv(file, index=False)
    result = stored(tmp_path / "new.json", "1e-4", ratio)
    main(["--figures", str(file), "--results", str(result), "--charts", str(tmp_path)])
    new = pd.read_csv(file, dtype={"version": str})
    pd.testing.assert_frame_equal(new[KEY], old[KEY])
    changed = new[(new["scene"] == "stack") & (new["engine"] == "proxbench") & (new["setting"] == "1e-4")]
    assert changed["penetration [mm]"].tolist() == [1e-3]
    assert changed[WALL].notna().tolist() == [is_kept]
    assert changed["load"].tolist() == [1.5]
    assert changed["version"].tolist() == ["1.2"]


def test_both_pictures_are_drawn_with_all_engines(tmp_path: Path) -> None:
    main(["--charts", str(tmp_path)])
    for name, curves in (("thrown-cube.svg", engine_charts.CUBES), ("mass-ratio-stack.svg", engine_charts.MARKS)):
        text = (tmp_path / name).read_text()
        assert all(curve in text for curve in curves)


def test_the_page_has_the_best_settings() -> None:
    page = (engine_charts.DOCS / "results-engines.md").read_text()
    for row in best_rows(pd.read_csv(FIGURES)):
        _, cells = row.removeprefix("| ").split(" | ", 1)  # the page names each scene once
        assert f" | {cells}\n" in page, row


def test_settings_are_compared_by_one_clock_if_a_wall_time_is_unknown() -> None:
    stack = pd.read_csv(FIGURES).query("scene == 'stack' and engine == 'proxbench'")
    description = engine_charts.describe("stack")
    two = stack.head(2).assign(**{description.errors[0]: 0.0, WALL: [float("nan"), 5.0], PROCESSOR: [7.0, 9.0]})
    (row,) = best_rows(two)
    assert f"| {two['setting'].iloc[0]} | 2 | *7* |" in row


def test_processor_time_stands_for_an_unknown_wall_time() -> None:
    figures = pd.read_csv(FIGURES)
    row = next(iter(best_rows(figures[figures["scene"] == "stack"].assign(**{WALL: float("nan"), PROCESSOR: 12.0}))))
    assert "| *12* |" in row
