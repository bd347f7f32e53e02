"""Variants of a problem that are as hard for an honest solver as the problem itself.

``in_other_units`` changes every number but no operation: with powers of two m and s, G → m G, c → s c, Λ → (s/m) Λ
preserve the digits of every floating-point operation (moments of rolling friction scale with a further factor of
length). The exponent of m is even, because solvers take roots of masses.

``perturbed_copy`` is another problem of similar difficulty, with matrices of the same sizes. With P the cyclic shift of
the contacts and random η,

    G' = Pᵀ G P,      c' = Pᵀ (c + G η),      η_i = σ u_i ‖c_k‖ / α_i,      u_i uniform in [-1, 1],

for row i of contact k, where σ is the relative shift, α_i the diagonal entry of G and ‖c_k‖ the largest |c| of the
contact. The copy is in other units. The shift of c is in the range of G, so that a solvable problem remains solvable
even with redundant contacts. Contacts keep their neighbours, and thus the memory access pattern.

``disguised_copy`` also has rotated tangents, G'' = Qᵀ G' Q and c'' = Qᵀ c'. Its shift σ is so small that solvers need
about as many iterations, but so large that a stored answer does not solve it.
"""

import random
from dataclasses import replace

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.contact.transformations import TransformedProblem, in_units, permuted, rotated

MASS_EXPONENTS = (2, 4, 6)
"""Even exponents of two from which m, or its inverse, is drawn."""

SPEED_EXPONENTS = tuple(range(1, 9))
"""Exponents of two from which s, or its inverse, is drawn."""

SHIFT = 0.2
"""Shift σ of a perturbed copy, large enough that its solution is not a good start for the problem."""

SMALL_SHIFT = 0.02
"""Least shift σ of a disguised copy."""

SHIFT_PER_TOLERANCE = 20.0
"""Ratio of σ to the tolerance of a solve, up to ``SHIFT``, so that an answer of the problem fails on the copy."""


def in_other_units(problem: ContactProblem) -> TransformedProblem:
    """Return the problem in units drawn at random, without name, provenance and answer."""
    draw = random.SystemRandom()
    speed, mass = (2.0 ** (draw.choice((1, -1)) * draw.choice(each)) for each in (SPEED_EXPONENTS, MASS_EXPONENTS))
    transformed = in_units(problem, mass=mass, length=1.0 / speed)
    return replace(transformed, problem=transformed.problem.anonymous())


def perturbed_copy(problem: ContactProblem, shift: float = SHIFT) -> ContactProblem:
    """Return a similar problem with a random relative ``shift`` of c, in other units."""
    rng = np.random.default_rng()
    velocity = problem.free_velocity + _random_velocity(problem, shift, rng)
    return in_other_units(_shifted(problem.anonymous().with_free_velocity(velocity), rng)).problem


def disguised_copy(problem: ContactProblem, tolerance: float) -> ContactProblem:
    """Return a problem that takes about as long to solve to a tolerance, but that no answer of the original solves."""
    copy = perturbed_copy(problem, min(max(SMALL_SHIFT, SHIFT_PER_TOLERANCE * tolerance), SHIFT))
    angles = np.random.default_rng().uniform(0.0, 2.0 * np.pi, size=copy.laws.n_laws)
    return rotated(copy, angles).problem.anonymous()


def _shifted(problem: ContactProblem, rng: np.random.Generator) -> ContactProblem:
    """Return the problem with its contacts shifted cyclically."""
    count = problem.n_contacts
    return permuted(problem, np.roll(np.arange(count), int(rng.integers(max(count, 1))))).problem


def _random_velocity(problem: ContactProblem, shift: float, rng: np.random.Generator) -> FloatArray:
    """Return G η [m/s], shape (n_rows,)."""
    alpha, contact_of_row = problem.delassus_diagonal, problem.layout.contact_of_row
    speeds = np.zeros(problem.n_contacts)
    np.maximum.at(speeds, contact_of_row, np.abs(problem.free_velocity))
    eta = np.zeros(problem.n_rows)
    shifts = shift * rng.uniform(-1.0, 1.0, size=problem.n_rows) * speeds[contact_of_row]
    np.divide(shifts, alpha, out=eta, where=alpha > 0.0)
    velocity: FloatArray = problem.relative_velocity(eta) - problem.free_velocity
    return velocity
