"""Violations of single laws: by hand, next to other contacts, and with their rounding where friction slides."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, Model
from proxbench.problems.contact.residual import UNIT, Residual, violations
from proxbench.problems.contact.transformations import united
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem

MODELS = (Model.COULOMB, Model.CONVEX, Model.FRICTIONLESS, Model.pyramid(5))


def varied_problem(rng: np.random.Generator, size: float = 1.0) -> ContactProblem:
    """A planar or spatial contact that rolls, a frictionless one, two joints, and a joint with dry friction."""
    rolling = Laws.contacts(0.3, int(rng.integers(2, 4)), 1).with_rolling(0.05, int(rng.integers(1, 4)))
    dry = Laws(*map(np.array, ([2], [0], [0.0], [0.4], [-1])))
    laws = Laws.concatenate([rolling, Laws.contacts(0.0, 1, 1), Laws.joints(2), dry])
    root = rng.normal(size=(12, laws.n_rows))
    return ContactProblem.from_delassus(root.T @ root, size * rng.normal(size=laws.n_rows), laws=laws)


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_the_violation_of_a_law_does_not_depend_on_the_contacts_beside_it(model: Model) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        parts = [varied_problem(rng), random_linked_problem(LinkedFamily(3, 3, rolling_rows=2), 1), varied_problem(rng)]
        impulses = [rng.normal(size=part.n_rows) for part in parts]
        velocities = [rng.normal(size=part.n_rows) for part in parts]
        each = zip(parts, impulses, velocities, strict=True)
        alone = [violations(part, Residual(part), held, moved, model) for part, held, moved in each]
        whole, together = united(parts), (np.concatenate(impulses), np.concatenate(velocities))
        found = violations(whole, Residual(whole), *together, model)
        assert found == pytest.approx(np.concatenate(alone), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_the_largest_diagonal_term_is_that_of_dense_arrays(size: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        problem = united([varied_problem(rng), varied_problem(rng, size)])
        residual, impulses = Residual(problem), rng.normal(size=problem.n_rows)
        weights = np.repeat(residual.ratios * residual.lengths, problem.laws.row_count)
        held = weights * np.abs(problem.delassus().toarray().diagonal() * impulses)
        assert residual.largest_diagonal_term(impulses) == pytest.approx(held.max(), rel=1e-14)
        impulses[rng.integers(len(impulses))] = np.nan
        assert np.isnan(residual.largest_diagonal_term(impulses))


@pytest.mark.parametrize("n_rows", [1, 2, 3])
@pytest.mark.parametrize("normal", [0.5, 2.0])
def test_a_sliding_law_is_violated_by_at_least_its_rounding_and_a_resting_one_by_zero(
    n_rows: int, normal: float
) -> None:
    """With h = αΛ at the bound b, the rounding of h and of its projection is 9ub + u‖h‖."""
    laws = Laws.contacts(0.0, 1, 1).with_rolling(0.5, n_rows)
    problem = ContactProblem.from_delassus(np.eye(1 + n_rows), np.eye(1 + n_rows)[0], laws=laws)
    residual, direction = Residual(problem), np.ones(n_rows) / np.sqrt(n_rows)
    held = np.append(normal, 0.5 * normal * direction)
    for speed in (0.1, 1.0, 10.0):
        slides = residual.of_laws(held, np.append(0.0, -speed * direction))[1]
        assert 10.0 * UNIT * 0.5 * normal * (1.0 - 1e-9) <= slides <= 20.0 * UNIT * 0.5 * normal
        sticks = residual.of_laws(np.append(held[:1], 0.9 * held[1:]), np.append(0.0, 0.01 * normal * direction))[1]
        assert sticks == pytest.approx(0.01 * normal, rel=1e-15)
        assert residual.of_laws(np.append(held[:1], 0.9 * held[1:]), np.zeros(1 + n_rows))[1] == 0.0


@pytest.mark.parametrize("n_rows", [1, 2])
def test_an_additional_row_of_zeros_does_not_change_the_violation_of_a_law(n_rows: int) -> None:
    rng = np.random.default_rng(2)
    residuals = []
    for rows in (n_rows, n_rows + 1):
        laws, size = Laws.contacts(0.0, 1, 1).with_rolling(0.5, rows), 1 + rows
        residuals.append(Residual(ContactProblem.from_delassus(2.0 * np.eye(size), np.eye(size)[0], laws=laws)))
    for _ in range(50):
        held, moved = rng.normal(size=(2, 1 + n_rows))
        fewer = residuals[0].of_laws(held, moved)
        assert residuals[1].of_laws(np.append(held, 0.0), np.append(moved, 0.0)) == pytest.approx(fewer, rel=1e-13)


def test_a_contact_whose_normal_impulse_changes_no_velocity_has_the_scale_of_its_friction() -> None:
    """G is zero in the normal rows of both contacts; the second one has no friction either."""
    delassus = np.diag([0.0, 2.0, 3.0, 0.0])
    laws = Laws.concatenate([Laws.contacts(0.5, 3, 1), Laws.contacts(0.0, 1, 1)])
    residual = Residual(ContactProblem.from_delassus(delassus, np.ones(4), laws=laws))
    assert residual.alpha.tolist() == [3.0, 3.0, 0.0]
    assert residual.lengths.tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("size", [1e-200, 1e-150, 1.0, 1e150, 1e200])
def test_the_scale_of_a_contact_is_the_norm_of_its_free_velocity_at_any_size(size: float) -> None:
    problem = ContactProblem.from_delassus(np.eye(3), size * np.array([-1.0, 3.0, 4.0]), 0.5)
    assert Residual(problem).speeds == pytest.approx(size * np.array([1.0, 5.0]), rel=1e-15)


SPATIAL, PLANAR_THAT_ROLL, ROLLING_ONLY = ((3, 0), (2, 1), (1, 2))
"""Rows of a contact without rolling friction, and rows of its rolling friction; each contact has three rows."""


@pytest.mark.parametrize("rows", [SPATIAL, PLANAR_THAT_ROLL, ROLLING_ONLY])
@pytest.mark.parametrize("share", [0.0, 1.0])
@pytest.mark.parametrize("size", [1e-150, 1.0, 1e150])
def test_scales_of_contacts_of_three_rows_are_those_beside_other_laws(
    size: float, share: float, rows: tuple[int, int]
) -> None:
    """A separate loop scales problems that have spatial contacts only. With an additional joint, the general loop does.

    For ``share`` 0, the impulses of the first contact change no velocity.
    """
    rng = np.random.default_rng(4)
    for n_contacts in (1, 2, 7):
        root = rng.normal(size=(9, 3 * n_contacts))
        root[:, :3] *= share
        matrix = np.kron(np.eye(2), root.T @ root)  # two components
        free_velocity = size * rng.normal(size=6 * n_contacts) * np.repeat([1.0, 0.1], 3 * n_contacts)
        laws = Laws.contacts(0.3, rows[0], 2 * n_contacts)
        laws = laws.with_rolling(0.1, rows[1]) if rows[1] else laws
        alone = Residual(ContactProblem.from_delassus(matrix, free_velocity, laws=laws))
        beside = Laws.concatenate([laws, Laws.joints(1)])
        larger = np.block([[matrix, np.zeros((len(matrix), 1))], [np.zeros((1, len(matrix))), np.ones((1, 1))]])
        general = Residual(ContactProblem.from_delassus(larger, np.append(free_velocity, 0.0), laws=beside))
        for name in ("alpha", "lengths", "speeds", "ratios"):
            assert getattr(alone, name).tolist() == getattr(general, name)[:-1].tolist()
        assert (alone.scale, alone.stuck_law) == (general.scale, general.stuck_law)
