"""The residual of an engine's own model: 0 at the solution of its cone program, and nowhere else."""

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ProblemError
from proxbench.problems.capture.engine_model import EngineModel, EngineSet, judge_own_model

LINE, INTERVAL, HALF_LINE, CONE = EngineSet


def model_of(
    kinds: list[EngineSet], offset: list[float], bound: float = 0.0, coefficient: float = 1.0, unit: float = 1.0
) -> EngineModel:
    n_rows = len(offset)
    widths = [3 if kind == CONE else 1 for kind in kinds]
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
        forces=np.zeros(n_rows),
        impulses=np.zeros(n_rows),
        engine="engine",
        solver="solver",
        iterations=1,
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
def test_one_row(kind: EngineSet, offset: list[float], solution: list[float]) -> None:
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
def test_an_elliptic_cone(offset: list[float], solution: list[float], unit: float) -> None:
    model = model_of([CONE], offset, coefficient=0.5, unit=unit)
    assert judge_own_model(model, solution) < 1e-15
    assert judge_own_model(model, [solution[0], solution[1] + 0.1, solution[2]]) > 1e-3


def test_forces_that_are_not_finite_have_an_infinite_residual() -> None:
    assert judge_own_model(model_of([LINE], [1.0]), [np.nan]) == np.inf


def test_a_model_whose_sets_do_not_tile_its_rows_is_refused() -> None:
    model = model_of([LINE, LINE], [1.0, 1.0])
    with pytest.raises(ProblemError, match="must tile its rows"):
        EngineModel(**{**vars(model), "first_row": np.array([0, 3])})
    with pytest.raises(ProblemError, match="forces must have shape"):
        judge_own_model(model, [1.0])
