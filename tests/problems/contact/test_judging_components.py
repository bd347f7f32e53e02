"""No entry of a vector hides a violation in another one, at any magnitude of the numbers."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, Model, ProblemError, judge, load
from proxbench.problems.contact.judge import local_residual
from proxbench.problems.contact.problem import FREE_FALL
from proxbench.problems.contact.residual import ModelResidual, Residual
from proxbench.problems.contact.transformations import united
from proxbench.solvers import Stop, create


def bullet(speed: float) -> ContactProblem:
    return ContactProblem.from_delassus(np.eye(3), (-speed, 0.0, 0.0), 0.3)


def test_uncoupled_fast_contact_does_not_lower_the_residual() -> None:
    funnel = load("funnel-100")
    impulses = create("SORprox").prepare(funnel).solve(Stop(1e-4, max_iterations=10_000)).impulses
    alone = judge(funnel, impulses).residual
    speed = 1000.0 * Residual(funnel).scale
    together = judge(united([funnel, bullet(speed)]), np.append(impulses, (speed, 0.0, 0.0)))
    assert together.residual == pytest.approx(alone, rel=1e-9)
    assert together.component_residuals[-1] <= 1e-15


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), factor=st.floats(1e-6, 1e6))
def test_the_residual_of_problems_side_by_side_is_the_largest_of_theirs(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    parts, impulses = [], []
    for scale in (1.0, factor):
        root = rng.normal(size=(6, 6))
        parts.append(ContactProblem.from_delassus(root.T @ root, scale * rng.normal(size=6), 0.4))
        impulses.append(scale * rng.normal(size=6))
    verdicts = [judge(part, own) for part, own in zip(parts, impulses, strict=True)]
    together = judge(united(parts), np.concatenate(impulses))
    for name in ("residual", "local_residual"):
        expected = max(getattr(verdict, name) for verdict in verdicts)
        assert getattr(together, name) == pytest.approx(expected, rel=1e-12)
    assert together.component_residuals == pytest.approx([verdict.residual for verdict in verdicts], rel=1e-12)


@pytest.mark.parametrize("still", [0.0, 1e-14])
def test_a_component_at_rest_is_judged_relative_to_the_whole_problem(still: float) -> None:
    problem = ContactProblem.from_delassus(np.eye(2), (-1.0, -still), dim=1)
    verdict = judge(problem, (1.0, 1e-3))
    assert verdict.residual == pytest.approx(1e-3, rel=1e-9)
    assert verdict.local_residual == pytest.approx(1e-3, rel=1e-9)


def test_the_local_residual_relates_each_contact_to_those_that_share_a_body_with_it() -> None:
    # three contacts in a chain: the outer ones do not touch each other
    matrix = np.array([[2.0, 0.1, 0.0], [0.1, 2.0, 0.1], [0.0, 0.1, 2.0]])
    problem = ContactProblem.from_delassus(matrix, (-100.0, -1.0, -0.1), dim=1)
    verdict = judge(problem, np.zeros(3))  # violations of 100, 1 and 0.1
    assert verdict.residual == pytest.approx(1.0)
    assert [verdict.local_median, verdict.local_q99] == pytest.approx([0.1, 1.0])
    local = [100.0 / 100.0, 1.0 / 100.0, 0.1 / 1.0]
    assert verdict.local_residual == pytest.approx(max(local))
    assert verdict.local_median == pytest.approx(sorted(local)[1])


@pytest.mark.parametrize("name", ["funnel-100", "hard-rolling-sphere", "hard-linked-redundant", "hard-sticking-box"])
@pytest.mark.parametrize("scale", [0.0, 1e-200, 1.0, 1e16])
def test_the_local_residual_alone_is_that_of_the_verdict(name: str, scale: float) -> None:
    problem = load(name)
    impulses = scale * np.random.default_rng(3).normal(size=problem.n_rows)
    assert local_residual(problem, impulses) == judge(problem, impulses).local_residual


def test_free_fall_bounds_the_local_scale_from_below() -> None:
    slow = ContactProblem.from_delassus(np.eye(1), [-1e-6], dim=1, provenance={FREE_FALL: 1e-2})
    assert judge(slow, [0.0]).local_residual == pytest.approx(1e-4)
    assert judge(slow, [0.0]).residual == 1.0
    assert load("funnel-100").free_fall == pytest.approx(9.81 * 5e-4)


@pytest.mark.parametrize(
    ("known", "free_fall"),
    [(0.25, 0.25), (2, 2.0), (0.0, 0.0), (-1.0, 0.0), (np.inf, 0.0), (np.nan, 0.0), ("0.5", 0.0), (None, 0.0)],
)
def test_invalid_free_fall_counts_as_unknown(known: object, free_fall: float) -> None:
    given = {} if known is None else {FREE_FALL: known}
    assert ContactProblem.from_delassus(np.eye(1), [-1.0], dim=1, provenance=given).free_fall == free_fall


def test_quantiles_of_local_residuals_are_the_least_that_their_share_does_not_exceed() -> None:
    """Of 1 to 100, 50 numbers are at most 50, 90 at most 90, and 99 at most 99; a single number is all of them."""
    each = united([ContactProblem.from_delassus(np.eye(1), [-1.0], dim=1) for _ in range(100)])
    verdict = judge(each, 1.0 - np.arange(1.0, 101.0) / 100.0)
    assert (verdict.local_median, verdict.local_q90, verdict.local_q99) == pytest.approx((0.5, 0.9, 0.99))
    alone = judge(ContactProblem.from_delassus(np.eye(1), [-1.0], dim=1), [0.75])
    assert (alone.local_median, alone.local_q90, alone.local_q99) == pytest.approx((0.25, 0.25, 0.25))


@pytest.mark.parametrize("exponent", [-1000, -500, 500, 1000])
@pytest.mark.parametrize("model", [Model.COULOMB, Model.CONVEX, Model.pyramid(8)])
def test_very_small_and_very_large_velocities_are_judged_alike(exponent: int, model: Model) -> None:
    rng = np.random.default_rng(5)
    root = rng.normal(size=(9, 9))
    usual = ContactProblem.from_delassus(root.T @ root, rng.normal(size=9), 0.4, provenance={FREE_FALL: 0.5})
    impulses, unit = rng.normal(size=9), 2.0**exponent
    scaled = replace(usual, free_velocity=unit * usual.free_velocity, provenance={FREE_FALL: unit * 0.5})
    expected, found = judge(usual, impulses, model), judge(scaled, unit * impulses, model)
    for name in ("residual", "local_residual", "local_median", "energy_residual", "natural_map_q", "natural_map_max"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-12)
    assert found.penetration_velocity == pytest.approx(unit * expected.penetration_velocity, rel=1e-12)
    velocity = scaled.relative_velocity(unit * impulses)
    assert ModelResidual(scaled, model)(unit * impulses, velocity) == pytest.approx(expected.residual, rel=1e-12)
    if model is Model.COULOMB:
        assert Residual(scaled)(unit * impulses, velocity) == pytest.approx(expected.residual, rel=1e-12)


@pytest.mark.parametrize("exponent", [-800, -560, 560, 800])
@pytest.mark.parametrize("model", [Model.COULOMB, Model.CONVEX, Model.pyramid(8), Model.FRICTIONLESS], ids=str)
def test_very_small_and_very_large_masses_are_judged_alike(exponent: int, model: Model) -> None:
    """The squares of impulses leave the range of double precision, and those of velocities do not."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(9, 12))
    matrix, c, unit = root.T @ root, rng.normal(size=12), 2.0**exponent
    laws = Laws.concatenate([Laws.contacts(0.4, 3, 2).with_rolling(0.1, 1), Laws.contacts(0.0, 1, 3), Laws.joints(1)])
    impulses = rng.normal(size=12)
    expected = judge(ContactProblem.from_delassus(matrix, c, laws=laws), impulses, model)
    found = judge(ContactProblem.from_delassus(matrix / unit, c, laws=laws), unit * impulses, model)
    for name in ("residual", "local_residual", "local_median", "energy_residual"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-12), name


@pytest.mark.parametrize("exponent", [-400, 400])
def test_impulses_velocities_and_energies_have_their_units_at_very_small_and_large_velocities(exponent: int) -> None:
    """Velocities and impulses scale with the unit of speed, energies with its square, without any rounding."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(9, 9))
    usual = ContactProblem.from_delassus(root.T @ root, rng.normal(size=9), 0.4)
    impulses, unit = rng.normal(size=9), 2.0**exponent
    expected = judge(usual, impulses)
    found = judge(replace(usual, free_velocity=unit * usual.free_velocity), unit * impulses)
    for name in ("penetration_velocity", "cone_violation"):
        assert getattr(found, name) == unit * getattr(expected, name) > 0.0, name
    for name in ("complementarity", "dissipated_energy"):
        assert getattr(found, name) == unit * unit * getattr(expected, name) != 0.0, name


@pytest.mark.parametrize(
    ("matrix", "what"),
    [
        ([[1.0, -3.0], [-3.0, 1.0]], "exceeds the square root"),
        ([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]], "eigenvalue"),
        ([[0.0, 1.0], [1.0, 1.0]], "exceeds the square root"),
    ],
)
def test_an_indefinite_matrix_is_refused(matrix: list[list[float]], what: str) -> None:
    with pytest.raises(ProblemError, match=f"{what}.*positive semidefinite"):
        ContactProblem.from_delassus(np.array(matrix), -np.ones(len(matrix)), dim=1)


def test_an_indefinite_matrix_of_many_rows_is_refused_and_a_singular_one_is_not() -> None:
    rng = np.random.default_rng(0)
    directions = np.linalg.qr(rng.normal(size=(300, 300)))[0]
    values = np.linspace(0.0, 1.0, 300)
    singular = (directions * values) @ directions.T
    ContactProblem.from_delassus(0.5 * (singular + singular.T), -np.ones(300), dim=1)
    values[0] = -0.05
    indefinite = (directions * values) @ directions.T
    with pytest.raises(ProblemError, match="eigenvalue"):
        ContactProblem.from_delassus(0.5 * (indefinite + indefinite.T), -np.ones(300), dim=1)


@pytest.mark.parametrize("bad", [np.array([1j]), np.array(["1"]), np.array([object()]), object()])
def test_numbers_that_are_not_real_are_refused(bad: object) -> None:
    with pytest.raises(ProblemError, match="real numbers"):
        ContactProblem.from_delassus(np.eye(1), bad, dim=1)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="real numbers"):
        judge(ContactProblem.from_delassus(np.eye(1), [-1.0], dim=1), bad)  # type: ignore[arg-type]


def test_a_complex_matrix_is_refused() -> None:
    for matrix in (np.array([[1j]]), sp.csr_array(np.array([[1j]]))):
        with pytest.raises(ProblemError, match="real numbers"):
            ContactProblem.from_delassus(matrix, [-1.0], dim=1)
