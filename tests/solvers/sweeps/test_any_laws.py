"""Sweeps over joints and rolling friction are the equations [49–55], law by law, in both forms."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, LawKind, Laws, judge
from proxbench.problems.contact.laws import ROWS_OF_KIND
from proxbench.problems.contact.residual import Residual
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem
from proxbench.problems.hard.joints import parallelogram
from proxbench.solvers import Status, Stop, create, solve

CASES = [(dim, joints, rolling) for dim in (1, 2, 3) for joints, rolling in ((2, 0), (0, 1), (3, 2), (1, 3))]


def by_the_book(problem: ContactProblem, count: int, relaxation: float, row_sum: bool, jacobi: bool) -> np.ndarray:
    """Return Λ after ``count`` sweeps; Jacobi's take ξ of the previous sweep, and bounds from the newest Λ_N."""
    delassus, c, laws = problem.delassus().toarray(), problem.free_velocity, problem.laws
    length = np.repeat(Residual(problem).lengths, ROWS_OF_KIND[laws.kind])
    impulses = np.zeros(problem.n_rows)
    order = np.argsort(laws.is_friction, kind="stable") if jacobi else np.arange(laws.n_laws)
    for _ in range(count):
        before = impulses.copy()
        for law in order:
            rows = slice(laws.first_row[law], laws.first_row[law] + ROWS_OF_KIND[laws.kind[law]])
            block = delassus[rows]
            scale = block[:, rows].diagonal().max()
            if row_sum:
                scale = (np.abs(block) @ length / length[rows]).max()
            velocity = block @ (before if jacobi else impulses) + c[rows]
            target = impulses[rows] - relaxation / scale * velocity
            if laws.kind[law] == LawKind.UNILATERAL:
                target = np.maximum(target, 0.0)
            elif laws.kind[law] != LawKind.BILATERAL:
                normal = impulses[laws.first_row[laws.partner[law]]]
                bound = laws.fixed_bound[law] + laws.friction_coefficient[law] * max(normal, 0.0)
                target = target * min(1.0, bound / max(np.linalg.norm(target), 1e-300))
            impulses[rows] = target
    return impulses


def history(solver: str, problem: ContactProblem, count: int) -> list[np.ndarray]:
    seen: list[np.ndarray] = []
    create(solver).prepare(problem).solve(Stop(1e-300, count), observe=lambda _, x: seen.append(x.copy()))
    return seen


@pytest.mark.parametrize("row_sum", [False, True])
@pytest.mark.parametrize(("dim", "joints", "rolling"), CASES)
def test_gauss_seidel_sweeps_are_those_of_the_paper(dim: int, joints: int, rolling: int, row_sum: bool) -> None:
    problem = random_linked_problem(LinkedFamily(5, dim, 25, n_joints=joints, rolling_rows=rolling), dim)
    step_size = "row_sum" if row_sum else "diagonal"
    for form in ("delassus", "factors"):
        seen = history(f"SORprox(relaxation=0.8, step_size='{step_size}', form='{form}')", problem, 7)
        for count in (1, 7):
            expected = by_the_book(problem, count, 0.8, row_sum, jacobi=False)
            assert np.abs(seen[count - 1] - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize(("dim", "joints", "rolling"), CASES)
def test_jacobi_sweeps_are_those_of_the_paper(dim: int, joints: int, rolling: int) -> None:
    problem = random_linked_problem(LinkedFamily(5, dim, 25, n_joints=joints, rolling_rows=rolling), dim)
    seen = history("JORprox(relaxation=0.3)", problem, 7)
    for count in (1, 7):
        expected = by_the_book(problem, count, 0.3, row_sum=False, jacobi=True)
        assert np.abs(seen[count - 1] - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("solver", ["SORprox", "SORprox(form='factors')", "JORprox(relaxation=0.3)", "NSGS"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_an_uncoupled_joint_does_not_change_the_iterates_of_contacts(dim: int, solver: str) -> None:
    """Different kernels sweep contacts with and without joints."""
    rng = np.random.default_rng(dim)
    directions, c = rng.normal(size=(30, 6 * dim)), rng.normal(size=6 * dim)
    alone = ContactProblem.from_factors(directions, np.ones(30), c, 0.4, dim=dim)
    wider = np.zeros((31, 6 * dim + 1))
    wider[:30, :-1], wider[30, -1] = directions, 1.0
    laws = Laws.concatenate([alone.laws, Laws.joints(1)])
    beside = ContactProblem.from_factors(wider, np.ones(31), np.append(c, 0.5), laws=laws)
    for before, after in zip(history(solver, alone, 10), history(solver, beside, 10), strict=True):
        assert after[:-1] == pytest.approx(before, rel=1e-12, abs=1e-13)
    assert after[-1] == pytest.approx(-0.5 * (1.0 - 0.7**10) if "JOR" in solver else -0.5)


@pytest.mark.parametrize("name", ["Lemke", "PyramidPGS", "Enumeration"])
def test_methods_for_contacts_alone_decline_joints_and_rolling_with_the_reason(name: str) -> None:
    joints = random_linked_problem(LinkedFamily(2, 2, rolling_rows=0, n_joints=1), 0)
    rolling = random_linked_problem(LinkedFamily(2, 2, rolling_rows=1, n_joints=0), 0)
    assert "joints" in str(create(name).supports(joints))
    assert "rolling friction" in str(create(name).supports(rolling))


@pytest.mark.parametrize("form", ["delassus", "factors"])
def test_temporarily_large_impulses_leave_no_rounding_in_the_residual(form: str) -> None:
    """Momentum increases the impulses of redundant joints to over 1e4 times their final size."""
    problem, largest = parallelogram(20, 0.4), []
    solver = f"SORprox(relaxation=1.1, momentum=0.8, form={form!r})"
    found = (
        create(solver)
        .prepare(problem)
        .solve(Stop(1e-12, 2000), observe=lambda _, impulses: largest.append(np.abs(impulses).max()))
    )
    assert max(largest) > 1e4 * np.abs(found.impulses).max()
    assert found.status is Status.SOLVED
    assert judge(problem, found.impulses).residual <= 1.001e-12
    assert np.array_equal(solve(problem, solver, tolerance=1e-12, max_iterations=2000).impulses, found.impulses)
