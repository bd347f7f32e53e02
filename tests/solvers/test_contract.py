"""Properties of every built-in solver.

Daily tests check all of them on ``WHOLE_ROW``, and a third of them on each other variant; the rest is slow.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagonal import is_on_diagonal
from proxbench.problems import ContactProblem, LawKind, ProblemError, judge, load
from proxbench.solvers import Solver, SolverError, Status, Stop, available, create
from proxbench.solvers.contract import prepared_fault
from proxbench.solvers.registry import composites

VARIANTS = [
    "Robust",
    "Jprox",
    "JORprox(relaxation=0.2)",
    "JORprox(step_size='row_sum')",
    "SORprox",
    "SORprox(relaxation=1.3)",
    "SORprox(step_size='row_sum')",
    "SORprox(form='factors')",
    "SORprox(form='factors', step_size='row_sum')",
    "SORprox(momentum=0.8)",
    "SafeguardedSORprox",
    "NesterovSORprox",
    "AndersonSORprox",
    "NSGS",
    "ColouredSORprox",
    "SemismoothNewton",
    "ProximalADMM",
    "ProximalADMM(memory=0)",
    "APGD",
    "SAP",
    "ProximalPoint",
    "InteriorPoint",
    "InteriorPoint(form='factors')",
    "CentralPath",
    "HybridNewton",
    "InteriorNewton",
    "MomentumFallback",
    "Fallback(NSGS, SemismoothNewton)",
    "ClarabelSOCP",
    "ClarabelSOCP(form='factors')",
    "ClarabelCoulomb",
    "ClarabelCoulomb(form='factors', memory=0)",
    "Refined(ClarabelCoulomb)",
    "Warm(SORprox)",
    "CvxpyCoulomb",
    "Refined(CvxpyCoulomb)",
    "CvxpyCoulomb(solver='SCS')",
    "Lemke",
    "Lemke(sides=3)",
    "PyramidPGS",
    "PyramidPGS(sides=4, relaxation=1.2)",
    "Enumeration",
]
ITERATIVE = [name for name in VARIANTS if create(name).has_iterates]

WHOLE_ROW = ("Robust", "SORprox")
"""Variants with which all tests are daily."""

STRIDE = 3
"""One in so many of the tests of each other variant is daily."""


def variants(column: int, names: Sequence[str] = VARIANTS, compiles: bool = False) -> list[Any]:
    """Return variants as parameters of a test; most are slow, but each test and each variant is daily in places.

    Args:
        column: number of the test.
        names: variants to which the test applies.
        compiles: whether ``ColouredSORprox`` would compile kernels for seconds; it is then tested weekly.
    """

    def mark_of(name: str) -> Any:
        if compiles and name == "ColouredSORprox":
            return pytest.mark.weekly
        is_daily = name in WHOLE_ROW or is_on_diagonal(VARIANTS.index(name), column, STRIDE)
        return () if is_daily else pytest.mark.slow

    marks = [mark_of(name) for name in names]
    return [pytest.param(name, marks=mark) for name, mark in zip(names, marks, strict=True)]


def sample(dim: int = 3) -> ContactProblem:
    rng = np.random.default_rng(7)
    directions = rng.normal(size=(40, 8 * dim))
    return ContactProblem.from_factors(directions, np.ones(40), rng.normal(size=8 * dim), 0.3, dim=dim)


def sample_for(name: str) -> ContactProblem:
    """Return the sample, or a simpler problem for a solver that does not support it."""
    if name == "ColouredSORprox":
        return load("funnel-30-early")  # its contacts have two bodies
    few = ContactProblem.from_factors(np.eye(6), np.ones(6), np.linspace(-1.0, 1.0, 6), 0.3, dim=2)
    return next(problem for problem in (sample(), sample(1), few) if create(name).supports(problem) is None)


def limit(name: str, iterations: int) -> int:
    """Return an iteration limit, reduced for solvers that solve a cone program per iteration."""
    most = 30 if "Cvxpy" in name else 60 if "Coulomb" in name else iterations
    return min(iterations, most)


def bits(impulses: np.ndarray) -> str:
    return hashlib.sha256(impulses.tobytes()).hexdigest()


def test_the_variants_cover_every_solver() -> None:
    assert {name.split("(")[0] for name in VARIANTS} == {*available(), *composites()}


@pytest.mark.parametrize("name", variants(0))
def test_it_implements_the_protocol_and_its_name_recreates_it(name: str) -> None:
    solver = create(name)
    assert isinstance(solver, Solver)
    assert create(solver.name) == solver


@pytest.mark.parametrize("name", VARIANTS)
def test_a_law_of_a_kind_that_it_does_not_state_is_declined(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new kind of law therefore concerns only the solvers that state it."""
    new = int.__new__(LawKind, len(LawKind))
    new._name_, new._value_ = "ELLIPTIC_FRICTION", int(new)
    monkeypatch.setitem(LawKind._value2member_map_, int(new), new)
    problem = sample_for(name)
    laws = problem.laws.fresh()
    laws.__dict__["kinds"] = problem.laws.kinds | {int(new)}
    problem = replace(problem, laws=laws)
    reason = "it has elliptic friction, and this method does not support it"
    assert reason in str(create(name).supports(problem))
    if name != "Robust":  # it reads the kinds from the array of laws
        with pytest.raises(SolverError, match=reason):
            create(name).prepare(problem)


@pytest.mark.parametrize("name", variants(1, ITERATIVE))
def test_an_observed_solve_ends_in_the_same_bits_as_a_timed_one(name: str) -> None:
    stop = Stop(tolerance=1e-9, max_iterations=limit(name, 237))
    timed = create(name).prepare(sample_for(name)).solve(stop)
    seen: list[int] = []
    observed = create(name).prepare(sample_for(name)).solve(stop, observe=lambda iteration, _: seen.append(iteration))
    assert bits(timed.impulses) == bits(observed.impulses)
    assert timed.iterations == observed.iterations == len(seen)
    assert seen == list(range(1, len(seen) + 1))


@pytest.mark.parametrize("name", variants(2, ITERATIVE))
def test_an_observer_receives_a_read_only_iterate(name: str) -> None:
    def write(_: int, impulses: np.ndarray) -> None:
        with pytest.raises(ValueError, match="read-only"):
            impulses[0] = 1.0

    create(name).prepare(sample_for(name)).solve(Stop(1e-3, 5), observe=write)


@pytest.mark.parametrize("name", variants(3))
def test_solving_twice_gives_the_same_bits(name: str) -> None:
    prepared = create(name).prepare(sample_for(name))
    stop = Stop(1e-7, 300)
    assert bits(prepared.solve(stop).impulses) == bits(prepared.solve(stop).impulses)


@pytest.mark.parametrize("name", variants(4))
def test_problem_and_start_are_not_modified(name: str) -> None:
    problem = sample_for(name)
    start = np.full(problem.n_rows, 0.1)
    digest = problem.fresh().digest
    create(name).prepare(problem).solve(Stop(1e-6, 50), start=start)
    assert problem.fresh().digest == digest
    assert np.array_equal(start, np.full(problem.n_rows, 0.1))


@pytest.mark.parametrize("name", variants(5))
def test_prepared_solvers_have_a_short_representation(name: str) -> None:
    assert len(repr(create(name).prepare(sample_for(name)))) <= 400


@pytest.mark.parametrize("name", variants(6))
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_solved_means_that_the_judge_of_its_own_model_agrees(name: str, dim: int) -> None:
    solver, problem = create(name), sample(dim)
    if solver.supports(problem):
        pytest.skip("the solver does not take it")
    for tolerance in (1e-2, 1e-5, 1e-8):
        solution = solver.prepare(problem).solve(Stop(tolerance, limit(name, 5000)))
        assert np.isfinite(solution.impulses).all()
        if solution.status is Status.SOLVED:
            assert judge(problem, solution.impulses, solver.model).residual <= 1.01 * tolerance


EXTREME_UNITS = [(570, 0), (-570, 0), (0, 570), (0, -570), (300, 300), (-300, -300)]
"""Exponents of two of units of mass and speed."""


def variants_in_extreme_units() -> list[Any]:
    """Return variants with units; of those that are not daily, two of six are slow, and the others weekly."""
    return [
        pytest.param(name, *units, marks=[*marks, *([pytest.mark.weekly] if marks and (row + column) % 3 else [])])
        for row, (name, marks) in enumerate((*one.values, one.marks) for one in variants(18))
        for column, units in enumerate(EXTREME_UNITS)
    ]


@pytest.mark.parametrize(("name", "mass", "speed"), variants_in_extreme_units())
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_no_claim_is_false_in_units_in_which_squares_leave_the_range_of_double_precision(
    name: str, mass: int, speed: int
) -> None:
    solver, usual = create(name), sample_for(name)
    assert usual.factors is not None
    directions, inverse_mass = usual.factors.force_directions, usual.factors.inverse_mass.matrix
    scaled = ContactProblem.from_factors(
        directions, 2.0**-mass * inverse_mass, 2.0**speed * usual.free_velocity, laws=usual.laws
    )
    solution = solver.prepare(scaled).solve(Stop(1e-5, limit(name, 200)))
    assert np.isfinite(solution.impulses).all()
    if solution.status is Status.SOLVED:
        assert judge(scaled, solution.impulses, solver.model).residual <= 1.01e-5


@pytest.mark.parametrize(
    "name", variants(12, [name for name in ITERATIVE if name not in ("Jprox", "JORprox(relaxation=0.2)")])
)
def test_a_start_at_the_solution_stops_at_once(name: str) -> None:
    prepared = create(name).prepare(sample_for(name))
    solution = prepared.solve(Stop(1e-7, 100_000))
    assert solution.status is Status.SOLVED
    assert prepared.solve(Stop(1e-7), start=solution.impulses).iterations == 0


@pytest.mark.parametrize("name", variants(7))
def test_an_infeasible_problem_is_reported_and_never_solved(name: str) -> None:
    problem = ContactProblem.from_factors(np.array([[1.0, 0.0]]), np.ones(1), (-1.0, -1.0), dim=1)
    assert create(name).prepare(problem).solve(Stop(1e-6)).status is Status.INFEASIBLE


@pytest.mark.parametrize("dim", [1, 3])
@pytest.mark.parametrize("name", variants(8, compiles=True))
def test_zero_free_velocity_needs_no_impulse(name: str, dim: int) -> None:
    problem = ContactProblem.from_factors(np.eye(3), np.ones(3), np.zeros(3), 0.5, dim=dim)
    if create(name).supports(problem):
        pytest.skip("the solver does not take it")
    solution = create(name).prepare(problem).solve(Stop(1e-12))
    assert solution.status is Status.SOLVED
    assert np.array_equal(solution.impulses, np.zeros(3))


@pytest.mark.parametrize("name", variants(9, compiles=True))
def test_zero_free_velocity_needs_no_impulse_from_any_start(name: str) -> None:
    """A step without forces after an impact is warm-started from the impulses of the impact."""
    row_of_three = np.array([[-1.0, 0.0], [1.0, -1.0], [0.0, 1.0]])
    still = ContactProblem.from_factors(row_of_three, np.ones(3), np.zeros(2), dim=1)
    solution = create(name).prepare(still).solve(Stop(1e-10, 1000), np.array([1.3, 0.6]))
    assert solution.status is Status.SOLVED
    assert not solution.impulses.any()


@pytest.mark.parametrize("dim", [1, 3])
@pytest.mark.parametrize("name", variants(10))
def test_a_problem_without_contacts_is_solved(name: str, dim: int) -> None:
    problem = ContactProblem.from_factors(np.zeros((3, 0)), np.ones(3), np.zeros(0), 0.5, dim=dim)
    solution = create(name).prepare(problem).solve(Stop(1e-12))
    assert solution.status is Status.SOLVED
    assert solution.impulses.shape == (0,)


@pytest.mark.parametrize("name", variants(11, ITERATIVE))
def test_the_time_limit_is_kept(name: str) -> None:
    solution = create(name).prepare(sample_for(name)).solve(Stop(1e-300, 10**9, max_seconds=1e-6))
    assert solution.status in (Status.TIME_LIMIT, Status.STALLED, Status.OSCILLATING, Status.DIVERGED)
    assert solution.iterations < 10**6


def test_the_number_of_threads_of_a_prepared_object_is_a_positive_integer() -> None:
    def prepared(threads: Any) -> Any:
        return SimpleNamespace(solve=lambda stop, start=None, observe=None: None, threads=threads)

    assert prepared_fault(prepared(2)) is None
    for wrong in (0, -1, True, 1.0, "2"):
        fault = prepared_fault(prepared(wrong))
        assert fault is not None
        assert fault.endswith(f"of which threads is {wrong!r}; it must be a whole number, at least 1")


STARTED = ["Robust", "SORprox", "NSGS", "SemismoothNewton", "InteriorPoint", "CentralPath", "Refined(ClarabelCoulomb)"]


def box() -> ContactProblem:
    return ContactProblem.from_delassus(np.eye(3), [-1.0, 0.2, 0.0], 0.5)


@pytest.mark.parametrize("name", [*STARTED, "Fallback(NSGS)", "ProximalPoint", "HybridNewton", "ClarabelSOCP", "Lemke"])
def test_a_tolerance_instead_of_a_stop_is_refused(name: str) -> None:
    with pytest.raises(SolverError, match=r"^solve takes a Stop, such as Stop\(1e-6\), not a value of type float"):
        create(name).prepare(box()).solve(1e-6)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [*STARTED, "ClarabelSOCP", "Lemke"])
@pytest.mark.parametrize(
    ("start", "words"),
    [
        ("abc", "start must be an array of real numbers"),
        (np.ones(3) * 1j, "start must be an array of real numbers, got an array of complex128"),
        ([0.0, np.nan, 0.0], r"start\[1\] = nan must be finite; omit start to begin from zero"),
        ([1.0, 2.0], r"start must have shape \(3,\), one entry per row; got \(2,\)"),
    ],
)
def test_a_start_that_is_no_finite_vector_is_refused(name: str, start: Any, words: str) -> None:
    with pytest.raises(ProblemError, match=f"^{words}"):
        create(name).prepare(box()).solve(Stop(1e-6), start=start)
