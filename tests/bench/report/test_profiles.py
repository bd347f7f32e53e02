"""Profiles follow their definitions, over the problems and solvers of a table, for any pattern of failures."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace as replace_fields
from proxbench.bench import load
from proxbench.bench.errors import BenchError
from proxbench.bench.report import page as page_folder
from proxbench.bench.report.accuracy import times_to_accuracies
from proxbench.bench.report.build_report import build_report
from proxbench.bench.report.charts.drawing import write_drawing
from proxbench.bench.report.charts.profiles import profile_charts, write_profiles
from proxbench.bench.report.page.document import page_document
from proxbench.bench.report.profiles import (
    ALL,
    BUDGETS,
    COMMON,
    EVERY,
    accuracy_profile,
    baseline_of,
    budget_table,
    data_profile,
    performance_profile,
    profile_tables,
    residual_matrix,
    seconds_matrix,
    speedups,
)
from proxbench.bench.store.frames import RunFrames
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from simulated_runs import simulated_cases, solved_point, store_run
from stored_cases import case_record, timed_round


def random_seconds(seed: int, problems: int = 17, solvers: int = 5) -> pd.DataFrame:
    """Times of solvers on problems, a third of them failures, with ties and a problem that no solver solves."""
    draw = np.random.default_rng(seed)
    seconds = np.round(10.0 ** draw.uniform(-4, 1, (problems, solvers)), 4)
    seconds[draw.random(seconds.shape) < 1 / 3] = np.nan
    seconds[0] = np.nan
    return pd.DataFrame(seconds, [f"p{k}" for k in range(problems)], [f"s{k}" for k in range(solvers)])


def on_stairs(corners: pd.DataFrame, column: str, solver: str, at: float) -> float:
    """The height of a solver's staircase at ``at``."""
    own = corners[corners["solver"] == solver]
    return float(own["share"][own[column] <= at].iloc[-1])


def declining(frames: RunFrames, problem: str, solver: str) -> RunFrames:
    """The run with a case whose solver does not support the problem."""
    tables = {}
    for name in ("cases", "points"):
        table = getattr(frames, name).copy()
        is_own = (table["problem"] == problem) & (table["solver"] == solver)
        table.loc[is_own, "outcome"] = Outcome.UNSUPPORTED
        tables[name] = table[~is_own] if name == "points" else table
    return replace(frames, **tables)


@pytest.fixture
def declined(finished_run: Path) -> RunFrames:
    """The small run, in which ClarabelSOCP supports two of three problems."""
    return declining(load(finished_run), "funnel-30", "ClarabelSOCP")


def test_common_profiles_leave_out_problems_that_a_solver_does_not_support(declined: RunFrames) -> None:
    tables = profile_tables(declined, "SORprox")
    common = ["hard-counterexample", "hard-immovable"]
    for accuracy in (1e-4, 1e-6):
        seconds = seconds_matrix(declined, accuracy)
        for name, profile in (("performance", performance_profile), ("data", data_profile), ("budgets", budget_table)):
            table = tables[name][(tables[name]["accuracy"] == accuracy) & (tables[name]["family"] == ALL)]
            for view, shown in ((COMMON, seconds.loc[common]), (EVERY, seconds)):
                rows = table[table["view"] == view].reset_index(drop=True)
                pd.testing.assert_frame_equal(rows[profile(shown).columns], profile(shown))
                assert set(rows["problems"]) == {len(shown)}
    assert list(tables["accuracy"]["view"].unique()) == [COMMON, EVERY]


def subtitle(chart: Any) -> str:
    """The lines below the title of a chart, as one text."""
    return " ".join(chart.title.subtitle)


@pytest.mark.slow
def test_charts_say_which_problems_shares_are_of(declined: RunFrames) -> None:
    tables = profile_tables(declined, "SORprox")
    for view, title, axis in (
        (COMMON, "over the 2 of 3 problems that all 5 solvers support", "share of 2 common problems"),
        (EVERY, "over all 3 problems; unsupported ones count as not solved", "share of 3 problems"),
    ):
        charts = profile_charts(declined, tables, "SORprox", view)
        for name in ("performance", "data", "accuracy"):
            assert title in subtitle(charts[name])
            assert axis in json.dumps(charts[name].to_dict())


@pytest.mark.slow
def test_a_chart_without_common_problems_says_so_and_shows_all(declined: RunFrames) -> None:
    for problem in ("hard-counterexample", "hard-immovable"):
        declined = declining(declined, problem, "SORprox")
    charts = profile_charts(declined, profile_tables(declined, "ClarabelSOCP"), "ClarabelSOCP")
    assert "no problem is supported by all solvers: over all 3 problems" in subtitle(charts["data"])


needs_node = pytest.mark.skipif(
    shutil.which("node") is None, reason="no node is installed to run the script of the page"
)


def output_of_page(document: dict[str, Any], script: str) -> Any:
    """Return the JSON output of a script that runs after the page's own model has read a document as ``run``."""
    model = (Path(page_folder.__path__[0]) / "model.js").read_text()
    source = f"{model}\nconst run = decoded({json.dumps(document)});\n{script}"
    done = subprocess.run(["node", "-"], input=source, capture_output=True, text=True, check=True, timeout=60)
    return json.loads(done.stdout)


@needs_node
@pytest.mark.parametrize("view", [COMMON, pytest.param(EVERY, marks=pytest.mark.slow)])
def test_the_script_of_the_page_computes_both_views(declined: RunFrames, view: str) -> None:
    script = f"""const whole = {{ ...run, run, accuracy: 1e-4 }};
        const view = profileView(whole, {json.dumps(view == COMMON)});
        const kinds = {{ performance: performanceProfile, data: dataProfile, accuracy: accuracyProfile }};
        const made = Object.fromEntries(Object.entries(kinds).map(([name, profile]) => [name, profile(view)]));
        console.log(JSON.stringify({{ ...made, over: view.over, axis: view.axis }}));"""
    found = output_of_page(page_document(declined, "SORprox"), script)
    charts = profile_charts(declined, profile_tables(declined, "SORprox"), "SORprox", view)
    for name, table in profile_tables(declined, "SORprox").items():
        if name in found:
            own = table[(table["family"] == ALL) & (table["view"] == view)]
            own = own[own["accuracy"] == 1e-4] if "accuracy" in own else own
            rows = pd.DataFrame(found[name])
            expected = own[rows.columns].reset_index(drop=True)
            pd.testing.assert_frame_equal(rows, expected, rtol=1e-6, check_dtype=False)
            assert found["over"] in subtitle(charts[name])
            assert found["axis"] in json.dumps(charts[name].to_dict())


THREADS = {"A": 1, "B": 1, "C": 2, "D": 2}
"""Solvers with their numbers of threads."""


@pytest.fixture
def threaded(tmp_path: Path) -> RunFrames:
    """A run of solvers with one and with two threads; one with two threads is the fastest."""
    cases = simulated_cases(0, {"C": 0.01}, solvers=tuple(THREADS))
    return load(store_run(tmp_path / "run", [replace_fields(case, threads=THREADS[case.solver]) for case in cases]))


@pytest.mark.parametrize(("baseline", "compared"), [("A", {"B"}), ("C", {"D"})])
def test_times_are_compared_between_solvers_in_as_many_threads(
    baseline: str, compared: set[str], threaded: RunFrames
) -> None:
    tables = profile_tables(threaded, baseline)
    assert set(tables["speedup"]["solver"]) == compared
    assert set(tables["data"]["solver"]) == set(tables["accuracy"]["solver"]) == set(THREADS)
    alone = replace(threaded, cases=threaded.cases[threaded.cases["threads"] == 1])
    pd.testing.assert_frame_equal(tables["performance"], profile_tables(alone, "A")["performance"])
    assert baseline_of(threaded) in ("A", "B")
    charts = profile_charts(threaded, tables, baseline)
    for name, left_out in {"performance": "C, D", "speedup": "C, D" if baseline == "A" else "A, B"}.items():
        assert f"without solvers that use another number of threads: {left_out}" in subtitle(charts[name])
    for name in ("data", "accuracy"):
        assert "threads" not in subtitle(charts[name])


@needs_node
@pytest.mark.parametrize("baseline", ["A", pytest.param("C", marks=pytest.mark.slow)])
def test_the_script_of_the_page_compares_solvers_in_as_many_threads(baseline: str, threaded: RunFrames) -> None:
    document = page_document(threaded, baseline)
    script = """const whole = { ...run, run, accuracy: 1e-6 };
        const fastest = Object.fromEntries(summary(whole).map((row) => [row.solver.name, row.fastest]));
        const notes = [otherThreads(whole), otherThreads(whole, whole.baseline)];
        const [performance, speedup] = [performanceProfile(whole), speedups(whole)];
        console.log(JSON.stringify({ performance, speedup, fastest, notes }));"""
    found = output_of_page(document, script)
    for name, table in profile_tables(threaded, baseline).items():
        if name in found:
            own = table[(table["family"] == ALL) & (table["accuracy"] == 1e-6)]
            own = own[own["view"] == EVERY] if "view" in own else own
            rows = pd.DataFrame(found[name])
            pd.testing.assert_frame_equal(rows, own[rows.columns].reset_index(drop=True), rtol=1e-6, check_dtype=False)
    assert found["fastest"]["C"] is found["fastest"]["D"] is None
    assert found["fastest"]["A"] + found["fastest"]["B"] == threaded.cases["problem"].nunique()
    left_out = ["C, D", "C, D" if baseline == "A" else "A, B"]
    assert found["notes"] == [f"Without solvers that use another number of threads: {names}." for names in left_out]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("dropped", [[], ["s0"], ["s1", "s3"]])
def test_profiles_equal_their_definition_over_the_solvers_shown(seed: int, dropped: list[str]) -> None:
    seconds = random_seconds(seed).drop(columns=dropped)
    performance, data, budgets = performance_profile(seconds), data_profile(seconds), budget_table(seconds)
    times = seconds.to_dict()
    for solver, own in times.items():
        for ratio in np.append(performance["ratio"].unique(), [1.7, 1e9]):
            count = 0
            for problem, time in own.items():
                solved = [other[problem] for other in times.values() if other[problem] == other[problem]]
                count += bool(solved) and time / min(solved) <= ratio
            assert on_stairs(performance, "ratio", solver, ratio) == count / len(own)
        for limit in np.append(data["seconds"].unique(), BUDGETS[-1] * 20):
            assert on_stairs(data, "seconds", solver, limit) == sum(time <= limit for time in own.values()) / len(own)
        for row in budgets[budgets["solver"] == solver].to_dict("records"):
            assert row["solved"] == sum(time <= row["budget"] for time in own.values())
            assert row["share"] == row["solved"] / row["problems"] == row["solved"] / len(own)


@pytest.mark.parametrize("seed", range(20))
def test_speedups_are_over_the_problems_that_both_solve(seed: int) -> None:
    seconds = random_seconds(seed)
    times = seconds.to_dict()
    expected = {
        (solver, problem): times["s2"][problem] / time
        for solver, own in times.items()
        for problem, time in own.items()
        if solver != "s2" and time == time and times["s2"][problem] == times["s2"][problem]
    }
    found = speedups(seconds, "s2")
    assert {(row.solver, row.problem): row.speedup for row in found.itertuples()} == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(20))
def test_an_accuracy_profile_counts_residuals_of_at_most_each_accuracy(seed: int) -> None:
    residuals = random_seconds(seed) ** 3
    for row in accuracy_profile(residuals).to_dict("records"):
        own = residuals[row["solver"]].tolist()
        assert row["share"] == sum(value <= row["residual"] for value in own) / len(own)


def test_solvers_that_solve_nothing_give_profiles_of_zero() -> None:
    seconds = random_seconds(0) * np.nan
    for profile in (performance_profile(seconds), data_profile(seconds), budget_table(seconds)):
        assert set(profile["solver"]) == set(seconds.columns)
        assert (profile["share"] == 0.0).all()
        assert np.isfinite(profile.select_dtypes("number")).all(axis=None)
    assert speedups(seconds, "s0").empty


@pytest.mark.slow
def test_times_and_residuals_are_those_of_points_that_count(reference_run: RunFrames) -> None:
    seconds, residuals = seconds_matrix(reference_run, 1e-6), residual_matrix(reference_run)
    assert seconds.shape == residuals.shape == (8, 15)
    times = times_to_accuracies(reference_run.points, [1e-6], reference_run.info.plan.limits.solve_seconds)[1e-6]
    for problem, solver in reference_run.points.groupby(["problem", "solver"]).groups:
        expected = times.get((problem, solver), np.nan)
        assert seconds.at[problem, solver] == pytest.approx(expected, nan_ok=True)
        assert (residuals.at[problem, solver] <= 1e-6) == np.isfinite(expected)


@pytest.mark.weekly
def test_families_are_profiled_as_the_problems_of_each_alone(
    reference_run: RunFrames, reference_tables: dict[str, pd.DataFrame]
) -> None:
    funnel = reference_run.only([name for name in reference_run.info.plan.problems if name.startswith("funnel")])
    for name, table in profile_tables(funnel, "NSGS").items():
        alone = table[table["family"] == ALL].drop(columns="family").reset_index(drop=True)
        whole = reference_tables[name]
        of_family = whole[whole["family"] == "funnel"].drop(columns="family").reset_index(drop=True)
        pd.testing.assert_frame_equal(of_family, alone)


@pytest.mark.weekly
def test_every_chart_has_its_numbers_beside_it(
    reference_run: RunFrames, reference_tables: dict[str, pd.DataFrame], tmp_path: Path
) -> None:
    files = {file.name for file in write_profiles(reference_run, "NSGS", tmp_path)}
    for name in ("performance", "data", "accuracy", "speedup"):
        assert {f"profile-{name}{ending}" for ending in (".svg", ".png", ".csv")} <= files
    assert {"profile-families.svg", "profile-budgets.csv"} <= files
    stored = pd.read_csv(tmp_path / "profile-performance.csv")
    pd.testing.assert_frame_equal(stored, reference_tables["performance"])


@pytest.mark.slow
def test_default_baseline_is_the_solver_that_solves_most(reference_run: RunFrames) -> None:
    solved = seconds_matrix(reference_run, 1e-8).notna().sum()
    assert solved[baseline_of(reference_run)] == solved.max()
    assert baseline_of(reference_run, "Lemke") == "Lemke"


def test_a_run_without_cases_has_no_profiles(finished_run: Path, tmp_path: Path) -> None:
    (tmp_path / "run.json").write_bytes((finished_run / "run.json").read_bytes())
    with pytest.raises(BenchError, match="no finished case"):
        baseline_of(load(tmp_path))


@pytest.mark.slow
def test_problems_with_an_excluded_time_are_left_out_of_times_and_stay_in_residuals(finished_run: Path) -> None:
    frames = load(finished_run)
    marked = (frames.points["problem"] == "funnel-30") & (frames.points["solver"] == "SORprox")
    one = replace(frames, points=frames.points.assign(is_excluded=marked))
    assert "funnel-30" in seconds_matrix(frames, 1e-4).index
    assert "funnel-30" not in seconds_matrix(one, 1e-4).index
    pd.testing.assert_frame_equal(residual_matrix(one), residual_matrix(frames))
    charts = profile_charts(one, profile_tables(one, "SORprox"), "SORprox")
    assert "2 of them without excluded times" in subtitle(charts["data"])
    assert "without excluded times" not in subtitle(charts["accuracy"])


@pytest.mark.parametrize(
    ("seconds", "excluded", "reason"),
    [
        ((0.1, 0.2), "", ""),
        (
            (0.1, 0.2),
            "preempted",
            "no speed-ups: no problem without excluded times is solved by both A and another solver",
        ),
        ((0.1, 9.0), "", "no speed-ups: no problem is solved by both A and another solver"),
    ],
)
def test_a_chart_without_speedups_states_the_reason(
    seconds: tuple[float, float], excluded: str, reason: str, tmp_path: Path
) -> None:
    cases = [
        case_record(problem="p", solver=solver, points=[solved_point(1e-2, [timed_round(0, one, excluded=excluded)])])
        for solver, one in zip("AB", seconds, strict=True)
    ]
    frames = load(store_run(tmp_path / "run", cases, limits=Limits(solve_seconds=1.0)))
    chart = profile_charts(frames, profile_tables(frames, "A"), "A")["speedup"]
    assert ("no speed-ups" in subtitle(chart)) is bool(reason)
    assert reason in subtitle(chart)
    assert ("no times to compare" in json.dumps(chart.to_dict())) is bool(reason)
    write_drawing(chart, tmp_path / "speedup")


@pytest.mark.weekly
def test_a_run_of_excluded_times_alone_has_a_report(finished_run: Path, tmp_path: Path) -> None:
    copied = tmp_path / "run"
    shutil.copytree(finished_run, copied)
    frames = load(copied)
    busy = replace(frames, points=frames.points.assign(is_excluded=True))
    made = build_report(busy, charts=True, baseline="", page=True)
    assert made.unwritten == ""
    assert made.summary is not None
    assert seconds_matrix(busy, 1e-4).isna().all(axis=None)
    assert made.summary["correct_1e-04"].max() > 0.0
