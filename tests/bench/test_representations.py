"""The representations of runs, reports, comparisons, plans and simulations are short."""

from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest
from proxbench.bench import compare, load
from proxbench.bench.measure.plan import make_plan
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.simulation import Simulation
from proxbench.problems import load as load_problem
from proxbench.solvers import available, create
from simulated_runs import store_run
from stored_cases import solved_case

MAX_TEXT_LENGTH = 400
MAX_TABLE_LENGTH = 3000
MAX_RECORD_LENGTH = 2000


def plan_of_names(folder: Path) -> object:
    return make_plan()


def plan_of_objects(folder: Path) -> object:
    return make_plan([load_problem("funnel-1000")], [create("SORprox")])


def loaded(folder: Path) -> object:
    return load(folder)


def reported(folder: Path) -> object:
    return load(folder).report(charts=False)


def compared(folder: Path) -> object:
    return compare(folder, folder)


def planned_simulation(folder: Path) -> object:
    return make_simulation_plan("funnel(balls=300)")


@pytest.mark.parametrize("make", [plan_of_names, plan_of_objects, loaded, reported, compared, planned_simulation])
def test_a_representation_is_short_text_and_a_small_table(make: Callable[[Path], object], tmp_path: Path) -> None:
    cases = [solved_case(load_problem("hard-groove"), name, [1e-2, 1e-4]) for name in ("NSGS", "SORprox")]
    shown = make(store_run(tmp_path / "run", cases))
    assert repr(shown).startswith(f"<{type(shown).__name__}")
    assert len(repr(shown)) <= MAX_TEXT_LENGTH
    page = shown._repr_html_()  # type: ignore[attr-defined]
    assert len(page) <= MAX_TABLE_LENGTH
    HTMLParser().feed(page)


def test_a_plan_lists_few_names_and_counts_many() -> None:
    assert "funnel-30; SORprox" in repr(make_plan(["funnel-30"], ["SORprox"]))
    assert "15 solvers" in repr(make_plan())


def test_representation_of_a_simulation_shows_its_progress() -> None:
    plan = make_simulation_plan("woodpecker", duration=0.25)
    assert repr(Simulation(plan)) == "<Simulation of woodpecker: 0 steps, 0 of 0.25 s>"


def test_representation_of_run_info_is_truncated(finished_run: Path) -> None:
    info = load(finished_run).info
    assert len(repr(info)) <= MAX_RECORD_LENGTH
    assert f"run_id={info.run_id!r}"[:20] in repr(info)


@pytest.mark.slow
def test_prepared_solvers_are_short() -> None:
    problem = load_problem("woodpecker-beak-impact")
    prepared = [solver.prepare(problem) for name in available() if not (solver := create(name)).supports(problem)]
    assert len(prepared) > 20
    assert max(len(repr(one)) for one in prepared) <= MAX_TEXT_LENGTH
