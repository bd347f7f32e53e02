"""Runs of the same program do not differ, a slowdown is found, and the effect of the machine is removed."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np
import pytest
from proxbench.bench import compare, load
from proxbench.bench.report.comparison.comparison import Comparison, compare_runs
from proxbench.bench.report.comparison.times import DEGREES_OF_FREEDOM, ONE_SIDED_CONFIDENCE, RUN_SPREAD
from proxbench.bench.store.frames import RunFrames
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import PluginUse, Session
from scipy import special
from simulated_runs import MACHINE, PROBLEMS, SOLVERS, simulated_cases, solved_point, store_run
from stored_cases import case_record, timed_round

PAIRS = 20
"""Number of pairs of simulated runs."""

OTHER_SOURCE = msgspec.structs.replace(MACHINE, source="1" * 64)


def pair_of_runs(
    folder: Path, seed: int, factors: Mapping[str, float], passes: int = 3, is_same: bool = False
) -> Comparison:
    """Return the comparison of a run with a second one, in which some times are multiplied by factors."""
    before = store_run(folder / f"before-{seed}", simulated_cases(2 * seed, passes=passes))
    machine = MACHINE if is_same else OTHER_SOURCE
    after = store_run(folder / f"after-{seed}", simulated_cases(2 * seed + 1, factors, passes), machine)
    return compare(before, after)


def slowed(frames: RunFrames, solver: str, factor: float) -> RunFrames:
    """The run with the times of a solver multiplied by a factor."""
    tables = {}
    for name in ("points", "rounds"):
        table = getattr(frames, name)
        scaled = table["total_seconds"].where(table["solver"] != solver, factor * table["total_seconds"])
        tables[name] = table.assign(total_seconds=scaled)
    return dataclasses.replace(frames, **tables)


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> list[Comparison]:
    """Comparisons of runs of the same program."""
    return [pair_of_runs(tmp_path_factory.mktemp("pairs"), seed, {}) for seed in range(PAIRS)]


@pytest.mark.weekly
def test_of_twenty_pairs_of_the_same_program_at_most_one_is_a_false_alarm(pairs: list[Comparison]) -> None:
    assert sum(bool(pair.failures("time>10%")) for pair in pairs) <= 1


@pytest.mark.weekly
def test_of_twenty_slowdowns_by_a_fifth_nineteen_are_found(pairs: list[Comparison]) -> None:
    found = [compare_runs(pair.before, slowed(pair.after, "A", 1.2)).slower() for pair in pairs]
    assert sum(any(name.startswith("A (") for name in names) for names in found) >= PAIRS - 1
    assert sum(any(not name.startswith("A") for name in names) for names in found) <= 1


@pytest.mark.slow
def test_a_slowdown_on_one_problem_is_found_there(tmp_path: Path) -> None:
    found = pair_of_runs(tmp_path, 1, {"A on p-3": 1.8})
    assert [name.partition(" (")[0] for name in found.slower()] == ["A on p-3"]


@pytest.mark.slow
def test_common_factor_of_all_times_is_attributed_to_the_machine(tmp_path: Path) -> None:
    found = pair_of_runs(tmp_path, 2, dict.fromkeys(SOLVERS, 1.5), is_same=True)
    assert found.scale == pytest.approx(1.5, rel=0.1)
    assert not found.slower()


@pytest.mark.weekly
def test_a_change_of_most_solvers_is_no_change_of_the_others(tmp_path: Path) -> None:
    found = pair_of_runs(tmp_path, 3, dict.fromkeys(SOLVERS[1:], 0.6))
    assert found.scale == 1.0
    assert not found.slower()
    assert sorted(name.partition(" (")[0] for name in found.faster()) == list(SOLVERS[1:])


@pytest.mark.slow
def test_common_slowdown_of_an_external_program_is_attributed_to_it(tmp_path: Path) -> None:
    found = pair_of_runs(tmp_path, 4, dict.fromkeys(SOLVERS, 1.4), passes=5)
    assert [name.partition(" (")[0] for name in found.slower()] == list(SOLVERS)


@pytest.mark.weekly
def test_swapping_the_runs_inverts_the_ratios(tmp_path: Path) -> None:
    there = pair_of_runs(tmp_path, 5, {"B": 2.0})
    back = compare(there.after.folder, there.before.folder)
    forth = there.solvers.set_index("solver")
    for row in back.solvers.itertuples():
        assert 1.0 / row.ratio == pytest.approx(forth["ratio"][row.solver])
        assert (1.0 / row.high, 1.0 / row.low) == pytest.approx((forth["low"][row.solver], forth["high"][row.solver]))
    assert back.faster()[0].startswith("B (0.5")


@pytest.mark.slow
def test_points_have_their_own_ratios_and_intervals(tmp_path: Path) -> None:
    points = pair_of_runs(tmp_path, 6, {"A": 3.0}, passes=5).points
    assert len(points) == 2 * len(PROBLEMS) * len(SOLVERS)
    ours = points[points["solver"] == "A"]
    assert (ours["low"] > 1.0).all()
    assert (points["low"] <= points["ratio"]).all()
    assert (points["ratio"] <= points["high"]).all()
    assert ours["ratio"].median() == pytest.approx(3.0, rel=0.1)


def test_a_single_pass_leaves_times_undecided(tmp_path: Path) -> None:
    found = pair_of_runs(tmp_path, 7, {"A": 2.0}, passes=1)
    assert not found.slower()
    assert "undecided" in found.verdict
    assert found.failures("time>10%") == ["time>10% cannot be decided: each run has one pass"]


def test_no_verdict_without_an_accuracy_that_both_runs_reach(tmp_path: Path) -> None:
    solved, unsolved = (
        store_run(tmp_path / name, simulated_cases(0, solvers=solvers)) for name, solvers in (("a", "A"), ("b", "A"))
    )
    run = load(unsolved)
    none = dataclasses.replace(run, points=run.points.assign(outcome=Outcome.STALLED, residual=1.0))
    found = compare_runs(load(solved), none)
    assert found.verdict.startswith(
        "times are undecided, no accuracy is reached by both runs; no longer solved: A on p-0"
    )
    assert found.failures("time>10%") == ["time>10% cannot be decided: no accuracy is reached by both runs"]


def test_where_all_common_times_are_excluded_the_verdict_says_so(tmp_path: Path) -> None:
    found = compare_runs(*(load(store_run(tmp_path / name, simulated_cases(0, solvers="A"))) for name in "ab"))
    excluded = dataclasses.replace(found, cases=found.cases.iloc[:0])
    assert excluded.verdict.startswith("times are undecided, all common times are excluded")


@pytest.mark.slow
def test_times_of_sessions_on_other_machines_are_not_compared(tmp_path: Path) -> None:
    """The record names the machine on which a run was started; a worker on another one may have measured its rounds."""
    elsewhere = msgspec.structs.replace(MACHINE, processor="Q", cores=64, host="far")
    session = Session(started="2026-01-01", machine=elsewhere)
    before = store_run(tmp_path / "before", simulated_cases(0))
    after = store_run(tmp_path / "after", simulated_cases(1), sessions=[session])
    assert "the machines differ: processor P, now Q" in compare(before, after).incomparable_reason


@pytest.mark.slow
def test_plugin_name_contained_in_another_keeps_the_reference_solvers(tmp_path: Path) -> None:
    use = PluginUse(kind="solver", name="Newton", source="plugin.py", sha256="0" * 64)
    names = ("Newton", "HybridNewton", "SORprox", "NSGS", "Lemke")
    runs = [
        store_run(
            tmp_path / str(seed), simulated_cases(seed, dict.fromkeys(names, factor), solvers=names), plugins=[use]
        )
        for seed, factor in ((0, 1.0), (1, 1.5))
    ]
    found = compare(*runs)
    assert found.scale == pytest.approx(1.5, rel=0.1)


@pytest.mark.parametrize("factor", [pytest.param(0.6, marks=pytest.mark.slow), 1.6])
def test_common_speed_change_of_an_external_program_is_attributed_to_it(tmp_path: Path, factor: float) -> None:
    """No solver is known to be unchanged, so a drift in either direction beyond ``MAX_DRIFT`` gives no scale."""
    names = SOLVERS[:3]
    runs = [
        store_run(tmp_path / name, simulated_cases(seed, dict.fromkeys(names, change), solvers=names), machine)
        for name, seed, change, machine in (("a", 0, 1.0, MACHINE), ("b", 1, factor, OTHER_SOURCE))
    ]
    found = compare(*runs)
    assert found.scale == 1.0
    changed = found.faster() if factor < 1.0 else found.slower()
    assert [name.partition(" (")[0] for name in changed] == list(names)


@pytest.mark.parametrize(("passes", "efficiency"), [(2, 1.0), (3, np.pi / 2.0), (4, np.pi / 2.0)])
def test_the_interval_of_a_case_follows_from_the_scatter_of_its_passes(
    passes: int, efficiency: float, tmp_path: Path
) -> None:
    """The variance of a median of three or more passes is π/2 times that of a mean; of two, both are equal."""
    offsets = np.linspace(-0.1, 0.1, passes)
    rounds = [timed_round(number, 0.01 * float(np.exp(offset))) for number, offset in enumerate(offsets)]
    cases = [case_record(points=[solved_point(1e-2, rounds)])]
    found = compare(*(store_run(tmp_path / name, cases) for name in ("before", "after"))).cases.iloc[0]
    squares, freedom = 2.0 * float((offsets**2).sum()), 2 * (passes - 1)
    variance = max(squares / freedom, squares / special.chdtri(freedom, 0.5))
    noise = np.sqrt(variance * efficiency * 2.0 / passes)
    half = special.stdtrit(DEGREES_OF_FREEDOM, ONE_SIDED_CONFIDENCE) * np.hypot(noise, RUN_SPREAD)
    assert found["ratio"] == pytest.approx(1.0)
    assert np.log(found["high"]) == pytest.approx(half, rel=1e-9)
    assert np.log(found["low"]) == pytest.approx(-half, rel=1e-9)
