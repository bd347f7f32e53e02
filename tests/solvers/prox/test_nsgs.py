"""NSGS solves each contact exactly, and converges where sweeps over single laws cycle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, LawKind, Laws, judge, load
from proxbench.problems.contact.residual import Residual
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem
from proxbench.solvers import Prepared, SolverError, Status, Stop, create, solve
from proxbench.solvers.iteration.loop import PreparedIteration
from proxbench.solvers.sweeps.blocks import BlockIterates, BlockSweep

SEEDS = st.integers(0, 2**31)


def random_contacts(dim: int, seed: int, friction: float, n_contacts: int = 4) -> ContactProblem:
    rng = np.random.default_rng(seed)
    n_dofs = 2 * dim * n_contacts
    directions = rng.normal(size=(n_dofs, dim * n_contacts))
    return ContactProblem.from_factors(
        directions, rng.uniform(0.5, 2.0, n_dofs), rng.normal(size=dim * n_contacts), friction, dim=dim
    )


def unguarded(problem: ContactProblem, relaxation: float = 1.0) -> Prepared:
    """Return the sweeps of NSGS without its safeguard."""
    sweep = BlockSweep.over(problem, relaxation)
    return PreparedIteration(problem, Residual(problem), lambda start: BlockIterates(sweep, start))


@pytest.mark.parametrize("friction", [2.0, 4.0, 10.0])
def test_the_counterexample_of_the_paper_is_solved_in_one_sweep(friction: float) -> None:
    """Λ_T = −μΛ_N and ξ_N = 0: Λ_N = −c_N/(G_NN − μ G_NT)."""
    delassus = [[1.87577975, -1.36394614], [-1.36394614, 3.12422025]]
    problem = ContactProblem.from_delassus(delassus, (-0.0981, 1.0), friction, dim=2)
    solution = solve(problem, "NSGS", tolerance=1e-14)
    normal = 0.0981 / (1.87577975 + friction * 1.36394614)
    assert (solution.status, solution.iterations) == (Status.SOLVED, 1)
    assert solution.impulses == pytest.approx([normal, -friction * normal], rel=1e-14)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_uncoupled_contacts_are_solved_in_one_sweep(dim: int) -> None:
    rng = np.random.default_rng(dim)
    n_contacts = 200
    delassus = np.zeros((dim * n_contacts, dim * n_contacts))
    for i in range(n_contacts):
        root, own = rng.normal(size=(dim + 1, dim)), slice(dim * i, dim * (i + 1))
        delassus[own, own] = root.T @ root
    problem = ContactProblem.from_delassus(delassus, rng.normal(size=dim * n_contacts), 2.0, dim=dim)
    solution = solve(problem, "NSGS", tolerance=1e-12)
    assert (solution.status, solution.iterations) == (Status.SOLVED, 1)


@settings(max_examples=15, deadline=None)
@given(seed=SEEDS, friction=st.sampled_from([0.0, 0.3, 0.8]))
def test_planar_impulses_are_among_those_of_enumeration(seed: int, friction: float) -> None:
    problem = random_contacts(2, seed, friction, n_contacts=3)
    swept = solve(problem, "NSGS", tolerance=1e-12, max_iterations=20_000)
    if swept.status is not Status.SOLVED:
        return
    known = create("Enumeration").prepare(problem).all_solutions(1e-10)  # type: ignore[attr-defined]
    nearest = min(np.abs(swept.impulses - other).max() for other in known)
    assert nearest <= 1e-7 * max(1.0, np.abs(swept.impulses).max())


@pytest.mark.parametrize("dim", [2, 3])
def test_low_friction_always_converges(dim: int) -> None:
    for seed in range(30):
        assert solve(random_contacts(dim, seed, 0.3), "NSGS", tolerance=1e-12).status is Status.SOLVED


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_without_friction_a_sweep_is_that_of_projected_gauss_seidel(seed: int) -> None:
    problem = random_contacts(1, seed, 0.0, n_contacts=8)
    histories: list[list[np.ndarray]] = []
    for prepared in (unguarded(problem, 1.2), create("SORprox(relaxation=1.2)").prepare(problem)):
        seen: list[np.ndarray] = []
        prepared.solve(Stop(1e-300, 20), observe=lambda _, x, seen=seen: seen.append(x.copy()))
        histories.append(seen)
    first, second = np.array(histories[0]), np.array(histories[1])
    assert first.shape == second.shape
    assert np.abs(first - second).max(initial=0.0) <= 1e-12 * np.abs(first).max(initial=0.0)


@pytest.mark.parametrize(
    "name", ["hard-mixed-laws", "hard-tresca-joint", "hard-painleve-jam", "hard-duplicated-slider"]
)
def test_velocity_agrees_with_the_known_answer(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "NSGS", tolerance=1e-11)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).velocity_error <= 1e-10  # type: ignore[operator]


def test_a_bound_from_another_contact_is_satisfied() -> None:
    """Friction with a remote partner, and with a fixed part of its bound: Λ_T = −(0.1 + 0.5 · 2)."""
    kind = np.array([LawKind.UNILATERAL, LawKind.UNILATERAL, LawKind.PLANAR_FRICTION])
    laws = Laws(kind, np.arange(3), np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.0, 0.1]), np.array([-1, -1, 0]))
    problem = ContactProblem.from_delassus(np.eye(3), (-2.0, 1.0, 5.0), laws=laws)
    solution = solve(problem, "NSGS", tolerance=1e-14)
    assert solution.impulses == pytest.approx([2.0, 0.0, -1.1], abs=1e-14)


@pytest.mark.parametrize("relaxation", [1.0, 1.5])
@pytest.mark.parametrize("name", ["funnel-100", "funnel-planar-100", "funnel-frictionless-100"])
def test_funnel_steps_are_solved(name: str, relaxation: float) -> None:
    problem = load(name)
    solution = solve(problem, f"NSGS(relaxation={relaxation})", tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1.001e-8


def test_relaxed_impulses_stay_within_their_cones() -> None:
    problem = load("funnel-30")
    cones: list[float] = []
    create("NSGS", relaxation=1.7).prepare(problem).solve(
        Stop(1e-300, 30), observe=lambda _, x: cones.append(judge(problem, x).cone_violation / np.abs(x).max())
    )
    assert len(cones) == 30
    assert max(cones) <= 1e-15


@pytest.mark.parametrize("relaxation", [0.0, -1.0, float("nan"), "one"])
def test_a_relaxation_out_of_range_is_refused(relaxation: object) -> None:
    with pytest.raises(SolverError, match="relaxation"):
        create("NSGS", relaxation=relaxation)


def test_the_safeguard_solves_contacts_that_cycle_with_each_other() -> None:
    """Each contact is solved exactly, and some of these problems at μ = 3 still cycle."""
    guarded, plain = 0, 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        directions = rng.normal(size=(32, 16))
        directions[rng.random(directions.shape) < 0.5] = 0.0
        inverse_mass = 10.0 ** rng.uniform(-1.5, 1.5, 32)
        free = directions.T @ rng.normal(size=32)
        problem = ContactProblem.from_factors(directions, inverse_mass, free, 3.0, dim=2)
        guarded += solve(problem, "NSGS", tolerance=1e-9).status is Status.SOLVED
        plain += unguarded(problem).solve(Stop(1e-9)).status is Status.SOLVED
    assert guarded > plain
    assert guarded >= 36


def test_a_joint_is_solved_in_one_sweep_and_redundant_joints_come_to_rest() -> None:
    one = ContactProblem.from_delassus(np.array([[2.0]]), (1.0,), laws=Laws.joints(1))
    solution = create("NSGS").prepare(one).solve(Stop(1e-300, max_iterations=1))
    assert solution.impulses.tolist() == [-0.5]
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(4, 7))
    free = directions.T @ rng.normal(size=4)
    problem = ContactProblem.from_factors(directions, np.ones(4), free, laws=Laws.joints(7))
    found = solve(problem, "NSGS", tolerance=1e-12)
    assert found.status is Status.SOLVED
    assert np.abs(problem.relative_velocity(found.impulses)).max() <= 1e-12 * np.abs(free).max()


@pytest.mark.parametrize("relaxation", [0.7, 1.0, 1.3])
@pytest.mark.parametrize("rolling_rows", [1, 2, 3])
def test_rolling_contacts_and_joints_are_solved_together(rolling_rows: int, relaxation: float) -> None:
    for seed in range(3):
        problem = random_linked_problem(LinkedFamily(5, 3, 40, rolling_rows=rolling_rows, n_joints=3), seed)
        cones: list[float] = []
        solver = create("NSGS", relaxation=relaxation).prepare(problem)
        solution = solver.solve(
            Stop(1e-10), observe=lambda _, x, p=problem, cones=cones: cones.append(judge(p, x).cone_violation)
        )
        assert solution.status is Status.SOLVED
        assert judge(problem, solution.impulses).residual <= 1.001e-10
        assert max(cones) <= 1e-13
