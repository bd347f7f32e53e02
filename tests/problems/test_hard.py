"""The known answers of the hard cases hold before the judge, and by enumeration of contact states."""

import numpy as np
import pytest
from proxbench.problems import judge
from proxbench.problems.hard import GRAVITY, HARD_CASES, TIME_STEP, hard_case
from proxbench.solvers import Status, create, solve


@pytest.mark.parametrize("name", HARD_CASES)
def test_known_impulses_solve_the_problem_exactly(name: str) -> None:
    problem = hard_case(name)
    assert problem.answer is not None
    for impulses in problem.answer.impulses:
        assert judge(problem, impulses).residual <= 1e-12


@pytest.mark.parametrize(
    "name",
    [name for name in HARD_CASES if hard_case(name).answer.functionals is not None],  # type: ignore[union-attr]
)
def test_known_sums_are_met_by_a_solution_that_knows_nothing_of_them(name: str) -> None:
    problem = hard_case(name)
    assert problem.answer is not None
    solution = solve(problem, "SORprox(relaxation=0.9)", tolerance=1e-11, max_iterations=200_000)
    assert solution.status is Status.SOLVED
    error = problem.answer.impulse_error(solution.impulses)
    assert error is not None
    assert error <= 1e-8
    assert judge(problem, solution.impulses).velocity_error == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "count"),
    [("hard-counterexample", 1), ("hard-counterexample-mu4", 1), ("hard-painleve-jam", 1), ("hard-three-solutions", 3)],
)
def test_enumeration_finds_exactly_the_known_solutions(name: str, count: int) -> None:
    problem = hard_case(name)
    assert problem.answer is not None
    found = create("Enumeration").prepare(problem).all_solutions(1e-10)  # type: ignore[attr-defined]
    assert len(found) == len(problem.answer.impulses) == count
    for impulses in found:
        assert problem.answer.impulse_error(impulses) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("hard-counterexample", [(0.02130908, -0.04261815)]),
        ("hard-painleve-jam", [(0.41761, 0.50240)]),
        ("hard-three-solutions", [(0.0, 0.0), (0.01174, 0.02347), (0.33318, 0.46554)]),
    ],
)
def test_the_rods_have_the_published_impulses(name: str, published: list[tuple[float, float]]) -> None:
    answer = hard_case(name).answer
    assert answer is not None
    for known, digits in zip(answer.impulses, published, strict=True):
        assert known == pytest.approx(digits, abs=6e-6)


def test_the_impossible_contact_is_told_by_the_judge() -> None:
    verdict = judge(hard_case("hard-immovable"), np.array([1.0, 5.0]))
    assert verdict.infeasible
    assert verdict.residual == np.inf


def test_the_stack_carries_the_weight_above() -> None:
    answer = hard_case("hard-stack-2-top-heavy").answer
    assert answer is not None
    assert answer.impulses[0] == pytest.approx(np.array([1e6 + 1, 1e6]) * GRAVITY * TIME_STEP, rel=1e-15)


@pytest.mark.parametrize("name", HARD_CASES)
def test_cases_are_small_and_the_same_each_time(name: str) -> None:
    assert hard_case(name).n_rows <= 40
    assert hard_case(name).digest == hard_case(name).digest
