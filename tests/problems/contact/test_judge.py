"""The judge: exact on cases by hand, zero at solutions, and independent of the description of a contact."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, Model, ProblemError, judge
from proxbench.problems.contact.projections import onto_cone
from proxbench.problems.contact.residual import ModelResidual, Residual
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem

MIXED = Laws(
    np.array([0, 0, 1, 0, 2, 1, 2]),
    np.array([0, 1, 2, 3, 4, 6, 7]),
    np.array([0, 0, 0.5, 0, 0.4, 0, 0]),
    np.array([0, 0, 0.0, 0, 0.1, 0.3, 0.2]),
    np.array([-1, -1, 1, -1, 3, -1, -1]),
)


def one_contact(c: tuple[float, float, float], alpha: float = 2.0) -> ContactProblem:
    return ContactProblem.from_delassus(alpha * np.eye(3), c, 0.5)


def complementary(seed: int) -> tuple[ContactProblem, np.ndarray]:
    """Λ and ξ chosen complementary for every law of MIXED, then c = ξ − GΛ with a random singular G."""
    rng = np.random.default_rng(seed)
    impulses, velocity = np.zeros(9), np.zeros(9)
    for law in range(MIXED.n_laws):
        row, kind = MIXED.first_row[law], MIXED.kind[law]
        if kind == 0:
            (impulses if rng.random() < 0.6 else velocity)[row] = rng.uniform(0.1, 2.0)
            continue
        partner = MIXED.partner[law]
        bound = MIXED.fixed_bound[law]
        if partner >= 0:
            bound += MIXED.friction_coefficient[law] * impulses[MIXED.first_row[partner]]
        size = 2 if kind == 2 else 1
        direction = rng.normal(size=size)
        direction /= np.linalg.norm(direction)
        if rng.random() < 0.5:
            impulses[row : row + size] = bound * direction
            velocity[row : row + size] = -rng.uniform(0.1, 2.0) * direction
        else:
            impulses[row : row + size] = rng.uniform(0.0, 0.95) * bound * direction
    root = rng.normal(size=(6, 9))
    delassus = root.T @ root
    return ContactProblem.from_delassus(delassus, velocity - delassus @ impulses, laws=MIXED), impulses


@pytest.mark.parametrize(
    ("c", "impulses", "violation"),
    [
        ((-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0),  # approaching, no impulse: ξ_N = −1
        ((-1.0, 0.0, 0.0), (0.5, 0.0, 0.0), 0.0),  # Λ_N = 1/α stops it
        ((-1.0, 0.0, 0.0), (0.6, 0.0, 0.0), 0.2),  # pushed away at ξ_N = 0.2 < αΛ_N
        ((1.0, 0.0, 0.0), (-0.1, 0.0, 0.0), 0.2),  # pulling: α|Λ_N|
        ((-1.0, 2.0, 0.0), (0.5, -0.25, 0.0), 0.0),  # sliding against Λ_T = −μΛ_N
        ((-1.0, 2.0, 0.0), (0.5, 0.25, 0.0), 1.0),  # friction drives: R = 2 · 0.25, times α
        ((-1.0, 2.0, 0.0), (0.5, -0.35, 0.0), 0.2),  # outside the cone by 0.1, times α
        ((-1.0, 0.4, 0.0), (0.5, -0.2, 0.0), 0.0),  # sticking inside the cone
        ((-1.0, 0.4, 0.0), (0.5, -0.1, 0.0), 0.2),  # slides with ξ_T = 0.2 although the bound is not reached
        ((-1.0, 0.0, 2.0), (0.5, 0.0, -0.25), 0.0),  # the second tangent is equivalent to the first
    ],
)
def test_residual_of_one_contact_agrees_with_calculation_by_hand(
    c: tuple[float, float, float], impulses: tuple[float, ...], violation: float
) -> None:
    expected = violation / max(abs(x) for x in c)
    assert judge(one_contact(c), impulses).residual == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("with_joint", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
def test_an_impulse_that_pulls_allows_no_friction(dim: int, with_joint: bool) -> None:
    """The bound is μ max(Λ_N, 0): at Λ_N = −0.1 all of Λ_T = 1 is a violation, and no more than that."""
    laws, rows = Laws.contacts(np.array([2.0]), dim, 1), dim + with_joint
    if with_joint:
        laws = Laws.concatenate([laws, Laws.joints(1)])
    free, impulses = np.zeros(rows), np.zeros(rows)
    free[:2], impulses[:2] = (1.0, 0.5), (-0.1, 1.0)
    problem = ContactProblem.from_delassus(np.eye(rows), free, laws=laws)
    verdict = judge(problem, impulses)
    assert verdict.residual == pytest.approx(1.0, rel=1e-12)
    assert verdict.cone_violation == pytest.approx(1.0, rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_complementary_impulses_have_no_residual(seed: int) -> None:
    problem, impulses = complementary(seed)
    verdict = judge(problem, impulses)
    assert verdict.residual <= 1e-12
    assert verdict.natural_map_max <= 1e-12
    assert verdict.cone_violation <= 1e-12
    assert verdict.complementarity <= 1e-11
    assert verdict.penetration_velocity <= 1e-11


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_units_contacts_order_and_tangent_frame_do_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 5
    directions, c, friction = rng.normal(size=(9, 3 * n)), rng.normal(size=3 * n), rng.uniform(0, 1, n)
    impulses = rng.normal(size=3 * n)
    plain = judge(ContactProblem.from_factors(directions, np.ones(9), c, friction), impulses).residual
    mass, speed = 10.0 ** rng.uniform(-6, 6, 2)
    units = ContactProblem.from_factors(directions, np.ones(9) / mass, speed * c, friction)
    assert judge(units, mass * speed * impulses).residual == pytest.approx(plain, rel=1e-9)
    order = rng.permutation(n)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    permuted = ContactProblem.from_factors(directions[:, rows], np.ones(9), c[rows], friction[order])
    assert judge(permuted, impulses[rows]).residual == pytest.approx(plain, rel=1e-9)
    twice = ContactProblem.from_factors(
        np.kron(np.eye(2), directions), np.ones(18), np.tile(c, 2), np.tile(friction, 2)
    )
    assert judge(twice, np.tile(impulses, 2)).residual == pytest.approx(plain, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_turning_tangents_of_equal_stiffness_does_not_matter(seed: int) -> None:
    """With G_TT = α I in each contact, neither α nor the residual depends on the frame."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    problem = ContactProblem.from_delassus(np.diag([2.0, 3.0, 3.0]), c := rng.normal(size=3), 0.6)
    turned = ContactProblem.from_delassus(np.diag([2.0, 3.0, 3.0]), turn @ c, 0.6)
    impulses = rng.normal(size=3)
    assert judge(problem, impulses).residual == pytest.approx(judge(turned, turn @ impulses).residual, rel=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_nonfinite_impulses_have_an_infinite_residual(bad: float) -> None:
    verdict = judge(one_contact((-1.0, 0.0, 0.0)), (0.5, bad, 0.0))
    assert verdict.residual == np.inf
    assert verdict.natural_map_q == np.inf


def test_no_free_velocity_and_no_impulse_is_exact_and_any_working_impulse_is_not() -> None:
    assert judge(one_contact((0.0, 0.0, 0.0)), np.zeros(3)).residual == 0.0
    assert judge(one_contact((0.0, 0.0, 0.0)), (1.0, 0.0, 0.0)).residual == np.inf


def test_immovable_contact_is_infeasible_only_if_it_approaches() -> None:
    for c, infeasible in ((-1.0, True), (1.0, False), (0.0, False)):
        verdict = judge(ContactProblem.from_delassus(np.diag([1.0, 0.0]), (1.0, c), dim=1), np.zeros(2))
        assert verdict.infeasible is infeasible
        assert (verdict.residual == np.inf) is infeasible


def sweeps(problem: ContactProblem, count: int) -> np.ndarray:
    """Plain projected Gauss–Seidel on a frictionless problem."""
    delassus, impulses = problem.delassus().toarray(), np.zeros(problem.n_rows)
    for _ in range(count):
        for row in range(problem.n_rows):
            velocity = delassus[row] @ impulses + problem.free_velocity[row]
            impulses[row] = max(impulses[row] - velocity / delassus[row, row], 0.0)
    return impulses


@pytest.mark.parametrize(
    ("masses", "count", "residual", "impulse_error", "relative"),
    [([1.0, 1e6], 20_000, 0.98, 0.98, 4.9e-5), ([1.0] * 9 + [100.0], 1000, 3.9e-2, 0.33, 5.3e-4)],
)
def test_at_large_mass_ratios_velocities_show_errors_that_relative_impulses_hide(
    masses: list[float], count: int, residual: float, impulse_error: float, relative: float
) -> None:
    from proxbench.problems.hard.stacks import stack

    problem = stack(np.array(masses))
    assert problem.answer is not None
    impulses = sweeps(problem, count)
    known = problem.answer.impulses[0]
    change = problem.relative_velocity(impulses) / problem.delassus_diagonal
    deceptive = np.abs(impulses - np.maximum(impulses - change, 0.0)).max() / np.abs(impulses).max()
    assert judge(problem, impulses).residual == pytest.approx(residual, rel=0.03)
    assert np.abs(impulses - known).max() / known.max() == pytest.approx(impulse_error, rel=0.03)
    assert deceptive == pytest.approx(relative, rel=0.05)


def test_both_forms_give_the_same_verdict() -> None:
    rng = np.random.default_rng(1)
    directions, c, impulses = rng.normal(size=(7, 12)), rng.normal(size=12), rng.normal(size=12)
    factors = ContactProblem.from_factors(directions, np.full(7, 2.0), c, 0.3)
    matrix = ContactProblem.from_delassus(2.0 * directions.T @ directions, c, 0.3)
    for field in ("residual", "energy_residual", "natural_map_q", "dissipated_energy", "penetration_velocity"):
        assert getattr(judge(factors, impulses), field) == pytest.approx(
            getattr(judge(matrix, impulses), field), rel=1e-12
        )


def test_the_natural_map_is_that_of_de_saxce() -> None:
    """‖Λ − P_K(Λ − (ξ + μ‖ξ_T‖e_N))‖ over ‖c‖, with P_K written out for one contact outside cone and polar cone."""
    problem, impulses, friction = one_contact((-1.0, 2.0, 1.0)), np.array([0.4, -0.3, 0.1]), 0.5
    velocity = problem.relative_velocity(impulses)
    velocity[0] += friction * np.hypot(velocity[1], velocity[2])
    x = impulses - velocity
    length = np.hypot(x[1], x[2])
    assert length > friction * x[0]
    assert x[0] > -friction * length
    normal = (x[0] + friction * length) / (1 + friction**2)
    projected = np.array([normal, *(friction * normal * x[1:] / length)])
    error = np.linalg.norm(impulses - projected)
    verdict = judge(problem, impulses)
    assert verdict.natural_map_q == pytest.approx(error / np.sqrt(6.0), rel=1e-13)


def test_dissipated_energy_is_the_kinetic_energy_that_a_plastic_impact_takes() -> None:
    """A mass m = 1/α that stops from speed 1 loses the energy m/2 = 0.25."""
    assert judge(one_contact((-1.0, 0.0, 0.0)), (0.5, 0.0, 0.0)).dissipated_energy == pytest.approx(0.25)


def test_each_model_has_its_own_solutions() -> None:
    problem = one_contact((-1.0, 3.0, 0.0))
    solutions = {
        Model.COULOMB: (0.5, -0.25, 0.0),
        Model.FRICTIONLESS: (0.5, 0.0, 0.0),
        Model.CONVEX: tuple(np.array([1.0, -0.5, 0.0]) * (1 + 1.5) / 2 / 1.25),
        Model.pyramid(4): (0.5, -0.25, 0.0),
    }
    for model, impulses in solutions.items():
        assert judge(problem, impulses, model).residual <= 1e-15
    assert judge(problem, solutions[Model.CONVEX]).residual > 0.1
    assert judge(problem, solutions[Model.FRICTIONLESS]).residual > 0.1


def test_a_pyramid_approaches_the_cone_with_the_square_of_its_sides() -> None:
    """For a slip direction in the middle of a side, the inscribed polygon loses 1 − cos(π/k) of the bound."""
    errors = []
    for sides in (8, 16, 32):
        angle = np.pi / sides
        c = (-1.0, 3.0 * np.cos(angle), 3.0 * np.sin(angle))
        apothem = 0.25 * np.cos(angle)
        impulses = (0.5, -apothem * np.cos(angle), -apothem * np.sin(angle))
        assert judge(one_contact(c), impulses, Model.pyramid(sides)).residual <= 1e-14
        errors.append(judge(one_contact(c), impulses).residual)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.03)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.03)


@pytest.mark.parametrize("impulses", [np.zeros(2), np.zeros((3, 1)), 0.0])
def test_impulses_of_the_wrong_shape_are_refused(impulses: object) -> None:
    with pytest.raises(ProblemError, match="shape"):
        judge(one_contact((-1.0, 0.0, 0.0)), impulses)  # type: ignore[arg-type]


@pytest.mark.parametrize("model", [Model.COULOMB, Model.CONVEX, Model.FRICTIONLESS, Model.pyramid(5)], ids=str)
def test_the_residual_that_solvers_stop_on_is_the_one_of_the_verdict(model: Model) -> None:
    rng = np.random.default_rng(11)
    problem = ContactProblem.from_factors(rng.normal(size=(9, 12)), np.ones(9), rng.normal(size=12), 0.4)
    impulses = rng.normal(size=12)
    residual = ModelResidual(problem, model)(impulses, problem.relative_velocity(impulses))
    assert residual == pytest.approx(judge(problem, impulses, model).residual, rel=1e-14)


def rolling_contact(c: tuple[float, ...]) -> ContactProblem:
    """N, T, R with G = diag(2, 2, 50): a velocity of rolling counts at √(2/50) = 0.2 m from the axis."""
    laws = Laws.contacts(np.array([0.5]), 2, 1).with_rolling(0.01, 1)
    return ContactProblem.from_delassus(np.diag([2.0, 2.0, 50.0]), c, laws=laws)


@pytest.mark.parametrize(
    ("c", "impulses", "violation"),
    [
        ((-1.0, 0.0, 0.2), (0.5, 0.0, -0.004), 0.0),  # at rest within ‖Λ_R‖ ≤ 0.005
        ((-1.0, 0.0, 2.0), (0.5, 0.0, -0.005), 0.0),  # rolls against Λ_R at its bound
        ((-1.0, 0.0, 2.0), (0.5, 0.0, 0.0), 0.05),  # rolls without resistance: the whole bound is missing
        ((-1.0, 0.0, 0.2), (0.5, 0.0, 0.0), 0.04),  # 0.2 rad/s where there should be none
        ((-1.0, 0.0, 2.0), (0.5, 0.0, -0.006), 0.01),  # outside the bound by 0.001
        ((-1.0, 3.0, 2.0), (0.5, -0.25, -0.005), 0.0),  # slides and rolls at the same time
    ],
)
def test_rolling_friction_by_hand(c: tuple[float, ...], impulses: tuple[float, ...], violation: float) -> None:
    expected = violation / max(1.0, abs(c[1]), 0.2 * abs(c[2]))
    assert judge(rolling_contact(c), impulses).residual == pytest.approx(expected, abs=1e-15)
    cone = max(abs(impulses[2]) - 0.005, 0.0) / 0.2
    assert judge(rolling_contact(c), impulses).cone_violation == pytest.approx(cone, abs=1e-15)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("moment", "violation"), [(0.0, 0.0), (0.04, 0.0), (0.06, np.inf)])
def test_the_cone_violation_of_a_moment_is_infinite_if_its_length_scale_underflows(
    moment: float, violation: float
) -> None:
    """ℓ = √(α_N/α_R) underflows, so a moment of any size is larger than all forces."""
    laws = Laws.contacts(0.5, 2, 1).with_rolling(0.05, 1)
    problem = ContactProblem.from_delassus(np.diag([1e-300, 1e-300, 1e30]), np.zeros(3), laws=laws)
    assert judge(problem, (1.0, 0.0, moment)).cone_violation == violation


def test_the_natural_map_of_rolling_friction_is_that_of_both_cones() -> None:
    """‖Λ − P_K(Λ − ū)‖ with ū_N = ξ_N + μ‖ξ_T‖ + μ_r‖ξ_R‖, at a point that P_K moves onto both bounds."""
    problem, impulses = rolling_contact((-1.0, 3.0, 2.0)), np.array([0.5, 0.5, 0.2])
    velocity = problem.relative_velocity(impulses)
    velocity[0] += 0.5 * abs(velocity[1]) + 0.01 * abs(velocity[2])
    point = impulses - velocity
    (n, t, r) = point
    normal = (n + 0.5 * abs(t) + 0.01 * abs(r)) / (1 + 0.5**2 + 0.01**2)
    projected = max(normal, 0.0) * np.array([1.0, 0.5 * np.sign(t), 0.01 * np.sign(r)])
    error = np.linalg.norm(impulses - projected) / np.linalg.norm([1.0, 3.0, 2.0])
    assert judge(problem, impulses).natural_map_q == pytest.approx(error, rel=1e-12)


@pytest.mark.parametrize(("impulse", "residual"), [(-0.5, 0.0), (0.0, 1.0), (-0.25, 0.5), (1.0, 3.0)])
def test_a_joint_is_violated_by_its_velocity_whatever_the_sign_of_its_impulse(impulse: float, residual: float) -> None:
    problem = ContactProblem.from_delassus(np.array([[2.0]]), (1.0,), laws=Laws.joints(1))
    for model in (Model.COULOMB, Model.CONVEX, Model.FRICTIONLESS, Model.pyramid(4)):
        assert judge(problem, (impulse,), model).residual == residual
    verdict = judge(problem, (impulse,))
    assert verdict.natural_map_q == residual
    assert (verdict.cone_violation, verdict.penetration_velocity, verdict.complementarity) == (0.0, 0.0, 0.0)


def test_a_joint_that_nothing_moves_is_infeasible_unless_it_is_at_rest() -> None:
    for c, infeasible in ((-1.0, True), (1.0, True), (0.0, False)):
        problem = ContactProblem.from_delassus(np.diag([1.0, 0.0]), (1.0, c), laws=Laws.joints(2))
        assert judge(problem, np.zeros(2)).infeasible is infeasible


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), dim=st.integers(1, 3), joints=st.integers(0, 3), rolling=st.integers(0, 3))
def test_a_built_in_solution_with_joints_and_rolling_has_no_residual(
    seed: int, dim: int, joints: int, rolling: int
) -> None:
    problem = random_linked_problem(LinkedFamily(4, dim, n_joints=joints, rolling_rows=rolling), seed)
    assert problem.answer is not None
    verdict = judge(problem, problem.answer.witness)  # type: ignore[arg-type]
    for field in ("residual", "local_residual", "energy_residual", "natural_map_max", "cone_violation"):
        assert getattr(verdict, field) <= 1e-13, field


@pytest.mark.parametrize("model", [Model.COULOMB, Model.CONVEX, Model.FRICTIONLESS, Model.pyramid(5)], ids=str)
@pytest.mark.parametrize("seed", range(3))
def test_with_joints_and_rolling_the_residual_that_solvers_stop_on_is_the_one_of_the_verdict(
    model: Model, seed: int
) -> None:
    problem = random_linked_problem(LinkedFamily(4, 3, rolling_rows=1 + seed), seed)
    impulses = np.random.default_rng(seed).normal(size=problem.n_rows)
    residual = ModelResidual(problem, model)(impulses, problem.relative_velocity(impulses))
    assert residual == pytest.approx(judge(problem, impulses, model).residual, rel=1e-14)
    if model == Model.COULOMB:
        assert Residual(problem)(impulses, problem.relative_velocity(impulses)) == pytest.approx(residual, rel=1e-14)


def test_the_convex_model_of_rolling_friction_is_the_nearest_point_of_both_cones() -> None:
    """With G = I and unit lengths the convex answer is the projection of −c."""
    rng = np.random.default_rng(5)
    laws = Laws.contacts(np.array([0.5]), 3, 1).with_rolling(0.25, 2)
    for _ in range(20):
        c = rng.normal(size=5)
        parts = -c[None, 1:3], -c[None, 3:]
        friction, none = (np.array([0.5]), np.array([0.25])), (np.zeros(1), np.zeros(1))
        normal, others = onto_cone(-c[:1], parts, friction, none)
        impulses = np.concatenate([normal, *(part.ravel() for part in others)])
        problem = ContactProblem.from_delassus(np.eye(5), c, laws=laws)
        assert judge(problem, impulses, Model.CONVEX).residual <= 1e-14


def test_the_natural_map_of_a_frictionless_contact_beside_frictional_ones_is_the_lesser_of_both() -> None:
    """min(Λ_N, ξ_N) = 0.5 at a contact that is held open at ξ_N = 1.5; the other one is solved."""
    laws = Laws.concatenate([Laws.contacts(np.array([0.5]), 3, 1), Laws.contacts(np.array([0.0]), 1, 1)])
    problem = ContactProblem.from_delassus(np.eye(4), (-1.0, 0.0, 0.0, 1.0), laws=laws)
    assert judge(problem, (1.0, 0.0, 0.0, 0.5)).natural_map_q == pytest.approx(0.5 / np.sqrt(2.0))
    assert judge(problem, (1.0, 0.0, 0.0, 0.0)).natural_map_q == pytest.approx(0.0, abs=1e-15)


def test_a_frictionless_contact_by_hand_under_every_measure() -> None:
    """G = 100 and Λ = 1 give ξ = 99; an impulse that pulls is outside its set by its size."""
    problem = ContactProblem.from_delassus(np.array([[100.0]]), (-1.0,), dim=1)
    pushed = judge(problem, (1.0,))
    assert (pushed.natural_map_q, pushed.natural_map_max) == pytest.approx((1.0, 1.0 / 99.0))
    assert (pushed.complementarity, pushed.cone_violation, pushed.penetration_velocity) == pytest.approx(
        (99.0, 0.0, 0.0)
    )
    pulled = judge(problem, (-0.25,))
    assert (pulled.cone_violation, pulled.penetration_velocity) == pytest.approx((0.25, 26.0))


def test_solvers_stop_on_the_residual_of_the_worst_component() -> None:
    problem = ContactProblem.from_delassus(np.eye(2), (-1.0, -1e-3), dim=1)
    impulses = np.array([1.0, 0.25e-3])
    assert judge(problem, impulses).residual == pytest.approx(0.75)
    assert Residual(problem)(impulses, problem.relative_velocity(impulses)) == pytest.approx(0.75)


@pytest.mark.parametrize("impulse", [-0.5, 0.0, 0.25, 0.5, 2.0])
@pytest.mark.parametrize("free", [-2.0, 1.0])
def test_without_friction_both_models_have_the_same_residual(impulse: float, free: float) -> None:
    """The residual is |min(αΛ, ξ)| with α = 4, also next to a contact with friction."""
    laws = Laws.concatenate([Laws.contacts(np.array([0.5]), 3, 1), Laws.contacts(np.array([0.0]), 1, 1)])
    problem = ContactProblem.from_delassus(np.diag([1.0, 1.0, 1.0, 4.0]), (0.0, 0.0, 0.0, free), laws=laws)
    violation = abs(min(4.0 * impulse, 4.0 * impulse + free)) / abs(free)
    for model in (Model.COULOMB, Model.CONVEX):
        assert judge(problem, (0.0, 0.0, 0.0, impulse), model).residual == pytest.approx(violation, rel=1e-12)


def test_the_rounding_error_is_zero_if_no_impulse_moves_anything() -> None:
    still = Residual(ContactProblem.from_delassus(np.eye(3), np.zeros(3), 0.5))
    assert still.rounding(np.ones(3)) == 0.0
