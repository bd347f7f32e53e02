"""Inverses, signs and products of small blocks agree with NumPy's linear algebra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.solvers.interior.systems.small_blocks import invert, times


@given(width=st.integers(1, 7), n=st.integers(0, 5), decades=st.integers(0, 6), seed=st.integers(0, 2**32 - 1))
def test_inverses_and_signs_of_determinants_agree_with_numpy(width: int, n: int, decades: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = rng.normal(size=(n, width, width)) * 10.0 ** rng.integers(-decades, decades + 1, size=(n, width, 1))
    inverses = np.empty_like(blocks)
    sign = invert(blocks, inverses)
    assert sign == np.prod(np.linalg.slogdet(blocks).sign)
    expected = np.linalg.inv(blocks)
    for block, inverse, known in zip(blocks, inverses, expected, strict=True):
        assert np.linalg.norm(inverse - known) <= 1e-14 * np.linalg.cond(block) * np.linalg.norm(known)


def test_rows_in_another_order_have_the_sign_of_the_permutation() -> None:
    blocks = np.eye(3)[[[1, 0, 2]]]
    inverses = np.empty_like(blocks)
    assert invert(blocks, inverses) == -1.0
    assert np.array_equal(inverses, np.linalg.inv(blocks))
    assert invert(np.concatenate([blocks, blocks]), np.empty((2, 3, 3))) == 1.0


@pytest.mark.parametrize("entry", [0.0, np.nan, np.inf, 1e-320])
def test_the_sign_is_zero_for_blocks_without_a_finite_inverse(entry: float) -> None:
    blocks = np.array([np.eye(2), np.diag([1.0, entry])])
    assert invert(blocks, np.empty_like(blocks)) == 0.0


def test_products_are_those_of_each_block() -> None:
    rng = np.random.default_rng(0)
    blocks, lanes = rng.normal(size=(5, 3, 3)), rng.normal(size=(5, 3))
    assert np.allclose(times(blocks, lanes), (blocks @ lanes[:, :, None])[:, :, 0], rtol=1e-14, atol=0.0)
