"""The known answers of the hard cases agree with the judge and with independent algorithms."""

import os

import numpy as np
import pytest
from proxbench.bench.conformance.trial import require_known_answer
from proxbench.problems import ContactProblem, ProblemError, judge
from proxbench.problems.contact.laws import LawKind
from proxbench.problems.contact.residual import UNIT, Residual
from proxbench.problems.hard import CASE_GROUPS, GRAVITY, HARD_CASES, TIME_STEP, hard_case
from proxbench.solvers import Status, create, solve

SEEKERS = ("Lemke", "SORprox(relaxation=0.9)", "Refined(ClarabelCoulomb)")
"""Pivoting, sweeps and cone programs: three independent ways to a solution."""

MAX_ROWS = 600 if os.environ.get("PROXBENCH_PROFILE") == "full" else 40
"""Largest number of rows of cases for which solutions are sought."""

IMMOVABLE = [name for name in HARD_CASES if name.startswith("hard-immovable")]


def answer_of(problem: ContactProblem):  # type: ignore[no-untyped-def]
    assert problem.answer is not None
    return problem.answer


def test_known_impulses_solve_the_problem_to_rounding() -> None:
    for problem in map(hard_case, HARD_CASES):
        known = answer_of(problem)
        witnesses = [] if known.witness is None else [known.witness]
        for impulses in [*known.impulses, *witnesses]:
            assert judge(problem, impulses).residual <= 1e-13 + Residual(problem).rounding(impulses), problem.name
            require_known_answer(problem, impulses)  # names the failing problem


def test_every_case_has_a_known_solution_or_is_known_to_be_infeasible() -> None:
    for name in HARD_CASES:
        known = answer_of(hard_case(name))
        parts = (known.impulses, known.velocity is not None, known.functionals is not None, known.witness is not None)
        assert any(parts) or not known.solvable, name


def last_bits(problem: ContactProblem, impulses: np.ndarray) -> float:
    """Return the residual due to four rounding errors of the largest impulse; doubles allow hardly less."""
    residual = Residual(problem)
    return 4.0 * UNIT * residual.largest_diagonal_term(impulses) / residual.scale if residual.scale > 0.0 else 0.0


@pytest.mark.parametrize("group", CASE_GROUPS)
def test_independent_solvers_reproduce_the_known_answers(group: str) -> None:
    sought, found = set(), set()
    for problem in map(hard_case, CASE_GROUPS[group]):
        if problem.n_rows > MAX_ROWS:
            continue
        sought.add(problem.name)
        tolerance = max(1e-9, *(last_bits(problem, impulses) for impulses in answer_of(problem).impulses), 0.0)
        for solver in SEEKERS:
            if create(solver).supports(problem) is None:
                solution = solve(problem, solver, tolerance=tolerance, max_iterations=20_000, max_seconds=60.0)
                if judge(problem, solution.impulses).residual <= tolerance:
                    found.add(problem.name)
                    require_known_answer(problem, solution.impulses)
    assert found == sought - UNSOUGHT


UNSOUGHT = {
    "hard-stack-100-top-1e8",
    "hard-squeezed",
    *IMMOVABLE,
}
"""Cases that none of the three solves to 1e-9: doubles are not accurate enough, or there is no solution."""


@pytest.mark.slow
def test_enumeration_finds_no_other_answer() -> None:
    enumerated = 0
    for problem in map(hard_case, HARD_CASES):
        if not 0 < problem.n_rows <= 12 or create("Enumeration").supports(problem):
            continue
        enumerated += 1
        known = answer_of(problem)
        found = create("Enumeration").prepare(problem).all_solutions(1e-10)  # type: ignore[attr-defined]
        for impulses in found:
            require_known_answer(problem, impulses)
        if problem.name in NEEDS_MORE_THAN_LEAST_NORM:
            continue
        assert bool(found) == known.solvable, problem.name
        if known.impulses and not (problem.delassus_diagonal == 0).any():
            assert len(found) == len(known.impulses), problem.name
    assert enumerated >= 59


NEEDS_MORE_THAN_LEAST_NORM = {
    "hard-scaled-rows",
    "hard-scaled-rows-3",
    "hard-stack-2-top-heavy",
    "hard-stack-2-top-1e8",
}
"""Cases whose systems are singular to rounding."""


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("hard-counterexample", [(0.02130908, -0.04261815)]),
        ("hard-painleve-jam", [(0.41761, 0.50240)]),
        ("hard-three-solutions", [(0.0, 0.0), (0.01174, 0.02347), (0.33318, 0.46554)]),
    ],
)
def test_the_rods_have_the_published_impulses(name: str, published: list[tuple[float, float]]) -> None:
    for known, digits in zip(answer_of(hard_case(name)).impulses, published, strict=True):
        assert known == pytest.approx(digits, abs=6e-6)


def test_several_rods_may_each_take_any_of_their_solutions() -> None:
    known = answer_of(hard_case("hard-three-solutions-3")).impulses
    assert len({tuple(impulses.tolist()) for impulses in known}) == 3**3
    (one, _, three) = answer_of(hard_case("hard-three-solutions")).impulses
    expected = np.concatenate([three, 1e-2 * one, 1e2 * three])
    assert any(impulses == pytest.approx(expected, rel=1e-14) for impulses in known)


@pytest.mark.parametrize("family", ["hard-incline-mu0.1", "hard-incline-mu10", "hard-rolling-sphere"])
def test_bodies_on_an_incline_hold_up_to_the_critical_angle_and_slide_beyond(family: str) -> None:
    compliance, friction = (3.5, 0.3) if "sphere" in family else (1.0, float(family.partition("mu")[2]))
    for word, excess in (("below", -1e-9), ("above", 1e-9)):
        slope = np.arctan(friction * compliance) + excess
        acceleration = np.array([0.0, GRAVITY * (np.sin(slope) - friction * compliance * np.cos(slope)), 0.0])
        velocity = answer_of(hard_case(f"{family}-{word}")).velocity
        assert velocity == pytest.approx(TIME_STEP * np.maximum(acceleration, 0.0), rel=1e-5, abs=1e-17)
    assert acceleration[1] > 0.0


@pytest.mark.parametrize("name", ["hard-inclines-30", "hard-rolling-spheres-30"])
def test_of_many_bodies_on_inclines_only_those_beyond_the_critical_angle_slide(name: str) -> None:
    velocity = answer_of(hard_case(name)).velocity
    assert velocity is not None
    slides = velocity.reshape(-1, 3)[:, 1] > 1e-15
    assert np.array_equal(slides, np.resize([False, False, True], 30))


@pytest.mark.parametrize("name", IMMOVABLE)
def test_judge_finds_unstoppable_contacts_infeasible(name: str) -> None:
    problem = hard_case(name)
    verdict = judge(problem, np.ones(problem.n_rows))
    assert verdict.infeasible
    assert verdict.residual == np.inf
    assert not answer_of(problem).solvable


def test_beside_the_contact_that_nothing_can_stop_the_others_have_a_solution() -> None:
    problem = hard_case("hard-immovable-among-50")
    c = problem.free_velocity.copy()
    (stuck,) = np.flatnonzero((problem.delassus_diagonal == 0.0) & (c < 0.0))
    c[stuck] = 0.0
    harmless = ContactProblem.from_delassus(problem.delassus(), c, laws=problem.laws)
    assert solve(harmless, "HybridNewton", tolerance=1e-8).status is Status.SOLVED
    assert 0 < stuck < problem.n_rows - 3


def test_approaching_walls_have_a_large_residual_under_any_impulses() -> None:
    for impulses in ([0.0, 0.0], [1.0, 0.0], [1e9, 1e9]):
        assert judge(hard_case("hard-squeezed"), np.array(impulses)).residual >= 1.0


def test_normal_impulse_without_effect_gives_no_friction() -> None:
    problem = hard_case("hard-friction-for-nothing")
    assert judge(problem, np.zeros(2)).residual == 0.0
    assert judge(problem, np.array([5.0, -1.0])).residual == 1.0


def test_the_stack_carries_the_weight_above() -> None:
    known = answer_of(hard_case("hard-stack-2-top-heavy"))
    assert known.impulses[0] == pytest.approx(np.array([1e6 + 1, 1e6]) * GRAVITY * TIME_STEP, rel=1e-15)


def test_heavy_bodies_on_light_ones_are_solved_with_impulses_accurate_to_1e_6() -> None:
    for name in ("hard-stack-2-top-heavy", "hard-stack-10-top-1e4"):
        problem = hard_case(name)
        (impulses,) = answer_of(problem).impulses
        for solver in ("Lemke", "Refined(ClarabelCoulomb)"):
            solution = solve(problem, solver, tolerance=1e-8)
            assert solution.status is Status.SOLVED
            assert judge(problem, solution.impulses).residual <= 1e-8
            assert solution.impulses == pytest.approx(impulses, rel=1e-6)


@pytest.mark.parametrize("name", [name for name in HARD_CASES if name.startswith("hard-float32")])
def test_single_precision_input_is_converted_exactly(name: str) -> None:
    problem = hard_case(name)
    assert problem.free_velocity.dtype == np.float64
    witness = answer_of(problem).witness
    assert witness is not None
    assert judge(problem, witness).residual <= 1e-15


def test_single_precision_rounding_of_a_symmetric_matrix_is_tolerated() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(9, 12)).astype(np.float32)
    delassus = np.einsum("ik,jk->ij", root, root)
    delassus[0, 1] *= np.float32(1.0) + np.finfo(np.float32).eps
    problem = ContactProblem.from_delassus(delassus, np.ones(9, dtype=np.float32), 0.3)
    assert abs(problem.delassus() - problem.delassus().T).max() == 0.0
    with pytest.raises(ProblemError, match="symmetric"):
        ContactProblem.from_delassus(delassus.astype(np.float64), np.ones(9), 0.3)


def test_cases_are_reproducible_and_cover_every_kind_of_law() -> None:
    kinds: set[int] = set()
    for name in HARD_CASES:
        problem = hard_case(name)
        assert problem.digest == hard_case(name).digest
        kinds |= set(problem.laws.kind.tolist())
    assert kinds == {kind.value for kind in LawKind}
    assert sum(map(len, CASE_GROUPS.values())) == len(HARD_CASES)
