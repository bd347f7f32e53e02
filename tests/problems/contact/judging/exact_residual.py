"""The judge's residual in rational numbers: another algorithm on the same values."""

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from proxbench.problems import ContactProblem
from proxbench.problems.contact.residual import Residual

ROOT_BITS = 160
"""Bits to which a root is computed; it is rounded down."""


def exact_velocity(problem: ContactProblem, impulses: np.ndarray) -> list[Fraction]:
    """Return ξ = GΛ + c, or Wᵀ M⁻¹ W Λ + c, without any rounding."""
    product = [Fraction(float(x)) for x in impulses]
    if problem.factors is None:
        matrices = [problem.matrix]
    else:
        directions = problem.factors.force_directions
        matrices = [directions, problem.factors.inverse_mass.matrix, directions.T]
    for matrix in matrices:
        entries = matrix.tocoo()
        moved = [Fraction(0)] * matrix.shape[0]
        for row, column, value in zip(entries.row, entries.col, entries.data, strict=True):
            if product[column]:
                moved[row] += Fraction(float(value)) * product[column]
        product = moved
    return [x + Fraction(float(c)) for x, c in zip(product, problem.free_velocity, strict=True)]


def exact_residual(problem: ContactProblem, impulses: np.ndarray) -> Fraction:
    """Return the residual of Λ [N s], shape (n_rows,), with scales, α and ℓ as doubles; the scale must not be zero."""
    residual, laws = Residual(problem), problem.laws
    velocity, held = exact_velocity(problem, impulses), [Fraction(float(x)) for x in impulses]
    worst = Fraction(0)
    for law in range(laws.n_laws):
        kind, row, alpha = int(laws.kind[law]), int(laws.first_row[law]), Fraction(float(residual.alpha[law]))
        if kind == 0:
            violation = abs(min(alpha * held[row], velocity[row]))
        elif kind == 3:
            violation = abs(velocity[row])
        else:
            rows = slice(row, row + (kind if kind < 3 else kind - 3))
            bound, partner = Fraction(float(laws.fixed_bound[law])), int(laws.partner[law])
            if partner >= 0:
                normal = max(held[int(laws.first_row[partner])], Fraction(0))
                bound += Fraction(float(laws.friction_coefficient[law])) * normal
            scaled = [alpha * x for x in held[rows]]
            violation = outside_ball(scaled, velocity[rows], alpha * bound) * Fraction(float(residual.lengths[law]))
        worst = max(worst, violation * Fraction(float(residual.ratios[law])))
    return worst / Fraction(float(residual.scale))


def outside_ball(held: Sequence[Fraction], velocity: Sequence[Fraction], bound: Fraction) -> Fraction:
    """Return ‖h − P(h − ξ)‖ with P the projection onto the ball of radius ``bound``."""
    target = [h - xi for h, xi in zip(held, velocity, strict=True)]
    squared = sum((x * x for x in target), Fraction(0))
    if squared <= bound * bound:
        return root(sum((xi * xi for xi in velocity), Fraction(0)))
    length = root(squared)
    return root(sum(((h - bound * x / length) ** 2 for h, x in zip(held, target, strict=True)), Fraction(0)))


def root(square: Fraction) -> Fraction:
    """Return the root, rounded down to ``ROOT_BITS`` bits."""
    if square == 0:
        return Fraction(0)
    shift = max(0, 2 * ROOT_BITS - square.numerator.bit_length() + square.denominator.bit_length())
    shift += shift % 2
    return Fraction(math.isqrt((square.numerator << shift) // square.denominator), 1 << (shift // 2))
