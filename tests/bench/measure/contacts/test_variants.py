"""In units of powers of two a solver takes the same steps, and meets no number that it knows."""

import numpy as np
import pytest
from proxbench.bench.measure.contacts.variants import another, in_other_units
from proxbench.problems import load
from proxbench.solvers import Stop, create

STOP = Stop(1e-8, max_iterations=300)


@pytest.mark.parametrize(
    "name",
    [
        "hard-counterexample",
        "hard-mixed-laws",
        "hard-towed-wheel-rolls",
        "hard-resisting-sphere-3-axes",
        "woodpecker-beak-impact",
        "funnel-100",
    ],
)
@pytest.mark.parametrize("solver", ["SORprox", "NSGS", "ClarabelSOCP", "PyramidPGS", "SemismoothNewton"])
@pytest.mark.parametrize("number", [0, 1])
def test_a_problem_in_other_units_is_solved_in_the_same_steps_to_the_same_bits(
    name: str, solver: str, number: int
) -> None:
    problem, method = load(name), create(solver)
    if method.supports(problem):
        pytest.skip(f"{solver} does not support it")
    changed = in_other_units(problem, number)
    one, other = (method.prepare(each.fresh()).solve(STOP) for each in (problem, changed.problem))
    assert (one.status, one.iterations) == (other.status, other.iterations)
    assert one.impulses.tobytes() == (changed.units * other.impulses).tobytes()


@pytest.mark.parametrize("name", ["hard-mixed-laws", "funnel-30"])
def test_no_digest_or_velocity_of_a_variant_is_that_of_the_problem(name: str) -> None:
    problem = load(name)
    variants = [another(problem), *(in_other_units(problem, number).problem for number in range(4))]
    assert problem.digest not in {variant.digest for variant in variants}
    assert {variant.name for variant in variants} == {"problem"}
    assert all(variant.answer is None and not variant.provenance for variant in variants)


def test_speeds_grow_and_shrink_in_turn() -> None:
    problem = load("funnel-30")
    largest = [np.abs(in_other_units(problem, number).problem.free_velocity).max() for number in range(4)]
    before = np.abs(problem.free_velocity).max()
    assert [speed > before for speed in largest] == [True, False, True, False]


@pytest.mark.parametrize("name", ["hard-mixed-laws", "funnel-30"])
def test_another_problem_has_the_same_laws_and_entries_and_another_solution(name: str) -> None:
    problem = load(name)
    other = another(problem)
    assert other.n_rows == problem.n_rows
    assert other.n_contacts == problem.n_contacts
    assert other.delassus().nnz == problem.delassus().nnz
    for field in ("kind", "friction_coefficient"):
        assert np.array_equal(np.sort(getattr(other.laws, field)), np.sort(getattr(problem.laws, field)))
    ratios = np.sort(np.abs(other.free_velocity)) / np.sort(np.abs(problem.free_velocity))
    assert np.ptp(ratios[np.isfinite(ratios)]) > 0.0
