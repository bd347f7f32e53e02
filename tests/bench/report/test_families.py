"""Tables by family and by problem agree with the cases."""

from dataclasses import replace
from io import StringIO
from pathlib import Path

import pandas as pd
import pytest
from msgspec.structs import replace as changed
from proxbench.bench.errors import BenchError
from proxbench.bench.report import tables
from proxbench.bench.report.accuracy import families, families_table, problems_table, summary_table
from proxbench.bench.report.cells import duration
from proxbench.bench.report.charts.summary import summary_charts
from proxbench.bench.report.tables import print_tables, results_table, write_tables
from proxbench.bench.store.frames import RunFrames
from rich.console import Console

FAMILIES = {"hard-counterexample": "algebraic", "hard-immovable": "algebraic", "funnel-30": "flow"}


@pytest.fixture
def grouped(finished: RunFrames) -> RunFrames:
    """The small run, with two of its three problems in one family."""
    frames = finished
    info = changed(frames.info, plan=changed(frames.info.plan, families=FAMILIES))
    cases, points = (frame.assign(family=frame["problem"].map(FAMILIES)) for frame in (frames.cases, frames.points))
    return replace(frames, info=info, cases=cases, points=points)


def printed(frames: RunFrames, width: int = 120) -> str:
    text = StringIO()
    print_tables(frames, Console(file=text, width=width))
    return text.getvalue()


def test_the_summary_of_a_family_is_that_of_a_run_over_it_alone(grouped: RunFrames) -> None:
    table = families_table(grouped)
    for family in ("algebraic", "flow"):
        alone = grouped.only([name for name, own in FAMILIES.items() if own == family])
        own = table[table["family"] == family].drop(columns="family").reset_index(drop=True)
        pd.testing.assert_frame_equal(own, summary_table(alone))
    whole = summary_table(grouped)
    for solver, own in table.groupby("solver"):
        (over_all,) = whole[whole["solver"] == solver].to_dict("records")
        assert own["problems"].sum() == over_all["problems"]
        solved = (own["correct_1e-04"] * own["problems"]).sum()
        assert solved == pytest.approx(over_all["correct_1e-04"] * over_all["problems"])


@pytest.mark.slow
def test_families_are_shown_only_if_there_are_several_and_one_has_several_problems(grouped: RunFrames) -> None:
    assert families(grouped) == ["algebraic", "flow"]
    assert families(grouped.only(["hard-counterexample", "hard-immovable"])) == []
    assert families(grouped.only(["hard-counterexample", "funnel-30"])) == []
    assert "by family, to 1e-04" in printed(grouped)
    assert "by family" not in printed(grouped.only(["funnel-30"]))
    assert "summary-families" in summary_charts(grouped)
    assert "summary-families" not in summary_charts(grouped.only(["funnel-30"]))


@pytest.mark.slow
def test_a_cell_of_a_family_has_what_is_solved_and_the_mean_time(grouped: RunFrames) -> None:
    row = families_table(grouped).set_index(["solver", "family"]).loc[("SORprox(relaxation=0.5)", "algebraic")]
    cell = f"1/2 {duration(row['mean_time_1e-04'])}"
    shown = printed(grouped).partition("by family, to 1e-04")[2].splitlines()
    assert cell in next(line for line in shown if "=0.5)" in line)


@pytest.mark.slow
@pytest.mark.parametrize("width", [60, 80])
def test_families_that_do_not_fit_side_by_side_have_tables_of_their_own(grouped: RunFrames, width: int) -> None:
    long = {"algebraic": "algebraic problems with known answers", "flow": "what flows in a funnel of thirty balls"}
    frames = replace(grouped, cases=grouped.cases.replace({"family": long}))
    text = printed(frames, width)
    assert text.count("by family, to 1e-04") == 2
    assert max(map(len, text.splitlines())) <= width
    assert all(name in text for name in long.values())


def test_a_row_of_a_problem_counts_who_solves_it_and_names_the_fastest(grouped: RunFrames) -> None:
    table, results = problems_table(grouped).set_index("problem"), results_table(grouped)
    assert table["family"].to_dict() == FAMILIES
    for problem, own in results.groupby("problem"):
        for tag in ("1e-02", "1e-04", "1e-06"):
            times = own.set_index("solver")[f"time_to_{tag}"].dropna()
            row = table.loc[str(problem)]
            assert row[f"solved_{tag}"] == len(times)
            if len(times):
                assert (row[f"fastest_{tag}"], row[f"time_{tag}"]) == (times.idxmin(), times.min())
        best = own.dropna(subset="residual").set_index("solver")["residual"]
        assert (table.loc[str(problem), "residual"], table.loc[str(problem), "best"]) == (best.min(), best.idxmin())


@pytest.mark.slow
def test_many_problems_have_a_row_each_and_faults_are_still_spelled_out(
    grouped: RunFrames, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "MAX_TABLES", 2)
    text = printed(grouped)
    assert max(map(len, text.splitlines())) <= 120
    assert "hard-immovable · " not in text
    (row,) = [line for line in text.splitlines() if line.startswith("funnel-30 ")]
    assert "/5 " in row
    words = " ".join(text.split())
    assert "funnel-30, Misbehaving(raise): crashed" in words
    assert "RuntimeError: the plugin gave up" in words
    assert f"proxbench report {grouped.folder} --problem NAME" in text.replace("\n", "")
    assert "all 3 problems" in text


@pytest.mark.slow
def test_tables_by_family_and_problem_are_written(grouped: RunFrames, tmp_path: Path) -> None:
    write_tables(grouped, tmp_path)
    for name, table in (("families", families_table(grouped)), ("problems", problems_table(grouped))):
        assert list(pd.read_csv(tmp_path / f"{name}.csv").columns) == list(table.columns)
        assert len(pd.read_parquet(tmp_path / f"{name}.parquet")) == len(table)
    page = (tmp_path / "families.md").read_text()
    assert "| solver | algebraic 1e-04 | algebraic 1e-06 | flow 1e-04 | flow 1e-06 |" in page
    assert pd.read_csv(tmp_path / "results.csv")["family"].map(set(FAMILIES.values()).__contains__).all()


@pytest.mark.slow
def test_the_chart_by_family_shows_the_shares_of_the_table(grouped: RunFrames) -> None:
    chart = summary_charts(grouped)["summary-families"].to_dict()
    cells = [row for data in chart["datasets"].values() for row in data if "solved" in row]
    table = families_table(grouped).set_index(["family", "solver"])
    assert len(cells) == 2 * len(table)
    shares = {(row["family"], row["solver"], row["share"]) for row in cells}
    for tag in ("1e-04", "1e-06"):
        for key, share in table[f"correct_{tag}"].items():
            assert (*key, share) in shares  # type: ignore[misc]


def test_only_problems_of_the_run_can_be_chosen(grouped: RunFrames) -> None:
    with pytest.raises(BenchError, match="the run has no problem 'funel-30'; did you mean 'funnel-30'"):
        grouped.only(["funel-30"])
    alone = grouped.only(["funnel-30"])
    assert set(alone.cases["problem"]) == set(alone.points["problem"]) == {"funnel-30"}
    assert (alone.n_planned, alone.is_finished) == (5, True)
