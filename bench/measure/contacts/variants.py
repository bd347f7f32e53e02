"""Other presentations of a problem, on which an honest solver works as on the problem itself.

``in_other_units`` changes every number and no step: with powers of two, G → m G, c → s c, Λ → (s/m) Λ leave the digits
of every floating-point operation as they are (moments of rolling friction change by a length more). The exponent of m
is even, because solvers take roots of masses.

``perturbed_copy`` is another problem as hard as this one, with matrices of the same sizes. With P the cyclic shift of
the contacts and random η,

    G' = Pᵀ G P,      c' = Pᵀ (c + G η),      η_i = s u_i ‖c_k‖ / α_i,      u_i uniform in [-1, 1],

for row i of contact k with the diagonal entry α_i of G, in other units. The shift of c lies in the range of G, so that
a problem with a solution keeps one also where its contacts are redundant. Contacts keep their neighbours, so that
memory is read as before.

``disguised_copy`` has rotated tangents too, G'' = Qᵀ G' Q and c'' = Qᵀ c', and a shift s so small that solvers need
about as many iterations, and so large that a stored answer does not solve it.
"""

import random
from dataclasses import replace

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.contact.transformations import Transformed, in_units, permuted, rotated

MASS_EXPONENTS = (2, 4, 6)
"""Even powers of two that m is drawn from, or their inverses."""

SPEED_EXPONENTS = tuple(range(1, 9))
"""Powers of two that s is drawn from, or their inverses."""

SHIFT = 0.2
"""s of a perturbed copy: its solution is no start for the problem, nor the other way round."""

SMALL_SHIFT = 0.02
"""Least s of a disguised copy."""

SHIFT_PER_TOLERANCE = 20.0
"""Ratio of s to the tolerance of a solve, where that gives more: an answer of the problem must fail on the copy."""


def in_other_units(problem: ContactProblem) -> Transformed:
    """Return the problem in units drawn at random, without name, provenance and answer."""
    draw = random.SystemRandom()
    speed, mass = (2.0 ** (draw.choice((1, -1)) * draw.choice(each)) for each in (SPEED_EXPONENTS, MASS_EXPONENTS))
    made = in_units(problem, mass=mass, length=1.0 / speed)
    return replace(made, problem=made.problem.anonymous())


def perturbed_copy(problem: ContactProblem, shift: float = SHIFT) -> ContactProblem:
    """Return another problem like this one, with a relative ``shift`` of c drawn at random, in other units."""
    rng = np.random.default_rng()
    velocity = problem.free_velocity + _random_velocity(problem, shift, rng)
    return in_other_units(_shifted(replace(problem.anonymous(), free_velocity=velocity), rng)).problem


def disguised_copy(problem: ContactProblem, tolerance: float) -> ContactProblem:
    """Return a problem that takes about as long to solve to a tolerance, and that no answer of the problem solves."""
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
    moved = shift * rng.uniform(-1.0, 1.0, size=problem.n_rows) * speeds[contact_of_row]
    np.divide(moved, alpha, out=eta, where=alpha > 0.0)
    velocity: FloatArray = problem.relative_velocity(eta) - problem.free_velocity
    return velocity
