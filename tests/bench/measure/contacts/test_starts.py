"""A warm case starts from its own answers to the steps before; a cold one, and the same numbers alone, from zero."""

from pathlib import Path

import numpy as np
import pytest
from proxbench.bench import load, run
from proxbench.problems import ContactProblem
from proxbench.problems import load as load_problem
from proxbench.problems.exchange.sequences import BEFORE, STEP, continued_impulses
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


def test_a_warm_case_takes_the_iterations_of_the_solver_from_its_own_answers(frames: object) -> None:
    solver, stop, expected, start = create("SORprox"), Stop(TOLERANCE), {}, None
    steps = steps_of_a_sequence()
    for step, following in zip(steps, [*steps[1:], None], strict=True):
        solution = solver.prepare(step).solve(stop, start)
        expected[step.name] = solution.iterations
        start = None if following is None else continued_impulses(step, solution.impulses, following)
    del expected["step-0"]
    found = iterations(frames, "Warm(SORprox)")
    assert found == expected
    cold = iterations(frames, "SORprox")
    assert all(found[name] < cold[name] for name in found)
    assert cold["step-0"] == create("SORprox").prepare(steps[0]).solve(stop).iterations


def test_the_first_step_has_no_warm_start_and_says_so(frames: object) -> None:
    cases = frames.cases.set_index(["problem", "solver"])  # type: ignore[attr-defined]
    case = cases.loc[("step-0", "Warm(SORprox)")]
    assert (case["outcome"], "it follows no step" in case["reason"]) == ("unsupported", True)


def test_the_table_compares_the_steps_that_have_both_starts(frames: object) -> None:
    from proxbench.bench.report.accuracy import starts_table

    (row,) = starts_table(frames).to_dict("records")  # type: ignore[arg-type]
    assert (row["solver"], row["problems"], row["cold_solved"], row["warm_solved"]) == ("SORprox", 2, 2, 2)
    warm, cold = iterations(frames, "Warm(SORprox)"), iterations(frames, "SORprox")
    assert row["warm_iterations"] == np.mean([*warm.values()])
    assert row["cold_iterations"] == np.mean([cold[name] for name in warm])


def test_a_step_whose_predecessor_is_not_in_the_run_is_not_solved_warm(tmp_path: Path) -> None:
    step = steps_of_a_sequence()[2]
    alone = run(step, "Warm(SORprox)", results=tmp_path, run_id="alone", tolerances=TOLERANCE, passes=1)
    assert "step-1, which is not available" in alone.cases["reason"].iloc[0]
    assert load(tmp_path / "alone").n_finished == 1
