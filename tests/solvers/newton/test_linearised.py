"""The system of a Newton step is the derivative of the projection equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, LawKind, Laws
from proxbench.problems.contact.laws import ROWS_OF_KIND
from proxbench.problems.contact.residual import Residual
from proxbench.solvers.iteration.stopping import Clock
from proxbench.solvers.newton import linearised
from proxbench.solvers.newton.linear_solver import LinearSolver
from proxbench.solvers.newton.linearised import Equations
from proxbench.solvers.newton.work import Work

KIND = np.array([0, 0, 1, 0, 2, 2, 0, 1, 3, 0, 1, 4, 0, 2, 5, 0, 6])
"""A frictionless contact, planar and spatial contacts, a joint of fixed bound, a friction law that does not follow its
partner, a bilateral row, and rolling about one, two and three axes."""

PARTNER = np.array([-1, -1, 1, -1, 3, -1, -1, 0, -1, -1, 9, 9, -1, 12, 12, -1, 15])
FRICTION = np.array([0, 0, 0.4, 0, 0.3, 0, 0, 0.5, 0, 0, 0.4, 0.1, 0, 0.3, 0.1, 0, 0.2])
FIXED = np.array([0, 0, 0, 0, 0.01, 0.2, 0, 0, 0, 0, 0, 0, 0, 0, 0.01, 0, 0])
LAWS = Laws.in_order(KIND, FRICTION, FIXED, PARTNER)
FIRST_ROW, ROWS, N = LAWS.first_row, ROWS_OF_KIND[KIND], LAWS.n_rows


def mixed_problem(seed: int, impulses: np.ndarray) -> ContactProblem:
    """Return a problem in which unilateral laws are closed at ``impulses``, and friction sticks or slips at random."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(40, N))
    delassus, velocity = root.T @ root, rng.normal(size=N) * np.abs(impulses).max() * rng.choice([3.0, 30.0])
    normal = FIRST_ROW[KIND == LawKind.UNILATERAL]
    velocity[normal] = delassus.diagonal()[normal] * impulses[normal] * rng.uniform(-1.0, 0.9, len(normal))
    return ContactProblem.from_delassus(delassus, velocity - delassus @ impulses, laws=LAWS)


def projected(problem: ContactProblem, alpha: np.ndarray, impulses: np.ndarray) -> np.ndarray:
    """Return prox(Λ − ξ/α), law by law."""
    laws, velocity = problem.laws, problem.relative_velocity(impulses)
    result = np.empty_like(impulses)
    for law, kind in enumerate(laws.kind):
        rows = slice(laws.first_row[law], laws.first_row[law] + ROWS[law])
        argument = impulses[rows] - velocity[rows] / alpha[law]
        if kind == LawKind.UNILATERAL:
            result[rows] = np.maximum(argument, 0.0)
            continue
        if kind == LawKind.BILATERAL:
            result[rows] = argument
            continue
        bound = laws.fixed_bound[law]
        if laws.partner[law] >= 0:
            bound += laws.friction_coefficient[law] * impulses[laws.first_row[laws.partner[law]]]
        length = np.linalg.norm(argument)
        result[rows] = argument if length <= bound else argument * bound / length
    return result


def equations(problem: ContactProblem, dense: bool = True) -> Equations:
    """Return the equations, dense as for small problems, or sparse as for large ones."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(linearised, "MAX_DENSE_ROWS", problem.n_rows if dense else 0)
        return Equations(problem, Residual(problem))


def matrix_of(system: linearised.LinearSystem) -> np.ndarray:
    return system.matrix if isinstance(system.matrix, np.ndarray) else system.matrix.toarray()


@pytest.mark.slow
@given(seed=st.integers(0, 2**31), size=st.sampled_from([0.02, 0.1, 1.0]), dense=st.booleans())
def test_linearisation_agrees_with_finite_differences(seed: int, size: float, dense: bool) -> None:
    impulses = np.random.default_rng(seed + 1).uniform(0.1, 1.0, size=N) * size
    problem = mixed_problem(seed, impulses)
    residual = Residual(problem)
    system = equations(problem, dense).linearise(impulses)
    assert isinstance(system.matrix, np.ndarray) == dense
    alpha, base, active = residual.alpha, system.base, system.active
    row_alpha = np.repeat(alpha, ROWS)
    assert np.array_equal(base, impulses)
    assert len(active) == N
    step, columns = 1e-7 * size, []
    for row in active:
        nudge = np.zeros(N)
        nudge[row] = step
        ahead, behind = base + nudge, base - nudge
        difference = (ahead - projected(problem, alpha, ahead)) - (behind - projected(problem, alpha, behind))
        columns.append((row_alpha * difference / (2 * step))[active])
    expected = np.array(columns).T
    right = (row_alpha * (projected(problem, alpha, base) - base))[active]
    scale = np.abs(expected).max()
    assert np.abs(matrix_of(system) - expected).max() <= 1e-5 * scale
    assert np.abs(system.right - right).max() <= 1e-12 * max(1.0, np.abs(right).max())


def test_open_contacts_and_their_friction_leave_the_system() -> None:
    delassus = np.eye(4)
    problem = ContactProblem.from_delassus(delassus, (-1.0, 0.5, 2.0, 0.5), 0.3, dim=2)
    system = Equations(problem, Residual(problem)).linearise(np.array([0.5, 0.1, 0.5, 0.1]))
    assert system.active.tolist() == [0, 1]
    assert system.base.tolist() == [0.5, 0.1, 0.0, 0.0]


@pytest.mark.parametrize("free", [0.1, -0.1])
def test_a_law_without_curvature_leaves_the_system(free: float) -> None:
    laws = Laws(np.array([1, 1]), np.array([0, 1]), np.zeros(2), np.array([0.2, 0.2]), np.array([-1, -1]))
    problem = ContactProblem.from_delassus(np.diag([1.0, 0.0]), (free, 0.0), laws=laws)
    system = Equations(problem, Residual(problem)).linearise(np.array([0.0, 0.05]))
    assert system.active.tolist() == [0]
    assert system.base.tolist() == [0.0, 0.05]


@pytest.mark.parametrize("regularised", [False, True])
def test_a_small_system_has_the_step_of_the_sparse_one(regularised: bool) -> None:
    impulses = np.random.default_rng(3).uniform(0.1, 1.0, size=N)
    problem, steps = mixed_problem(2, impulses), []
    for dense in (False, True):
        made = equations(problem, dense)
        if regularised:
            made = made.regularised(0.1, 0.5 * impulses)
        system = made.linearise(impulses)
        scale = 1.0 / np.sqrt(made.row_alpha[system.active])
        steps.append(LinearSolver(Clock(np.inf), Work(made.entries)).solve(system, scale, 1e-6))
    assert np.abs(steps[1] - steps[0]).max() <= 1e-8 * np.abs(steps[0]).max()


def test_a_small_singular_system_has_no_step() -> None:
    problem = ContactProblem.from_delassus(np.ones((2, 2)), (-1.0, -1.0), 0.0, dim=1)
    made = equations(problem)
    system = made.linearise(np.full(2, 0.5))
    assert LinearSolver(Clock(np.inf), Work(made.entries)).solve(system, np.ones(2), 0.0) is None
