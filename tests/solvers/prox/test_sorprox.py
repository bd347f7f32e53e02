"""SORprox implements equations [54, 55] in both forms."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, LawKind, Laws, judge
from proxbench.solvers import SolverError, Status, Stop, create, solve

KNOWN = np.array([0.02130908, -0.04261815])


def counterexample(friction: float) -> ContactProblem:
    delassus = [[1.87577975, -1.36394614], [-1.36394614, 3.12422025]]
    return ContactProblem.from_delassus(delassus, (-0.0981, 1.0), friction, dim=2)


def random_factors(dim: int, seed: int = 0, n_contacts: int = 20) -> ContactProblem:
    rng = np.random.default_rng(seed)
    n_dofs = 3 * n_contacts
    directions = rng.normal(size=(n_dofs, dim * n_contacts))
    directions[rng.random(directions.shape) < 0.7] = 0.0
    return ContactProblem.from_factors(
        directions, rng.uniform(0.5, 2.0, n_dofs), rng.normal(size=dim * n_contacts), 0.3, dim=dim
    )


def mixed_laws(seed: int = 0) -> ContactProblem:
    """Frictionless, planar and spatial contacts, a joint of fixed bound, and friction with a remote partner."""
    rng = np.random.default_rng(seed)
    kind = [0, 0, 1, 0, 2, 2, 0, 1]
    partner = [-1, -1, 1, -1, 3, -1, -1, 0]
    rows = np.cumsum([0] + [2 if k == LawKind.SPATIAL_FRICTION else 1 for k in kind])
    laws = Laws(
        np.array(kind),
        rows[:-1],
        np.array([0, 0, 0.4, 0, 0.3, 0, 0, 0.5]),
        np.array([0, 0, 0, 0, 0.01, 0.2, 0, 0]),
        np.array(partner),
    )
    root = rng.normal(size=(30, rows[-1]))
    return ContactProblem.from_delassus(root.T @ root, rng.normal(size=rows[-1]), laws=laws)


def sweeps_by_the_book(problem: ContactProblem, count: int, relaxation: float, row_sum: bool) -> np.ndarray:
    """Equations [54, 55] law by law on the dense matrix."""
    delassus, c, laws = problem.delassus().toarray(), problem.free_velocity, problem.laws
    impulses = np.zeros(problem.n_rows)
    for _ in range(count):
        for law in range(laws.n_laws):
            size = 2 if laws.kind[law] == LawKind.SPATIAL_FRICTION else 1
            rows = slice(laws.first_row[law], laws.first_row[law] + size)
            block = delassus[rows]
            scale = np.abs(block).sum(axis=1).max() if row_sum else delassus.diagonal()[rows].max()
            target = impulses[rows] - relaxation / scale * (block @ impulses + c[rows])
            if laws.kind[law] == LawKind.UNILATERAL:
                impulses[rows] = np.maximum(target, 0.0)
                continue
            bound = laws.fixed_bound[law]
            if laws.partner[law] >= 0:
                normal = impulses[laws.first_row[laws.partner[law]]]
                bound += laws.friction_coefficient[law] * max(normal, 0.0)
            length = np.linalg.norm(target)
            impulses[rows] = target * (bound / length if length > bound else 1.0)
    return impulses


@pytest.mark.parametrize("row_sum", [False, True])
@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("problem", [random_factors(1), random_factors(2), random_factors(3), mixed_laws()])
def test_sweeps_are_those_of_the_paper(problem: ContactProblem, count: int, row_sum: bool) -> None:
    solver = create("SORprox", relaxation=0.8, step_size="row_sum" if row_sum else "diagonal")
    seen: list[np.ndarray] = []
    solver.prepare(problem).solve(Stop(1e-300, count), observe=lambda _, impulses: seen.append(impulses.copy()))
    expected = sweeps_by_the_book(problem, count, 0.8, row_sum)
    assert len(seen) == count
    assert np.abs(seen[-1] - expected).max() <= 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("step_size", ["diagonal", "row_sum"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_both_forms_give_the_same_iterates_to_rounding(dim: int, step_size: str) -> None:
    problem = random_factors(dim)
    histories: list[list[np.ndarray]] = []
    for form in ("delassus", "factors"):
        seen: list[np.ndarray] = []
        solver = create("SORprox", relaxation=1.2, step_size=step_size, form=form)
        solver.prepare(problem).solve(Stop(1e-300, 60), observe=lambda _, x, seen=seen: seen.append(x.copy()))
        histories.append(seen)
    first, second = np.array(histories[0]), np.array(histories[1])
    assert first.shape == second.shape == (60, problem.n_rows)
    assert np.abs(first - second).max() <= 1e-13 * np.abs(first).max()


def test_factor_form_never_assembles_the_delassus_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: ContactProblem) -> None:
        raise AssertionError("the Delassus matrix was assembled")

    monkeypatch.setattr(ContactProblem, "delassus_blocks", refuse)
    solution = solve(random_factors(3), "SORprox(form='factors', step_size='row_sum')")
    assert solution.status is Status.SOLVED


def test_factor_form_with_coupled_masses_solves_the_same_problem() -> None:
    rng = np.random.default_rng(3)
    blocks = [np.linalg.inv(root @ root.T + np.eye(3)) for root in rng.normal(size=(4, 3, 3))]
    inverse_mass = np.zeros((12, 12))
    for index, block in enumerate(blocks):
        inverse_mass[3 * index : 3 * index + 3, 3 * index : 3 * index + 3] = block
    directions = rng.normal(size=(12, 9))
    problem = ContactProblem.from_factors(directions, inverse_mass, rng.normal(size=9), 0.5)
    solution = solve(problem, "SORprox(form='factors')", tolerance=1e-10)
    assert solution.status is Status.SOLVED
    dense = directions.T @ inverse_mass @ directions
    assembled = ContactProblem.from_delassus(dense, problem.free_velocity, 0.5)
    assert judge(assembled, solution.impulses).residual <= 1.001e-10


def test_factor_form_declines_a_problem_without_factors() -> None:
    solution = solve(counterexample(0.3), "SORprox(form='factors')")
    assert solution.status is Status.UNSUPPORTED
    assert "factors" in solution.message


def test_counterexample_oscillates_at_full_relaxation() -> None:
    """A slipping contact converges if and only if |1 − ω(1 + μ|G_NT|/G_NN)| < 1; at μ = 2, ω = 1 this is 1.45."""
    solution = solve(counterexample(2.0), "SORprox", tolerance=1e-10)
    assert solution.status is Status.OSCILLATING


@pytest.mark.parametrize("solver", ["SORprox(relaxation=0.5)", "SORprox(step_size='row_sum')"])
def test_counterexample_is_solved_with_smaller_steps(solver: str) -> None:
    solution = solve(counterexample(2.0), solver, tolerance=1e-12)
    assert solution.status is Status.SOLVED
    assert np.abs(solution.impulses - KNOWN).max() <= 1e-8


def test_row_sums_fail_on_the_counterexample_at_friction_four() -> None:
    solution = solve(counterexample(4.0), "SORprox(step_size='row_sum')", tolerance=1e-10)
    assert solution.status is Status.OSCILLATING


@pytest.mark.parametrize("friction", [0.5, 1.0, 1.3, 1.45, 2.0])
def test_slipping_contact_converges_at_the_rate_of_the_theory(friction: float) -> None:
    """In slip Λ_N^{ν+1} − Λ_N* = (1 − ω(1 + μ G_NT/G_NN)) (Λ_N^ν − Λ_N*), with Λ_T = −μ Λ_N here."""
    relaxation = 0.6
    problem = counterexample(friction)
    delassus = problem.delassus().toarray()
    rate = abs(1.0 - relaxation * (1.0 - friction * delassus[0, 1] / delassus[0, 0]))
    normals: list[float] = []
    create("SORprox", relaxation=relaxation).prepare(problem).solve(
        Stop(1e-300, 12), observe=lambda _, impulses: normals.append(impulses[0])
    )
    exact = 0.0981 / (delassus[0, 0] - friction * delassus[0, 1])
    errors = np.abs(np.array(normals) - exact)
    measurable = errors[:-1] > 1e-12
    assert measurable.sum() >= 3
    assert errors[1:][measurable] / errors[:-1][measurable] == pytest.approx(rate, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"relaxation": 0.0}, "relaxation"),
        ({"relaxation": float("nan")}, "relaxation"),
        ({"relaxation": "fast"}, "relaxation"),
        ({"step_size": "guess"}, "step_size"),
        ({"form": "dense"}, "form"),
    ],
)
def test_error_names_the_invalid_option(options: dict[str, object], named: str) -> None:
    with pytest.raises(SolverError, match=named):
        create("SORprox", **options)
