"""A transformed problem has the same solutions."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, ProblemError, judge
from proxbench.problems.contact.transformations import duplicated, in_units, permuted, rotated, united
from proxbench.problems.hard import hard_case
from proxbench.problems.hard.families import Family, LinkedFamily, random_linked_problem, random_problem

NAMES = ["hard-mixed-laws", "hard-sticking-box", "hard-tower-3", "hard-tresca-joint", "hard-remote-partner"]


def moved(problem: ContactProblem) -> np.ndarray:
    """Return generic impulses."""
    return np.random.default_rng(3).normal(size=problem.n_rows)


@pytest.mark.parametrize("name", NAMES)
def test_order_and_tangents_change_no_verdict(name: str) -> None:
    problem = hard_case(name)
    rng = np.random.default_rng(1)
    for other in (
        permuted(problem, rng.permutation(problem.n_contacts)),
        rotated(problem, rng.uniform(-3, 3, size=problem.laws.n_laws)),
    ):
        impulses = moved(other.problem)
        ours, theirs = judge(other.problem, impulses), judge(problem, other.impulses(impulses))
        assert ours.penetration_velocity == pytest.approx(theirs.penetration_velocity, rel=1e-12)
        assert ours.dissipated_energy == pytest.approx(theirs.dissipated_energy, rel=1e-12)
        if name not in ("hard-mixed-laws", "hard-tresca-joint"):  # there α, the larger diagonal entry, changes
            assert ours.residual == pytest.approx(theirs.residual, rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_units_change_no_verdict(name: str) -> None:
    problem = hard_case(name)
    other = in_units(problem, mass=1e-6, length=1e3, time=60.0)
    impulses = moved(problem) * 60.0 / (1e-6 * 1e3)
    ours, theirs = judge(other.problem, impulses), judge(problem, other.impulses(impulses))
    assert ours.residual == pytest.approx(theirs.residual, rel=1e-12)
    assert ours.energy_residual == pytest.approx(theirs.energy_residual, rel=1e-12)
    assert problem.answer is not None
    for known in other.problem.answer.impulses:  # type: ignore[union-attr]
        assert judge(other.problem, known).residual <= 1e-12


def test_a_contact_in_micrometres_and_milligrams_by_hand() -> None:
    problem = ContactProblem.from_delassus(np.array([[0.5]]), np.array([-3.0]), dim=1)  # 2 kg at 3 m/s: 6 N s
    other = in_units(problem, mass=1e-6, length=1e-6)
    assert other.problem.free_velocity == pytest.approx([-3e6])  # µm/s
    assert other.problem.delassus().toarray() == pytest.approx(np.array([[0.5e-6]]))  # 1/mg
    assert other.impulses(np.array([6e12])) == pytest.approx([6.0])  # mg µm/s


@pytest.mark.parametrize("name", ["hard-mixed-laws", "hard-sticking-box", "hard-tower-3", "hard-tresca-joint"])
def test_both_copies_of_a_contact_share_its_impulse(name: str) -> None:
    problem = hard_case(name)
    assert problem.answer is not None
    known = (*problem.answer.impulses, *([] if problem.answer.witness is None else [problem.answer.witness]))
    for contact in range(problem.n_contacts):
        other = duplicated(problem, contact)
        assert other.problem.n_contacts == problem.n_contacts + 1
        for impulses in known:
            shared = np.linalg.pinv(other.back.toarray()) @ impulses  # half to each copy
            assert judge(other.problem, shared).residual <= 1e-12
            assert other.impulses(shared) == pytest.approx(impulses)


def test_known_velocities_and_functionals_are_transformed_with_the_problem() -> None:
    problem = random_problem(Family(6, 1, n_dofs=4), 2)
    other = permuted(problem, [5, 4, 3, 2, 1, 0])
    assert other.problem.answer is not None
    assert problem.answer is not None
    assert other.problem.answer.velocity == pytest.approx(problem.answer.velocity[::-1])  # type: ignore[index]
    box = rotated(hard_case("hard-sticking-box"), 0.3).problem
    assert box.answer is not None
    assert box.answer.functionals is not None
    assert box.answer.impulse_error(np.linalg.pinv(box.answer.functionals) @ box.answer.values) == pytest.approx(
        0.0, abs=1e-15
    )


def test_a_union_of_problems_keeps_their_known_answers() -> None:
    parts = [hard_case("hard-stack-10"), hard_case("hard-tresca-joint")]
    whole = united(parts)
    assert whole.n_contacts == 13
    assert whole.answer is not None
    assert judge(whole, whole.answer.impulses[0]).residual <= 1e-12
    assert united([*parts, hard_case("hard-squeezed")]).answer.solvable is False  # type: ignore[union-attr]


def test_impossible_transformations_are_rejected() -> None:
    with pytest.raises(ProblemError, match="permutation of 0 to 3"):
        permuted(hard_case("hard-sticking-box"), [0, 1, 2, 2])
    with pytest.raises(ProblemError, match="bounded by another contact"):
        duplicated(hard_case("hard-remote-partner"), 0)


@pytest.mark.parametrize("rolling_rows", [0, 1, 2, 3])
@pytest.mark.parametrize("how", ["units", "order", "tangents", "copy", "beside"])
def test_joints_and_rolling_friction_are_transformed_with_their_solution(how: str, rolling_rows: int) -> None:
    problem = random_linked_problem(LinkedFamily(4, 3, rolling_rows=rolling_rows), 3)
    assert problem.answer is not None
    assert problem.answer.witness is not None
    rng = np.random.default_rng(1)
    if how == "beside":
        whole, twice = united([problem, problem]), np.tile(problem.answer.witness, 2)
        assert judge(whole, twice).residual <= 1e-13
        assert judge(whole, 1.5 * twice).residual == pytest.approx(
            judge(problem, 1.5 * problem.answer.witness).residual, rel=1e-12
        )
        return
    other = {
        "units": in_units(problem, mass=1e-6, length=1e3, time=60.0),
        "order": permuted(problem, rng.permutation(problem.n_contacts)),
        "tangents": rotated(problem, rng.uniform(-3, 3, size=problem.laws.n_laws)),
        "copy": duplicated(problem, 2),
    }[how]
    known = np.linalg.pinv(other.back.toarray(), rcond=1e-14) @ problem.answer.witness
    assert judge(other.problem, known).residual <= 1e-11
    assert other.impulses(known) == pytest.approx(problem.answer.witness, rel=1e-9, abs=1e-12)
    if how in ("units", "order"):
        changed = known * rng.uniform(0.5, 1.5, size=len(known))
        ours, theirs = judge(other.problem, changed), judge(problem, other.impulses(changed))
        for field in ("residual", "local_residual", "energy_residual"):
            assert getattr(ours, field) == pytest.approx(getattr(theirs, field), rel=1e-9), field


def test_a_rolling_contact_in_millimetres_by_hand() -> None:
    laws = Laws.contacts(np.array([0.0]), 1, 1).with_rolling(0.01, 1)
    problem = ContactProblem.from_delassus(np.diag([0.5, 20.0]), (-3.0, 7.0), laws=laws)
    other = in_units(problem, length=1e-3)
    assert other.problem.free_velocity == pytest.approx([-3000.0, 7.0])  # mm/s, rad/s
    assert other.problem.delassus().toarray() == pytest.approx(np.diag([0.5, 20e-6]))  # 1/kg, 1/(kg mm²)
    assert other.problem.laws.friction_coefficient == pytest.approx([0.0, 10.0])  # mm
    assert other.impulses(np.array([6000.0, -60e3])) == pytest.approx([6.0, -0.06])  # N s, N m s
