"""The first root of a polynomial through a few points agrees with its known factors."""

import numpy as np
import pytest
from proxbench.problems.motion.stepping.switch_search import _first_roots


@pytest.mark.parametrize("n_points", [2, 3, 4])
@pytest.mark.parametrize("spare", [0, 1])
def test_the_first_root_is_that_of_the_factors_also_where_more_points_than_needed_are_given(
    n_points: int, spare: int
) -> None:
    """With a spare point the leading coefficient is within rounding, and the companion matrix has entries of 10¹⁴."""
    rounding = 1e14 * 2.0**-51 if spare else 1e-9
    rng = np.random.default_rng(0)
    roots = np.sort(rng.uniform(0.1, 3.0, size=(20, n_points - 1)), axis=1) + 0.5 * np.arange(n_points - 1)
    x = np.tile(np.linspace(-1.0, 0.0, n_points + spare), (20, 1)) * rng.uniform(0.5, 1.0, size=(20, 1))
    y = rng.uniform(0.5, 2.0, size=(20, 1)) * np.prod(1.0 - x[:, :, None] / roots[:, None, :], axis=2)
    for after in range(n_points - 1):
        begin = np.zeros(20) if after == 0 else roots[:, after - 1] + 0.1
        assert _first_roots(x, y, begin) == pytest.approx(roots[:, after], abs=rounding)
    if not spare:
        assert (_first_roots(x, y, roots[:, -1] + 0.1) == np.inf).all()


def test_a_polynomial_without_real_roots_has_none() -> None:
    x = np.linspace(-1.0, 0.0, 3)[None, :]
    assert _first_roots(x, 1.0 + (x - 0.5) ** 2, np.zeros(1))[0] == np.inf
    assert _first_roots(x[:, :1], x[:, :1], np.zeros(1))[0] == np.inf
