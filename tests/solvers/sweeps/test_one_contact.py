"""One contact is solved exactly for any block, friction and bound."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, LawKind, Laws, judge
from proxbench.solvers import create
from proxbench.solvers.sweeps.one_contact import planar_violation, solve_frictionless, solve_planar, solve_spatial
from proxbench.solvers.sweeps.slip_angle import WORKSPACE_SIZE, slip_directions

WORK = np.empty(WORKSPACE_SIZE)
SEEDS = st.integers(0, 2**31)
MU = st.sampled_from([0.0, 0.1, 0.5, 1.0, 2.0, 10.0])
FIXED = st.sampled_from([0.0, 0.0, 0.3])
STRENGTH = st.integers(-6, 6)


def one_contact(delassus: np.ndarray, free: np.ndarray, friction: float, fixed: float) -> ContactProblem:
    spatial = len(free) == 3
    kind = [LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION if spatial else LawKind.PLANAR_FRICTION]
    laws = Laws(np.array(kind), np.array([0, 1]), np.array([0, friction]), np.array([0, fixed]), np.array([-1, 0]))
    return ContactProblem.from_delassus(delassus, free, laws=laws)


def random_block(dim: int, seed: int, rank: int, spread: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a block RᵀR of given rank, with rows of R up to 10^spread apart, and a free velocity in its range."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(rank, dim)) * np.logspace(0, spread, rank)[:, None]
    return root.T @ root, root.T @ rng.normal(size=rank)


def violation(delassus: np.ndarray, free: np.ndarray, friction: float, fixed: float, impulses: np.ndarray) -> float:
    """Return the judge's residual relative to the largest term of the sum ξ, which limits its rounding."""
    problem = one_contact(delassus, free, friction, fixed)
    terms = np.abs(free).max() + (np.abs(delassus) @ np.abs(impulses)).max()
    residual = judge(problem, impulses).residual
    return residual * max(abs(free[0]), float(np.linalg.norm(free[1:]))) / terms


def spatial(delassus: np.ndarray, free: np.ndarray, friction: float, fixed: float, old: np.ndarray) -> np.ndarray:
    return np.array(solve_spatial(delassus.reshape(-1), *free, friction, fixed, *old, WORK))


def planar(delassus: np.ndarray, free: np.ndarray, friction: float, fixed: float, old: np.ndarray) -> np.ndarray:
    return np.array(solve_planar(*delassus.reshape(-1), *free, friction, fixed, *old))


@settings(max_examples=200, deadline=None)
@given(seed=SEEDS, spread=st.integers(0, 3), friction=MU, fixed=FIXED, size=STRENGTH, warm=st.booleans())
def test_a_spatial_contact_of_full_rank_is_solved_to_rounding(
    seed: int, spread: int, friction: float, fixed: float, size: int, warm: bool
) -> None:
    delassus, free = random_block(3, seed, 3, spread)
    free = free * 10.0**size
    old = np.random.default_rng(seed + 1).normal(size=3) * 10.0**size if warm else np.zeros(3)
    old[0] = abs(old[0])
    impulses = spatial(delassus, free, friction, fixed, old)
    assert violation(delassus, free, friction, fixed, impulses) <= 1e-11


@settings(max_examples=200, deadline=None)
@given(seed=SEEDS, spread=st.integers(0, 5), friction=MU, fixed=FIXED, size=STRENGTH, warm=st.booleans())
def test_a_planar_contact_of_full_rank_is_solved_to_rounding(
    seed: int, spread: int, friction: float, fixed: float, size: int, warm: bool
) -> None:
    delassus, free = random_block(2, seed, 2, spread)
    free = free * 10.0**size
    old = np.abs(np.random.default_rng(seed + 1).normal(size=2)) * 10.0**size * warm
    impulses = planar(delassus, free, friction, fixed, old)
    assert violation(delassus, free, friction, fixed, impulses) <= 1e-11


@settings(max_examples=300, deadline=None)
@given(seed=SEEDS, dim=st.sampled_from([2, 3]), rank=st.integers(1, 2), friction=MU, fixed=FIXED, warm=st.booleans())
def test_a_rank_deficient_block_is_solved_if_its_velocity_is_in_the_range(
    seed: int, dim: int, rank: int, friction: float, fixed: float, warm: bool
) -> None:
    """The free velocity lies in the range of G, as for every contact of bodies, so there is a solution."""
    rank = min(rank, dim - 1)
    delassus, free = random_block(dim, seed, rank, 0)
    old = np.abs(np.random.default_rng(seed + 1).normal(size=dim)) * warm
    solve = spatial if dim == 3 else planar
    impulses = solve(delassus, free, friction, fixed, old)
    assert violation(delassus, free, friction, fixed, impulses) <= 1e-9


@settings(max_examples=200, deadline=None)
@given(seed=SEEDS, friction=MU, fixed=FIXED, warm=st.booleans())
def test_a_planar_answer_is_among_all_that_enumeration_finds(
    seed: int, friction: float, fixed: float, warm: bool
) -> None:
    delassus, free = random_block(2, seed, 2, 0)
    old = np.abs(np.random.default_rng(seed + 1).normal(size=2)) * warm
    known = create("Enumeration").prepare(one_contact(delassus, free, friction, fixed)).all_solutions(1e-10)  # type: ignore[attr-defined]
    impulses = planar(delassus, free, friction, fixed, old)
    assert min(np.abs(impulses - other).max() for other in known) <= 1e-9 * max(1.0, np.abs(impulses).max())


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, friction=MU, fixed=FIXED)
def test_a_spatial_answer_is_that_of_a_search_over_all_directions(seed: int, friction: float, fixed: float) -> None:
    """Brute force over 20 000 directions of slip: a returned slip is one of those that nearly satisfy the law."""
    delassus, free = random_block(3, seed, 3, 0)
    impulses = spatial(delassus, free, friction, fixed, np.zeros(3))
    nn, coupling, rest = delassus[0, 0], delassus[0, 1:], delassus[1:, 1:]
    angle = np.linspace(0.0, 2.0 * np.pi, 20_000, endpoint=False)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = (-free[0] - fixed * along @ coupling) / (nn + friction * along @ coupling)
    bound = fixed + friction * normal
    tangent = bound[:, None] * along
    velocity = normal[:, None] * delassus[1:, 0] + tangent @ rest + free[1:]
    across = np.abs(velocity[:, 0] * along[:, 1] - velocity[:, 1] * along[:, 0])
    wrong = np.where((normal >= 0) & (bound >= 0), np.maximum(across, (velocity * along).sum(axis=1)), np.inf)
    candidates = np.column_stack([normal, tangent])[wrong <= 1e-3 * np.abs(free).max() * (1.0 + np.abs(bound))]
    slips = fixed + friction * impulses[0] > 0 and np.isclose(
        np.linalg.norm(impulses[1:]), fixed + friction * impulses[0], rtol=1e-12
    )
    if slips and impulses[0] > 0:
        assert np.abs(candidates - impulses).max(axis=1).min() <= 1e-2 * np.abs(impulses).max()


def test_every_direction_of_slip_is_found() -> None:
    """Two or four zeros are chosen, and f is constructed from them."""
    rng = np.random.default_rng(5)
    for _ in range(2000):
        chosen = np.sort(rng.uniform(-np.pi, np.pi, 4))
        if np.diff(np.concatenate([chosen, [chosen[0] + 2 * np.pi]])).min() < 1e-3:
            continue
        grid = np.linspace(0, 2 * np.pi, 5, endpoint=False) + rng.uniform()
        basis = np.stack(
            [np.cos(grid) ** 2, np.cos(grid) * np.sin(grid), np.sin(grid) ** 2, np.cos(grid), np.sin(grid)]
        )
        # a product of two factors a + b cos θ + c sin θ, each through two of the zeros
        values = np.ones(5)
        for first, second in (chosen[:2], chosen[2:]):
            centre, half = (first + second) / 2, (second - first) / 2
            values *= np.cos(grid - centre) - np.cos(half)
        coefficients = np.linalg.solve(basis.T, values)
        count = slip_directions(*coefficients, WORK)
        found = np.arctan2(WORK[1 : 2 * count : 2], WORK[0 : 2 * count : 2])
        for angle in chosen:
            assert np.abs(np.angle(np.exp(1j * (found - angle)))).min() <= 1e-9


@settings(max_examples=100, deadline=None)
@given(seed=SEEDS, friction=MU, turn=st.floats(0.0, 6.28))
def test_the_impulse_of_a_contact_rotates_with_its_tangents(seed: int, friction: float, turn: float) -> None:
    """The solution is unique because friction is below the value at which a contact can jam."""
    delassus, free = random_block(3, seed, 3, 0)
    delassus += 3.0 * max(friction, 1.0) * np.trace(delassus) * np.eye(3)
    rotation = np.eye(3)
    rotation[1:, 1:] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    plain = spatial(delassus, free, friction, 0.0, np.zeros(3))
    turned = spatial(rotation @ delassus @ rotation.T, rotation @ free, friction, 0.0, np.zeros(3))
    assert np.abs(rotation @ plain - turned).max() <= 1e-12 * max(np.abs(plain).max(), 1e-300)


@settings(max_examples=100, deadline=None)
@given(seed=SEEDS, friction=MU, mass=STRENGTH, speed=STRENGTH)
def test_the_impulse_of_a_contact_scales_with_the_units(seed: int, friction: float, mass: int, speed: int) -> None:
    """The bits are equal: powers of four scale a problem, and the square roots in it, without rounding."""
    delassus, free = random_block(3, seed, 3, 0)
    plain = spatial(delassus, free, friction, 0.0, np.zeros(3))
    scaled = spatial(delassus * 4.0**-mass, free * 4.0**speed, friction, 0.0, np.zeros(3))
    np.testing.assert_array_equal(scaled, plain * 4.0 ** (mass + speed))


@pytest.mark.parametrize("speed", [1.0, -1.0, 0.0])
@pytest.mark.parametrize("delassus", [0.0, 2.0])
def test_a_frictionless_contact_closes_only_against_approach(delassus: float, speed: float) -> None:
    expected = 0.5 if (delassus, speed) == (2.0, -1.0) else 0.0
    assert solve_frictionless(delassus, speed) == expected


def test_painleve_contacts_keep_their_state() -> None:
    """The rod with three solutions stays open if it was open, and closed if it had an impulse."""
    delassus = np.array([[1.87577975, -1.36394614], [-1.36394614, 3.12422025]])
    free = np.array([0.01, -1.0])
    assert planar(delassus, free, 2.0, 0.0, np.zeros(2))[0] == 0.0
    assert planar(delassus, free, 2.0, 0.0, np.array([0.3, 0.4]))[0] == pytest.approx(0.33318, abs=1e-5)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_planar_slip_that_goes_on_is_found_before_the_other_one_is_tried(
    side: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It takes one evaluation, that of the open contact; the violation of the other slip is not computed."""
    calls: list[None] = []

    def counted(*given: float) -> float:
        calls.append(None)
        return float(planar_violation(*given))

    monkeypatch.setattr("proxbench.solvers.sweeps.one_contact.planar_violation", counted)
    solve = getattr(solve_planar, "py_func", solve_planar)
    impulses = solve(1.0, 0.0, 0.0, 1.0, -1.0, -3.0 * side, 0.5, 0.0, 1.0, 0.4 * side)
    assert impulses == (1.0, 0.5 * side)
    assert len(calls) == 1


def test_of_two_possible_slip_directions_the_nearer_to_the_previous_one_is_chosen() -> None:
    """If a contact can jam, two directions of slip are solutions; the one next to the previous impulse is kept."""
    delassus = np.array([[1.35, 0.17, 3.06], [0.17, 0.14, 0.17], [3.06, 0.17, 8.08]])
    free = np.array([0.93, -0.52, 4.04])
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    histories = np.stack([np.ones(24), np.cos(angles), np.sin(angles)], axis=1)
    answers = np.array([spatial(delassus, free, 2.0, 0.3, old) for old in histories])
    assert max(violation(delassus, free, 2.0, 0.3, impulses) for impulses in answers) <= 1e-12
    directions = answers[:, 1:] / np.linalg.norm(answers[:, 1:], axis=1)[:, None]
    assert len(np.unique(directions.round(6), axis=0)) == 2
    for old, direction in zip(histories, directions, strict=True):
        assert direction @ old[1:] == pytest.approx((directions @ old[1:]).max(), abs=1e-9)


def test_undetermined_friction_is_reduced_until_the_normal_impulse_is_nonnegative() -> None:
    """With S = 0 and a > 0, Λ_N = n0 − hᵀΛ_T reaches 0 along the present Λ_T; here n0 = 0.1 and h = (5, 0)."""
    root = np.array([1.0, 5.0, 0.0])
    delassus, free = np.outer(root, root), -0.1 * root
    impulses = spatial(delassus, free, 0.0, 1.0, np.array([0.1, 0.5, 0.5]))
    assert impulses == pytest.approx([0.0, 0.02, 0.02], abs=1e-15)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_friction_without_curvature_changes_as_little_as_its_bound_requires(friction: float) -> None:
    """With G = 0 and q = 0, every impulse in the cone is a solution."""
    held = spatial(np.zeros((3, 3)), np.zeros(3), friction, 0.4, np.array([0.0, 0.1, 0.2]))
    drawn_back = spatial(np.zeros((3, 3)), np.zeros(3), friction, 0.4, np.array([0.0, 3.0, 4.0]))
    assert held == pytest.approx([0.0, 0.1, 0.2])
    assert drawn_back == pytest.approx([0.0, 0.24, 0.32])


def test_a_block_of_rank_one_keeps_undetermined_friction() -> None:
    """All rows push along one direction: only Λ_N + Λ_T1 + Λ_T2 is determined."""
    impulses = spatial(np.ones((3, 3)), np.full(3, -2.0), 1.0, 0.0, np.array([1.0, 0.3, 0.2]))
    assert impulses == pytest.approx([1.5, 0.3, 0.2])


def scattered_blocks(rng: np.random.Generator, count: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Return blocks with eigenvalues within 12 decades; half of the free velocities are in proportion to them."""
    turned = np.linalg.qr(rng.normal(size=(count, dim, dim)))[0]
    root = 10.0 ** rng.uniform(-3.0, 3.0, size=(count, dim, 1)) * turned
    blocks = root.transpose(0, 2, 1) @ root
    free = rng.normal(size=(count, dim))
    free[::2] = np.einsum("kij,ki->kj", root, free)[::2]
    return 0.5 * (blocks + blocks.transpose(0, 2, 1)), free


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dim", "n_blocks"), [pytest.param(3, 100_000, marks=pytest.mark.weekly), (2, 20_000), (3, 20_000)]
)
@pytest.mark.parametrize("warm", [False, True])
def test_random_blocks_of_any_spectrum_and_friction_are_solved(dim: int, n_blocks: int, warm: bool) -> None:
    """Any spectrum within 12 decades and any μ up to 10: the residual is the rounding of the terms of ξ.

    The judge treats uncoupled contacts as separate problems, so a thousand are judged at once.
    """
    rng, at_once, worst = np.random.default_rng(1), 1000, 0.0
    for _ in range(n_blocks // at_once):
        blocks, free = scattered_blocks(rng, at_once, dim)
        friction, old = rng.uniform(0.0, 10.0, at_once), warm * rng.normal(size=(at_once, dim))
        old[:, 0] = np.abs(old[:, 0])
        solve = spatial if dim == 3 else planar
        impulses = np.array([solve(*one, 0.0, start) for *one, start in zip(blocks, free, friction, old, strict=True)])
        problem = ContactProblem.from_delassus(sp.block_diag(blocks, format="csr"), free.ravel(), friction, dim=dim)
        residuals = np.array(judge(problem, impulses.ravel()).component_residuals)
        scale = np.maximum(np.abs(free[:, 0]), np.linalg.norm(free[:, 1:], axis=1))
        terms = np.abs(free).max(axis=1) + np.einsum("kij,kj->ki", np.abs(blocks), np.abs(impulses)).max(axis=1)
        worst = max(worst, float((residuals * scale / terms).max()))
    assert worst <= 1e-11
