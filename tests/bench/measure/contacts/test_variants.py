"""Scaling units by powers of two keeps a solver's steps; a copy keeps the difficulty of a problem but no number."""

import numpy as np
import pytest
from proxbench.bench.measure.contacts.variants import disguised_copy, in_other_units, perturbed_copy
from proxbench.problems import ContactProblem, judge, load
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
def test_a_problem_in_other_units_is_solved_in_the_same_steps_to_the_same_bits(name: str, solver: str) -> None:
    problem, method = load(name), create(solver)
    if method.supports(problem):
        pytest.skip(f"{solver} does not support it")
    changed = in_other_units(problem)
    one, other = (method.prepare(each.fresh()).solve(STOP) for each in (problem, changed.problem))
    assert (one.status, one.iterations) == (other.status, other.iterations)
    assert one.impulses.tobytes() == (changed.back.diagonal() * other.impulses).tobytes()


@pytest.mark.parametrize("name", ["hard-mixed-laws", "funnel-30"])
def test_variants_do_not_reveal_the_digest_name_or_answer_of_the_problem(name: str) -> None:
    problem = load(name)
    variants = [disguised_copy(problem, 1e-4), *(in_other_units(problem).problem for _ in range(4))]
    assert problem.digest not in {variant.digest for variant in variants}
    assert {variant.name for variant in variants} == {"problem"}
    assert all(variant.answer is None and not variant.provenance for variant in variants)


@pytest.mark.parametrize("name", ["hard-counterexample", "hard-sticking-box", "funnel-30"])
def test_a_disguised_copy_has_the_same_laws_and_spectrum(name: str) -> None:
    problem = load(name)
    copy = disguised_copy(problem, 1e-4)
    assert copy.delassus().nnz >= problem.delassus().nnz  # rotations fill blocks
    assert np.array_equal(np.sort(copy.laws.kind), np.sort(problem.laws.kind))
    spectra = [np.linalg.eigvalsh(one.delassus().toarray()) for one in (problem, copy)]
    assert spectra[1] / spectra[1].max() == pytest.approx(spectra[0] / spectra[0].max(), abs=1e-9)


@pytest.mark.parametrize("name", ["funnel-30", "hard-duplicated-slider-100", "hard-linked-redundant"])
def test_a_moved_copy_can_be_solved_also_where_its_contacts_are_redundant(name: str) -> None:
    """The shift of c lies in the range of G: a random one outside asks redundant contacts to separate differently."""
    copy = perturbed_copy(load(name))
    solution = create("Robust").prepare(copy).solve(Stop(1e-8, max_seconds=np.inf))
    assert judge(copy, solution.impulses).residual <= 1e-8


def test_a_moved_copy_has_another_solution() -> None:
    problem = load("funnel-30")
    velocities = []
    for one in (problem, perturbed_copy(problem)):
        found = create("Robust").prepare(one).solve(Stop(1e-10))
        velocities.append(np.sort(np.abs(one.relative_velocity(found.impulses))) / np.abs(one.free_velocity).max())
    assert np.abs(velocities[0] - velocities[1]).max() > 0.01


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_no_stored_answer_of_a_problem_solves_its_disguised_copy(tolerance: float) -> None:
    """The contacts are equal and on separate bodies: order and axes hide nothing, and units are powers of two."""
    problem = ContactProblem.from_delassus(np.eye(20), -np.ones(20), 0.0, dim=1)
    copy = disguised_copy(problem, tolerance)
    speed = 2.0 ** np.round(np.log2(np.abs(copy.free_velocity).mean()))
    answer = np.full(20, speed / copy.delassus_diagonal[0])
    assert judge(copy, answer).residual > 10.0 * tolerance
