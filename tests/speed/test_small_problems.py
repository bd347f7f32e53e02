"""Time of one to ten contacts, from prepared numbers to impulses: the overhead of a solve.

Each round has its own problem, so that nothing is assembled before the clock starts. Making it is timed separately.
"""

import os
from collections.abc import Callable
from typing import Any

import pytest
from contestants import TOLERANCE
from proxbench import solve_many
from proxbench.problems import ContactProblem, load
from proxbench.solvers import Solution, Status, Stop, create

PROBLEMS = ("hard-sliding-block", "hard-tower-3", "hard-stack-10", "woodpecker-lower-impact")

SOLVERS = ("SORprox", "NSGS", "SafeguardedSORprox", "MomentumFallback", "Robust", "InteriorPoint")

ROUNDS = 300


def maker(name: str, form: str) -> Callable[[], ContactProblem]:
    """Return a function that makes a new problem from the numbers of ``name``, given by G or by W and M⁻¹."""
    problem = load(name)
    c, laws, factors = problem.free_velocity, problem.laws, problem.factors
    if form == "delassus":
        matrix = problem.delassus()
        return lambda: ContactProblem.from_delassus(matrix, c, laws=laws)
    assert factors is not None
    directions, inverse_mass = factors.force_directions, factors.inverse_mass.matrix
    return lambda: ContactProblem.from_factors(directions, inverse_mass, c, laws=laws)


@pytest.mark.parametrize("form", ["delassus", "factors"])
@pytest.mark.parametrize("name", PROBLEMS)
def test_making(benchmark: Any, name: str, form: str) -> None:
    made = benchmark.pedantic(maker(name, form), rounds=ROUNDS, warmup_rounds=5)
    assert made.n_contacts <= 10


@pytest.mark.parametrize("form", ["delassus", "factors"])
@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("entry", SOLVERS)
def test_solving(benchmark: Any, entry: str, name: str, form: str) -> None:
    solver, make, stop = create(entry), maker(name, form), Stop(TOLERANCE)

    def solve(problem: ContactProblem) -> Solution:
        return solver.prepare(problem).solve(stop)

    solution = benchmark.pedantic(solve, setup=lambda: ((make(),), {}), rounds=ROUNDS, warmup_rounds=5)
    assert solution.status is Status.SOLVED
    benchmark.extra_info["iterations"] = solution.iterations


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("form", ["delassus", "factors"])
@pytest.mark.parametrize("name", PROBLEMS)
def test_solving_a_thousand_in_one_call(benchmark: Any, name: str, form: str, threads: int) -> None:
    if threads > len(os.sched_getaffinity(0)):
        pytest.skip("this process has one core")
    make = maker(name, form)
    problems = [make() for _ in range(1000)]
    many = benchmark.pedantic(solve_many, (problems, TOLERANCE), {"threads": threads}, rounds=10, warmup_rounds=1)
    assert many.residuals.max() <= TOLERANCE


@pytest.mark.parametrize("form", ["sparse", "dense"])
def test_making_of_many_contacts_given_by_their_matrix(benchmark: Any, form: str) -> None:
    problem = load("funnel-1000")
    matrix: Any = problem.delassus() if form == "sparse" else problem.delassus().toarray()
    arguments, laws = (matrix, problem.free_velocity), {"laws": problem.laws}
    made = benchmark.pedantic(ContactProblem.from_delassus, args=arguments, kwargs=laws, rounds=20, warmup_rounds=2)
    assert made.n_contacts == problem.n_contacts
