"""A warm case starts from its own answers to the previous steps; a cold case starts from zero."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from proxbench.bench import load, resume, run
from proxbench.bench.measure.contacts.case import Case
from proxbench.bench.measure.ladder import CasePass
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.plans import Limits
from proxbench.bench.store.store import Store
from proxbench.problems import ContactProblem
from proxbench.problems import load as load_problem
from proxbench.problems.exchange.sequences import BEFORE, STEP, Predecessors, start_digest, warm_start_impulses
from proxbench.solvers import Stop, create

TOLERANCE = 1e-4


def steps_of_a_sequence() -> list[ContactProblem]:
    """Return three steps with slowly growing free velocities, the contacts of the last one in another order."""
    problem = load_problem("funnel-30")
    keys = [f"contact {number}" for number in range(problem.n_contacts)]
    steps = []
    for number, factor in enumerate((1.0, 1.01, 1.03)):
        step = ContactProblem(factor * problem.free_velocity, problem.laws, factors=problem.factors, keys=tuple(keys))
        before = {BEFORE: f"step-{number - 1}"} if number else {}
        steps.append(step.renamed(f"step-{number}", **{STEP: number}, **before))
    return steps


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> object:
    solvers = ["SORprox", "Warm(SORprox)"]
    steps, folder = steps_of_a_sequence(), tmp_path_factory.mktemp("runs")
    return run(steps, solvers, results=folder, run_id="warm", tolerances=[TOLERANCE], passes=1, solve_seconds=5.0)


def iterations(frames: object, solver: str) -> dict[str, int]:
    points = frames.points[frames.points["solver"] == solver]  # type: ignore[attr-defined]
    return dict(zip(points["problem"], points["iterations"].astype(int), strict=True))


@pytest.mark.slow
def test_a_warm_case_takes_the_iterations_of_the_solver_from_its_own_answers(frames: object) -> None:
    solver, stop, expected, start = create("SORprox"), Stop(TOLERANCE), {}, None
    steps = steps_of_a_sequence()
    for step, following in zip(steps, [*steps[1:], None], strict=True):
        solution = solver.prepare(step).solve(stop, start)
        expected[step.name] = solution.iterations
        start = None if following is None else warm_start_impulses(step, solution.impulses, following)
    del expected["step-0"]
    found = iterations(frames, "Warm(SORprox)")
    assert found == expected
    cold = iterations(frames, "SORprox")
    assert all(found[name] < cold[name] for name in found)
    assert cold["step-0"] == create("SORprox").prepare(steps[0]).solve(stop).iterations


@pytest.mark.slow
def test_a_warm_case_has_the_digest_of_its_start_and_a_cold_one_has_none(frames: object) -> None:
    cases = frames.cases.set_index(["solver", "problem"])["start"]  # type: ignore[attr-defined]
    steps = steps_of_a_sequence()
    assert cases["SORprox"].tolist() == ["", "", ""]
    assert cases["Warm(SORprox)"].tolist() == [start_digest(steps[:number], steps[number]) for number in range(3)]


Changed = Callable[[ContactProblem], ContactProblem]


@pytest.mark.parametrize(
    ("place", "change", "is_equal"),
    [
        (0, lambda step: step.fresh(), True),
        (0, lambda step: scaled(step, 2.0), False),
        (1, lambda step: scaled(step, 2.0), False),
        (1, lambda step: step.keyed(["new", *step.keys[1:]]), False),
        (2, lambda step: step.keyed([step.keys[1], step.keys[0], *step.keys[2:]]), False),
    ],
)
def test_another_start_changes_the_digest_of_the_start_and_nothing_else(
    place: int, change: Changed, is_equal: bool
) -> None:
    known, steps = steps_of_a_sequence(), steps_of_a_sequence()
    steps[place] = change(steps[place])
    for solver, differing in (("SORprox", set()), ("Warm(SORprox)", set() if is_equal else {"start"})):
        before, after = identity(known, solver), identity(steps, solver)
        assert {name for name in before if before[name] != after[name]} == differing


def scaled(step: ContactProblem, factor: float) -> ContactProblem:
    other = ContactProblem(factor * step.free_velocity, step.laws, factors=step.factors, keys=step.keys)
    return other.renamed(step.name, **step.provenance)


def identity(steps: list[ContactProblem], solver: str) -> dict[str, object]:
    before = Predecessors(tuple(steps[:-1]))
    return Case(
        steps[-1],
        solver_spec(solver),
        Limits(),
        [TOLERANCE],
        problem_data=b"",
        stored=None,
        case_pass=CasePass(0, 0),
        before=before,
    ).identity()


@pytest.mark.slow
def test_a_finished_run_is_resumed_where_a_case_has_another_start(frames: object) -> None:
    store = Store.open(frames.folder)  # type: ignore[attr-defined]
    (case,) = (one for one in store.read_cases("step-2")[0] if one.start)
    assert len(resume(store.folder).info.sessions) == 1
    store.write_case(replace(case, start="0" * 16))
    again = resume(store.folder)
    assert len(again.info.sessions) == 2
    assert case.start in again.cases["start"].tolist()


@pytest.mark.slow
def test_the_first_step_has_no_warm_start_and_says_so(frames: object) -> None:
    cases = frames.cases.set_index(["problem", "solver"])  # type: ignore[attr-defined]
    case = cases.loc[("step-0", "Warm(SORprox)")]
    assert (case["outcome"], "it follows no step" in case["reason"]) == ("unsupported", True)


@pytest.mark.slow
def test_the_table_compares_the_steps_that_have_both_starts(frames: object) -> None:
    from proxbench.bench.report.accuracy import starts_table

    (row,) = starts_table(frames).to_dict("records")  # type: ignore[arg-type]
    assert (row["solver"], row["problems"], row["cold_solved"], row["warm_solved"]) == ("SORprox", 2, 2, 2)
    warm, cold = iterations(frames, "Warm(SORprox)"), iterations(frames, "SORprox")
    assert row["warm_iterations"] == np.mean([*warm.values()])
    assert row["cold_iterations"] == np.mean([cold[name] for name in warm])


def test_warm_solve_is_skipped_if_the_previous_step_is_not_in_the_run(tmp_path: Path) -> None:
    step = steps_of_a_sequence()[2]
    alone = run(step, "Warm(SORprox)", results=tmp_path, run_id="alone", tolerances=TOLERANCE, passes=1)
    assert "step-1, which is not available" in alone.cases["reason"].iloc[0]
    assert load(tmp_path / "alone").n_finished == 1
