"""A suggestion is the solver that is fastest on the measured problems most like a given one, and says what it costs."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from proxbench.bench import load as load_run
from proxbench.bench import suggest
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.report.suggestion import nearest
from proxbench.bench.report.suggestion.features import FEATURES, distances, features
from proxbench.bench.report.suggestion.measured import SHIPPED, measured_in, shipped
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import CaseRecord
from proxbench.problems import ContactProblem, load
from proxbench.problems.catalog.catalog import is_held
from proxbench.solvers.registry import find
from simulated_runs import solved_point, store_run
from stored_cases import case_record, timed_round

FLOWS = ("funnel-30", "funnel-100", "funnel-300")
BLOCKS = ("hard-resting-block-2", "hard-resting-block-8", "hard-resting-block-64")
SWEEPS, PIVOTS = "SORprox", "Lemke"


def measured(problem: str, solver: str, seconds: float) -> CaseRecord:
    point = solved_point(1e-6, [timed_round(number, seconds) for number in range(3)])
    return case_record(problem=problem, solver=solver, digest=load(problem).digest, points=[point])


@pytest.fixture
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in which one solver is faster on flows, the other one on blocks."""
    times = {SWEEPS: (1e-3, 2e-3), PIVOTS: (4e-3, 1e-3)}
    cases = [measured(name, solver, one[name in BLOCKS]) for name in (*FLOWS, *BLOCKS) for solver, one in times.items()]
    return store_run(tmp_path_factory.mktemp("runs") / "run", cases)


@pytest.mark.parametrize(("problems", "expected"), [(FLOWS, SWEEPS), (BLOCKS, PIVOTS)])
def test_the_fastest_solver_of_the_nearest_problems_is_suggested(
    run: Path, problems: tuple[str, ...], expected: str
) -> None:
    found = suggest(problems, run, 1e-6)
    assert found.solver == expected
    assert set(found.problems["solver"]) == {expected}
    assert found.solvers["solver"].iloc[0] == expected
    assert not found.far


def test_regret_is_none_where_neighbours_agree_and_that_of_the_single_best_is_what_it_loses(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(nearest, "NEIGHBOURS", 2)  # the others of each kind
    found = suggest("funnel-30", run, 1e-6)
    assert found.regret == pytest.approx((1.0, 0, 6))
    assert found.single.factor > found.regret.factor
    assert "1.00 times the least time, 0 of 6 unsolved" in found.words


def test_regret_over_families_leaves_out_all_of_a_family(run: Path) -> None:
    others = suggest("funnel-30", run, 1e-6).regret_of_families
    assert others.problems == 6
    assert others.factor == pytest.approx((4.0**3 * 2.0**3) ** (1 / 6))


def test_a_coarser_accuracy_is_looked_up_at_the_next_finer_one(run: Path) -> None:
    assert suggest("funnel-30", run, 1e-3).accuracy == 1e-6


def test_a_solver_that_leaves_the_nearest_problems_unsolved_is_not_suggested(tmp_path: Path) -> None:
    cases = [measured(name, SWEEPS, 5e-3) for name in FLOWS]
    cases += [
        case_record(problem=name, solver=PIVOTS, digest=load(name).digest, outcome=Outcome.CRASHED)
        for name in FLOWS[:2]
    ]
    cases.append(measured(FLOWS[2], PIVOTS, 1e-3))
    assert suggest("funnel-30", store_run(tmp_path / "run", cases), 1e-6).solver == SWEEPS


def test_a_solver_that_does_not_support_a_problem_is_not_suggested(tmp_path: Path) -> None:
    cases = [measured("funnel-30", "Enumeration", 1e-6), measured("funnel-30", SWEEPS, 1e-3)]
    folder = store_run(tmp_path / "run", cases)
    assert suggest("funnel-100", folder, 1e-6).solver == SWEEPS
    with pytest.raises(BenchError, match="decline funnel-100"):
        suggest("funnel-100", store_run(tmp_path / "other", cases[:1]), 1e-6)


def test_features_do_not_depend_on_units_and_have_known_values() -> None:
    problem = load("funnel-30")
    values = dict(zip(FEATURES, features(problem), strict=True))
    assert values["rows"] == 3.0
    assert values["sliding"] == 0.5
    assert values["joints"] == values["rolling"] == 0.0
    given = ContactProblem.from_delassus(
        7.0 * problem.delassus(), problem.free_velocity, laws=problem.laws, name="other"
    )
    same = features(given)
    assert np.isnan(same[FEATURES.index("redundancy")])
    kept = [place for place, name in enumerate(FEATURES) if name != "redundancy"]
    assert same[kept] == pytest.approx(features(problem)[kept])
    assert distances(same, np.array([features(problem)])) == pytest.approx([0.0], abs=1e-9)


def test_the_table_of_the_package_is_of_its_problems_as_they_are() -> None:
    table = shipped()
    names = [name for name in table.problems.index if is_held(name)]
    assert len(names) > 100
    for name in names[::20]:
        assert table.problems.loc[name, list(FEATURES)].to_numpy(dtype=float) == pytest.approx(
            features(load(name)), nan_ok=True
        )
    for solver in table.times["solver"].unique():
        assert find(solver) is None


def test_a_table_is_read_as_it_was_written(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = measured_in(load_run(run))
    table.write(tmp_path / SHIPPED)
    monkeypatch.setattr("proxbench.bench.report.suggestion.measured.files", lambda package: tmp_path)
    again = shipped()
    key = ["problem", "solver", "accuracy"]
    pd.testing.assert_frame_equal(again.problems, table.problems, check_names=False)
    pd.testing.assert_frame_equal(
        again.times.sort_values(key, ignore_index=True), table.times.sort_values(key, ignore_index=True)
    )


@pytest.mark.slow
def test_nothing_to_go_by_is_said_in_one_sentence(
    run: Path, tmp_path_factory: pytest.TempPathFactory, mistake: Callable[[str], str]
) -> None:
    empty = store_run(tmp_path_factory.mktemp("runs") / "none", [])
    assert "has no accuracy as fine as 1e-09" in mistake(f"suggest funnel-30 --run {run} --accuracy 1e-9")
    for accuracy in ("-1", "0", "2"):
        assert "a judged residual between 0 and 1, got" in mistake(f"suggest funnel-30 --accuracy {accuracy}")
    assert "is no stored run" in mistake("suggest funnel-30 --run nothing")
    assert "there is no problem 'funel-30'" in mistake(f"suggest funel-30 --run {run}")
    assert "has no measured case" in mistake(f"suggest funnel-30 --run {empty}")


def test_the_command_prints_a_table_and_what_it_costs(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["suggest", *FLOWS, "--run", str(run), "--accuracy", "1e-6"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == f"take     {SWEEPS} for all of these together, factor 1"
    assert run_command(["suggest", *FLOWS, "--run", str(run), "--accuracy", "1e-6", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["solver"] == SWEEPS


def test_a_problem_that_nothing_moves_has_features_but_no_redundancy() -> None:
    fixed = ContactProblem.from_factors(np.zeros((0, 3)), np.zeros(0), [0.1, 0.0, 0.0], 0.3, name="fixed")
    values = features(fixed)
    assert np.isnan(values[FEATURES.index("redundancy")])
    assert suggest(fixed).solver


def test_what_is_not_known_is_null_in_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = store_run(tmp_path / "run", [measured("funnel-30", SWEEPS, 1e-3)])
    assert run_command(["suggest", "funnel-30", "--run", str(folder), "--accuracy", "1e-6", "--json"]) == 0
    said = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(name))
    assert said["regret"] == {"factor": None, "unsolved": 0, "problems": 0}
