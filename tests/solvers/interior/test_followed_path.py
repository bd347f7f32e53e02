"""Between two corrections the path has the accuracy of its power series."""

import warnings

import numpy as np
import pytest
from proxbench.problems import load
from proxbench.solvers import Stop
from proxbench.solvers.interior.central_path import CentralPath
from proxbench.solvers.interior.followed_path import Direction, Point
from proxbench.solvers.interior.progress import Progress


@pytest.mark.parametrize("order", [2, 3, 5])
def test_the_error_of_a_series_has_the_order_after_its_last_term(order: int) -> None:
    """The residual of the equations at a is O(aᴺ⁺¹): halving a multiplies it by 2⁻⁽ᴺ⁺¹⁾."""
    problem = load("funnel-30")
    method = CentralPath(order=order)
    prepared = method.prepare(problem)
    zeros = np.zeros(problem.n_rows)
    progress = Progress(problem, prepared.residual, Stop(1e-15), None, flops=prepared.system.flops, first=zeros)
    path = method.path(prepared, progress)
    path.find(zeros)
    point = path._point
    assert path._factorise(point)
    series = path._series(point, path._oriented_tangent(point))

    def left(a: float) -> float:
        end = Point(prepared.scaled_problem, prepared.system, series.manifold_vector(a), series.tau_at(a) * point.tau)
        return float(np.abs(end.primal - point.primal).max())

    reach = 0.05 * path._range(series)
    assert np.log2(left(reach) / left(0.5 * reach)) == pytest.approx(order + 1, abs=0.35)


def test_directions_that_overflow_cause_no_warning() -> None:
    """The sum of the changes along τ is not a number; numpy's scalars would warn on standard error."""
    problem = load("funnel-30")
    method, zeros = CentralPath(), np.zeros(problem.n_rows)
    prepared = method.prepare(problem)
    progress = Progress(problem, prepared.residual, Stop(1e-2), None, flops=prepared.system.flops, first=zeros)
    path = method.path(prepared, progress)
    path.find(zeros)
    tangent = path._oriented_tangent(path._point)
    huge, none = (Direction(tangent.r, tangent.u, tangent.s, np.float64(tau)) for tau in (np.inf, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isnan(path._product(huge, none) / path._product(huge, huge))
