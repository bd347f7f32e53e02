"""Fallback runs its parts in order, from the start and from zero, within common limits."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, judge, load
from proxbench.solvers import Model, Solution, SolverError, Status, Stop, create, solve
from proxbench.solvers.composite.fallback import ITERATIONS, WARM_ITERATIONS, Fallback, MomentumFallback

ONE = ContactProblem.from_delassus([[1.0]], [-1.0], dim=1)


@dataclass
class Scripted:
    """Returns 1 − error: solved from zero without error, otherwise with the status ``ends``."""

    error: float = 0.0
    refusal: str | None = None
    ends: Status = Status.STALLED
    tried: list[tuple[int, bool]] = field(default_factory=list)
    name: str = "Scripted"

    model = Model.COULOMB
    has_iterates = True

    def supports(self, problem: ContactProblem) -> str | None:
        return self.refusal

    def prepare(self, problem: ContactProblem) -> "Scripted":
        return self

    def solve(self, stop: Stop, start: np.ndarray | None = None, observe: object = None) -> Solution:
        self.tried.append((stop.max_iterations, start is not None))
        solved = start is None and self.error == 0.0
        wrong = 0.0 if solved else max(self.error, 0.5 * (start is not None))
        status = Status.SOLVED if solved else self.ends
        return Solution(np.array([1.0 - wrong]), status, min(stop.max_iterations, 700))


def fallback_of(*parts: Scripted) -> Fallback:
    return Fallback(*parts)


def test_a_failed_warm_run_is_followed_by_one_from_zero_and_both_are_counted() -> None:
    first = Scripted()
    solution = fallback_of(first).prepare(ONE).solve(Stop(1e-4, 20_000), np.ones(1))
    assert first.tried == [(WARM_ITERATIONS, True), (20_000 - WARM_ITERATIONS, False)]
    assert solution.status is Status.SOLVED
    assert solution.iterations == WARM_ITERATIONS + 700
    assert solution.impulses == [1.0]
    assert solution.message == "Scripted from the start: stalled; Scripted from zero: solved"


def test_parts_run_in_order_and_the_last_has_the_remaining_iterations() -> None:
    first, second, third = Scripted(0.3, name="A"), Scripted(0.2, name="B"), Scripted()
    solution = fallback_of(first, second, third).prepare(ONE).solve(Stop(1e-4, 20_000), np.ones(1))
    assert [first.tried[1], second.tried[0]] == [(ITERATIONS, False)] * 2
    assert third.tried == [(20_000 - WARM_ITERATIONS - 2 * 700, False)]
    assert solution.status is Status.SOLVED


def test_without_success_the_best_impulses_are_returned() -> None:
    solution = (
        fallback_of(Scripted(0.3, name="A"), Scripted(0.1, name="B"), Scripted(0.2))
        .prepare(ONE)
        .solve(Stop(1e-4, 20_000), np.ones(1))
    )
    assert solution.status is Status.STALLED
    assert solution.impulses == [0.9]


def test_the_iteration_limit_holds_for_all_parts_together() -> None:
    first, second = Scripted(0.3, name="A"), Scripted()
    solution = fallback_of(first, second).prepare(ONE).solve(Stop(1e-4, WARM_ITERATIONS), np.ones(1))
    assert first.tried == [(WARM_ITERATIONS, True)]
    assert second.tried == []
    assert solution.status is Status.ITERATION_LIMIT


def test_a_time_limit_of_any_part_is_the_status_even_if_the_best_part_stalled() -> None:
    solution = (
        fallback_of(Scripted(0.1, name="A"), Scripted(0.3, ends=Status.TIME_LIMIT))
        .prepare(ONE)
        .solve(Stop(1e-4, 20_000))
    )
    assert solution.impulses == [0.9]
    assert solution.status is Status.TIME_LIMIT


def test_no_part_starts_after_the_time_limit() -> None:
    solution = create("Fallback(SORprox, NSGS)").prepare(load("pile-100")).solve(Stop(1e-12, 10**6, 1e-6))
    assert solution.status is Status.TIME_LIMIT
    assert "NSGS" not in solution.message


@pytest.mark.parametrize("start", [None, np.zeros(1)], ids=["none", "zero"])
def test_fallback_does_not_repeat_a_start_from_zero(start: np.ndarray | None) -> None:
    first = Scripted()
    fallback_of(first).prepare(ONE).solve(Stop(1e-4, 2000), start)
    assert len(first.tried) == 1


def test_a_part_that_does_not_support_the_problem_is_left_out() -> None:
    first, second = Scripted(refusal="not this one"), Scripted()
    fallback = fallback_of(first, second)
    assert fallback.supports(ONE) is None
    assert fallback.prepare(ONE).solve(Stop(1e-4)).status is Status.SOLVED
    assert first.tried == []
    assert fallback_of(first, first).supports(ONE) == "Scripted: not this one; Scripted: not this one"
    with pytest.raises(SolverError, match="not this one"):
        fallback_of(first).prepare(ONE)


def test_the_impulses_are_the_bits_of_the_part_that_solves_the_problem() -> None:
    for name, solver in (("funnel-30", "SORprox"), ("hard-counterexample", "NSGS")):
        problem = load(name)
        alone = solve(problem, solver, tolerance=1e-6)
        fallback = solve(problem, "Fallback(SORprox, NSGS)", tolerance=1e-6)
        assert alone.status is fallback.status is Status.SOLVED
        assert np.array_equal(alone.impulses, fallback.impulses)


def test_an_observer_sees_consecutive_iterations_of_all_parts_and_changes_nothing() -> None:
    prepared, seen = create("Fallback(SORprox, NSGS, iterations=40)").prepare(load("hard-counterexample")), []
    start = np.array([1.0, 1.0])
    alone = prepared.solve(Stop(1e-10), start)
    watched = prepared.solve(Stop(1e-10), start, lambda iteration, _: seen.append(iteration))
    assert seen == list(range(1, alone.iterations + 1))
    assert np.array_equal(alone.impulses, watched.impulses)
    assert alone.message.count("SORprox") == 2
    assert alone.message.endswith("NSGS from zero: solved")


def test_a_part_without_iterates_makes_a_fallback_without_iterates() -> None:
    fallback = create("Fallback(SORprox, Enumeration)")
    assert not fallback.has_iterates
    seen: list[int] = []
    fallback.prepare(load("hard-stack-10")).solve(Stop(1e-4), observe=lambda iteration, _: seen.append(iteration))
    assert seen == []


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ("SORprox, ClarabelSOCP", "SORprox solves coulomb, and ClarabelSOCP convex"),
        ("SORprox, iterations=0", "iterations"),
        ("SORprox, warm_iterations=2.5", "warm_iterations"),
    ],
)
def test_unsuitable_parts_and_options_are_refused(parts: str, reason: str) -> None:
    with pytest.raises(SolverError, match=reason):
        create(f"Fallback({parts})")


def test_the_best_impulses_are_best_in_the_model_of_the_parts() -> None:
    """A sliding block: neither part reaches 1e-30, and the convex answer has a Coulomb residual of order one."""
    problem = ContactProblem.from_factors(np.eye(3), np.ones(3), (-1.0, 5.0, 0.0), 0.3)
    solution = create("Fallback(ClarabelSOCP, ClarabelSOCP(form='factors'))").prepare(problem).solve(Stop(1e-30, 200))
    assert judge(problem, solution.impulses, Model.CONVEX).residual <= 1e-9


def test_momentum_fallback_solves_a_step_that_its_first_part_does_not() -> None:
    problem = load("pile-100")
    first = MomentumFallback().parts[0].prepare(problem).solve(Stop(1e-5, ITERATIONS))
    solution = solve(problem, "MomentumFallback", tolerance=1e-5, max_iterations=20_000)
    assert first.status is Status.ITERATION_LIMIT
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1.001e-5
    assert solution.message.count("from zero") > 1


def test_momentum_fallback_skips_parts_that_need_factors() -> None:
    laws = Laws(np.array([0]), np.array([0]), np.zeros(1), np.zeros(1), np.array([-1]))
    problem = ContactProblem.from_delassus(np.eye(1), (-1.0,), laws=laws)
    solution = solve(problem, "MomentumFallback")
    assert solution.impulses == pytest.approx([1.0])
    assert solution.message.startswith("Robust")


def test_a_part_that_is_not_a_solver_is_refused() -> None:
    name: Any = "SORprox"
    with pytest.raises(SolverError, match=r"must be solvers such as create\('SORprox'\), got 'SORprox'"):
        Fallback(name)
