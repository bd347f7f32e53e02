"""The residual of an engine's own model is 0 only at the solution of its cone program, for any rows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ContactProblem, Model, ProblemError, judge, load, save_problem
from proxbench.problems.contact.transformations import duplicated, in_units, permuted, rotated
from proxbench.problems.engine_model import EngineModel, EngineSet, judge_own_model, own_residual

LINE, INTERVAL, HALF_LINE, CONE, COULOMB_CONE = EngineSet


def model_of(
    kinds: list[EngineSet], offset: list[float], bound: float = 0.0, coefficient: float = 1.0, unit: float = 1.0
) -> EngineModel:
    n_rows = len(offset)
    widths = [3 if kind in (CONE, COULOMB_CONE) else 1 for kind in kinds]
    is_friction = np.concatenate([np.arange(width) > 0 for width in widths])
    b = unit * np.array(offset)
    return EngineModel(
        matrix=sp.csr_array(0.5 * unit * np.eye(n_rows)),
        regularisation=np.full(n_rows, 0.5 * unit),
        offset=b,
        scale=float(np.abs(b).max()),
        kind=np.array(kinds, dtype=np.int8),
        first_row=np.cumsum([0, *widths[:-1]]),
        coefficient=np.where(is_friction, coefficient, 1.0),
        bound=np.full(n_rows, bound),
        combination=sp.csr_array(np.eye(n_rows)),
        time_step=1.0,
        name="engine",
    )


@pytest.mark.parametrize(
    ("kind", "offset", "solution"),
    [
        (LINE, [-2.0], [2.0]),
        (LINE, [2.0], [-2.0]),
        (INTERVAL, [-2.0], [0.5]),
        (INTERVAL, [2.0], [-0.5]),
        (INTERVAL, [0.25], [-0.25]),
        (HALF_LINE, [-2.0], [2.0]),
        (HALF_LINE, [2.0], [0.0]),
    ],
)
def test_residual_of_one_row_is_zero_at_the_solution(
    kind: EngineSet, offset: list[float], solution: list[float]
) -> None:
    model = model_of([kind], offset, bound=0.5)
    assert judge_own_model(model, solution) == 0.0
    assert judge_own_model(model, np.array(solution) + 0.1) == pytest.approx(0.1 / abs(offset[0]))


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize(
    ("offset", "solution"),
    [
        ([-5.0, 1.0, 1.0], [5.0, -1.0, -1.0]),
        ([1.0, 0.1, 0.0], [0.0, 0.0, 0.0]),
        ([-1.0, 3.0, 4.0], [2.8, -0.84, -1.12]),  # of min ½‖f + b‖² over ‖f_T‖ ≤ ½ f_N
    ],
)
def test_the_residual_of_an_elliptic_cone_is_zero_only_at_its_solution(
    offset: list[float], solution: list[float], unit: float
) -> None:
    model = model_of([CONE], offset, coefficient=0.5, unit=unit)
    assert judge_own_model(model, solution) < 1e-15
    assert judge_own_model(model, [solution[0], solution[1] + 0.1, solution[2]]) > 1e-3


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_a_cone_of_coulombs_law_slides_against_the_velocity_and_does_not_separate(unit: float) -> None:
    model = model_of([COULOMB_CONE], [-1.0, 3.0, 4.0], coefficient=0.5, unit=unit)
    assert judge_own_model(model, [1.0, -0.3, -0.4]) < 1e-15
    assert judge_own_model(model, [2.8, -0.84, -1.12]) > 0.1  # the solution of the elliptic cone
    assert judge_own_model(model_of([COULOMB_CONE], [-5.0, 1.0, 1.0], coefficient=0.5), [5.0, -1.0, -1.0]) < 1e-15


def test_forces_that_are_not_finite_have_an_infinite_residual() -> None:
    assert judge_own_model(model_of([LINE], [1.0]), [np.nan]) == np.inf


def test_a_model_whose_sets_do_not_tile_its_rows_is_refused() -> None:
    model = model_of([LINE, LINE], [1.0, 1.0])
    with pytest.raises(ProblemError, match="must tile its rows"):
        EngineModel(**{**vars(model), "first_row": np.array([0, 3])})
    with pytest.raises(ProblemError, match="forces must have shape"):
        judge_own_model(model, [1.0])


STEP, MU = 0.01, 0.5
EDGES = np.array([[1.0, 1.0, 1.0, 1.0], [MU, -MU, 0.0, 0.0], [0.0, 0.0, MU, -MU]])


def pyramid_problem(n_contacts: int = 2) -> ContactProblem:
    """Contacts of unit masses with four edges each; b combines c and a correction of the position."""
    matrix = np.kron(np.eye(n_contacts), EDGES.T @ EDGES)
    c = np.array([-1.0, 0.3, 0.2, -0.5, -2.0, 0.1])[: 3 * n_contacts]
    offset = np.kron(np.eye(n_contacts), EDGES.T) @ c / STEP - 7.0
    engine = EngineModel(
        name="engine",
        matrix=sp.csr_array(matrix),
        regularisation=np.full(4 * n_contacts, 0.1),
        offset=offset,
        scale=float(np.abs(offset).max()),
        kind=np.full(4 * n_contacts, HALF_LINE, dtype=np.int8),
        first_row=np.arange(4 * n_contacts),
        coefficient=np.ones(4 * n_contacts),
        bound=np.zeros(4 * n_contacts),
        combination=sp.csr_array(STEP * np.kron(np.eye(n_contacts), EDGES)),
        time_step=STEP,
    )
    return ContactProblem.from_delassus(np.eye(3 * n_contacts), c, MU, engine=engine)


def solution_of(problem: ContactProblem) -> np.ndarray:
    """Return the forces that projected gradients find."""
    engine, forces = problem.engine, np.zeros(8)
    assert engine is not None
    for _ in range(2000):
        forces = np.maximum(forces - 0.1 * engine.gradient(forces), 0.0)
    return forces


def test_impulses_that_solve_a_pyramid_have_the_forces_of_its_solution() -> None:
    problem = pyramid_problem()
    engine, forces = problem.engine, solution_of(pyramid_problem())
    assert engine is not None
    assert judge_own_model(engine, forces) < 1e-12
    assert np.count_nonzero(forces == 0.0) > 0
    assert engine.forces(engine.impulses(forces)) == pytest.approx(forces, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("impulses", "forces"),
    [
        ([4.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0]),
        ([4.0, 0.5, 0.0], [1.5, 0.5, 1.0, 1.0]),
        ([4.0, 1.5, 0.0], [3.0, 0.0, 0.5, 0.5]),  # the least sums would be negative
        ([4.0, 1.0, -1.0], [2.0, 0.0, 0.0, 2.0]),  # on the boundary
        ([4.0, 2.5, 0.0], [4.75, -0.25, -0.25, -0.25]),  # outside
    ],
)
def test_forces_of_a_pyramid_are_the_least_ones(impulses: list[float], forces: list[float]) -> None:
    engine = pyramid_problem(1).engine
    assert engine is not None
    assert engine.forces(STEP * np.array(impulses)) == pytest.approx(forces)
    assert engine.impulses(np.array(forces)) == pytest.approx(STEP * np.array(impulses))


def test_the_residual_does_not_depend_on_order_tangents_and_units() -> None:
    problem = pyramid_problem()
    assert problem.engine is not None
    impulses = problem.engine.impulses(solution_of(problem)) * 1.01
    expected = own_residual(problem.engine, impulses)
    assert expected > 1e-4
    turned = rotated(permuted(problem, [1, 0]).problem, [0.0, 0.4, 0.0, 1.1]).problem
    other = in_units(turned, mass=4.0, length=2.0).problem
    assert other.engine is not None
    moved = other.engine.impulses(1.01 * solution_of(problem))
    assert np.abs(moved).max() != pytest.approx(np.abs(impulses).max())
    assert judge(other, moved, Model.ENGINE).residual == pytest.approx(expected)
    assert duplicated(problem, 0).problem.engine is None


def test_a_change_of_the_free_velocity_changes_b() -> None:
    problem = rotated(pyramid_problem(), [0.0, 0.3, 0.0, 0.2]).problem
    change = np.array([0.1, -0.2, 0.3, 0.0, 0.4, 0.2])
    moved = problem.with_free_velocity(problem.free_velocity + change)
    assert problem.engine is not None
    assert moved.engine is not None
    impulses = np.array([1.0, 0.2, -0.1, 2.0, 0.3, 0.2])
    work = (moved.engine.offset - problem.engine.offset) @ problem.engine.forces(impulses)
    assert work == pytest.approx(impulses @ change / STEP**2)


def test_the_judge_holds_impulses_to_the_model_of_the_engine() -> None:
    problem = pyramid_problem()
    assert problem.engine is not None
    impulses = problem.engine.impulses(solution_of(problem))
    assert judge(problem, impulses, Model.ENGINE).residual < 1e-12
    assert judge(problem, impulses).residual > 1e-3
    plain = replace(problem, engine=None)
    assert judge(plain, impulses, Model.ENGINE).residual == judge(plain, impulses, Model.CONVEX).residual


def test_a_file_keeps_the_model_and_the_digest_depends_on_it(tmp_path: Path) -> None:
    problem = rotated(pyramid_problem(), 0.3).problem
    assert problem.engine is not None
    save_problem(problem, tmp_path / "problem.npz")
    found = load(tmp_path / "problem.npz")
    assert found.digest == problem.digest == problem.fresh().digest
    assert found.engine is not None
    impulses = np.array([1.0, 0.2, -0.1, 2.0, 0.3, 0.2])
    assert own_residual(found.engine, impulses) == own_residual(problem.engine, impulses)
    softer = replace(problem.engine, regularisation=2.0 * problem.engine.regularisation)
    assert len({problem.digest, replace(problem, engine=softer).digest, replace(problem, engine=None).digest}) == 3


def test_a_model_of_other_rows_is_refused() -> None:
    with pytest.raises(ProblemError, match="has 6 impulses for 3 rows"):
        replace(pyramid_problem(1), engine=pyramid_problem(2).engine)


def test_the_residual_of_forces_whose_arithmetic_overflows_is_infinite() -> None:
    forces = [1.7e308, 1.7e308, -1.7e308]
    with np.errstate(all="ignore"):
        assert judge_own_model(model_of([CONE], [-2.0, 0.1, 0.1], unit=4.0), forces) == np.inf
