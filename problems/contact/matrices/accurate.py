"""ξ = GΛ + c in twice the working precision, with a bound on the remaining rounding error.

In plain arithmetic a sum of n products has an error of up to n u Σ|a_j x_j|, u = 2⁻⁵³. Impulses of wedged bodies
make this bound arbitrarily large, whatever ξ is. Here the rounding errors of all products and sums are added up
(Ogita, Rump & Oishi 2005, *Accurate sum and dot product*):

    a x = p + e,   s + p = s' + d   exactly,   with p, s' rounded,

for each product a x and the running sum s. A second number is the sum of all e and d, at most 2n terms of size
u Σ|a_j x_j|. Its rounding error is below N ε Σ(|e_j| + |d_j|), with ε = 2u and N > n, and zero if the sum is exact.

G = Wᵀ M⁻¹ W chains three such products. Each takes the pair of numbers and the error bound of the previous one. The
computed ξ̂ satisfies

    |ξ̂ − ξ|  ≤  u|ξ| + h,   h ≤ (N ε)² (|Wᵀ| |M⁻¹| |W| |Λ| + |c|),

with N at least the number of terms in the longest rows of Wᵀ, M⁻¹ and W together. For a given G, |G| |Λ| replaces the
product. The first part is the rounding of the result itself, which cannot turn a velocity into zero; h is returned. In
plain arithmetic, N u replaces (N ε)².
"""

from fractions import Fraction
from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import config, njit, types, uint64
from numba.extending import intrinsic

from ...arrays import FloatArray

SMALL, LEAST = 2.0**-960, 2.0**-1020
"""Products below the first value lose less than the second value by underflow."""

SPARE_TERMS = 8
"""Number of terms counted in addition to those of the rows."""


def accurate_over_matrix(
    matrix: sp.csr_array[Any], free_velocity: FloatArray, impulses: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return ξ = GΛ + c and its rounding error bound, both of shape (n_rows,), for G in CSR."""
    velocity, rounding = np.empty((2, len(free_velocity)))
    write_accurate_over_matrix(matrix.indptr, matrix.indices, matrix.data, free_velocity, impulses, velocity, rounding)
    return velocity, rounding


def accurate_over_factors(
    directions: sp.csc_array[Any], inverse_mass: sp.csr_array[Any], free_velocity: FloatArray, impulses: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return ξ and its rounding error bound for G = Wᵀ M⁻¹ W, with W in CSC and M⁻¹ in CSR."""
    velocity, rounding = np.empty((2, len(free_velocity)))
    columns = directions.indptr, directions.indices, directions.data
    inverse = inverse_mass.indptr, inverse_mass.indices, inverse_mass.data
    write_accurate_over_factors(*columns, *inverse, free_velocity, impulses, velocity, rounding)
    return velocity, rounding


def _fused_product(a: float, b: float, c: float) -> float:
    """Return a b + c, rounded once, if kernels run as Python (NUMBA_DISABLE_JIT=1)."""
    try:
        return float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)))
    except (OverflowError, ValueError):  # infinite, or not a number
        return a * b + c


def _fused_intrinsic(typing_context, a, b, c):  # type: ignore[no-untyped-def]
    """Return a b + c as one machine instruction."""

    def code(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), code


_fused: Any = _fused_product if getattr(config, "DISABLE_JIT", 0) else intrinsic(_fused_intrinsic)


@njit(cache=True, inline="always")
def _plus(high, low, lost, a, x, rest):  # type: ignore[no-untyped-def]
    """Return high + low + a (x + rest) as two numbers, and ``lost`` plus the sizes of the new terms of the low one."""
    product, rest_product = a * x, a * rest
    error = _fused(a, x, -product)
    total = high + product
    part = total - high
    carried = (high - (total - part)) + (product - part)
    lost += abs(error) + abs(rest_product) + abs(carried)
    return total, low + (carried + (error + rest_product)), lost


@njit(cache=True, inline="always")
def _underflow(a, x):  # type: ignore[no-untyped-def]
    """Return a bound on the underflow error of a x, without a branch, because zeros would make it unpredictable."""
    return LEAST * ((abs(a * x) < SMALL) & (a != 0.0) & (x != 0.0))


@njit(cache=True, error_model="numpy")
def write_accurate_over_matrix(indptr, indices, data, free_velocity, impulses, velocity, rounding):  # type: ignore[no-untyped-def]
    """Write ξ and its rounding error bound for G in CSR."""
    longest_row = 0
    for row in range(len(free_velocity)):
        longest_row = max(longest_row, indptr[row + 1] - indptr[row])
    factor = (longest_row + SPARE_TERMS) * 2.0**-52
    for row in range(len(free_velocity)):
        high, low, lost, underflow = free_velocity[row], 0.0, 0.0, 0.0
        for p in range(indptr[row], indptr[row + 1]):
            x = impulses[indices[p]]
            if x != 0.0:
                high, low, lost = _plus(high, low, lost, data[p], x, 0.0)
                underflow += _underflow(data[p], x)
        velocity[row] = high + low
        rounding[row] = factor * lost + underflow


@njit(cache=True, error_model="numpy")
def write_accurate_over_factors(  # type: ignore[no-untyped-def]
    indptr, indices, data, mass_indptr, mass_indices, mass_data, free_velocity, impulses, velocity, rounding
):
    """Write ξ and its rounding error bound for G = Wᵀ M⁻¹ W, with W in CSC and M⁻¹ in CSR."""
    one, n_dofs, n_rows = uint64(1), len(mass_indptr) - 1, len(free_velocity)
    dof_impulses = np.zeros((n_dofs, 4))  # high, low, sizes of the terms of low, underflow
    longest_column, longest_mass_row = 0, 0
    for row in range(uint64(n_rows)):
        longest_column, x = max(longest_column, indptr[row + one] - indptr[row]), impulses[row]
        if x == 0.0:
            continue
        for p in range(uint64(indptr[row]), uint64(indptr[row + one])):
            sums = dof_impulses[uint64(indices[p])]
            sums[0], sums[1], sums[2] = _plus(sums[0], sums[1], sums[2], data[p], x, 0.0)
            sums[3] += _underflow(data[p], x)
    for dof in range(n_dofs):
        longest_mass_row = max(longest_mass_row, mass_indptr[dof + 1] - mass_indptr[dof])
    factor = (longest_column + longest_mass_row + n_rows + SPARE_TERMS) * 2.0**-52
    dof_velocities = np.zeros((n_dofs, 3))  # high, low, error bound
    for dof in range(n_dofs):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for p in range(mass_indptr[dof], mass_indptr[dof + 1]):
            sums = dof_impulses[mass_indices[p]]
            a, b, c = _plus(a, b, c, mass_data[p], sums[0], sums[1])
            d += abs(mass_data[p]) * (sums[3] + factor * sums[2])
            d += _underflow(mass_data[p], sums[0])
        dof_velocities[dof, 0], dof_velocities[dof, 1], dof_velocities[dof, 2] = a, b, d + factor * c
    for row in range(uint64(n_rows)):
        a, b, c, d = free_velocity[row], 0.0, 0.0, 0.0
        for p in range(uint64(indptr[row]), uint64(indptr[row + one])):
            sums = dof_velocities[uint64(indices[p])]
            a, b, c = _plus(a, b, c, data[p], sums[0], sums[1])
            d += abs(data[p]) * sums[2]
            d += _underflow(data[p], sums[0])
        velocity[row] = a + b
        rounding[row] = d + factor * c
