"""Other presentations of a problem, on which an honest solver works as on the problem itself.

``in_other_units`` changes every number and no step: with powers of two, G → m G, c → s c, Λ → (s/m) Λ leave the digits
of every floating-point operation as they are (moments of rolling friction change by a length more). The exponent of m
is even, because solvers take roots of masses.

``turned_copy`` is the same problem to a person: with P the cyclic shift of the contacts and Q the rotation of the
tangents,

    G' = QᵀPᵀ G P Q,      c' = QᵀPᵀ c,

in other units. Contacts keep their neighbours, so that memory is read as before.

``moved_copy`` is another problem as hard as this one, with matrices of the same sizes. With random η,

    G' = Pᵀ G P,      c' = Pᵀ (c + G η),      η_i = SHIFT u_i ‖c_k‖ / α_i,      u_i uniform in [-1, 1],

for row i of contact k with the diagonal entry α_i of G. The shift of c lies in the range of G, so that a problem with a
solution keeps one also where its contacts are redundant.
"""

import random
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.exchange.storage import problem_bytes
from ....problems.hard.transformations import in_units, permuted, rotated

MASS_EXPONENTS = (2, 4, 6)
"""Even powers of two that m is drawn from, or their inverses."""

SPEED_EXPONENTS = tuple(range(1, 9))
"""Powers of two that s is drawn from, or their inverses."""

SHIFT = 0.2
"""How far the solution of a moved copy is from that of the problem: no help to whoever remembers either."""


@dataclass(frozen=True)
class Variant:
    """A problem in other units.

    Attributes:
        problem: the problem, without name, provenance and answer.
        units: factor of each of its impulses that gives those of the original problem, shape (n_rows,).
    """

    problem: ContactProblem
    units: FloatArray

    @cached_property
    def data(self) -> bytes:
        """The problem as the content of a file."""
        return problem_bytes(self.problem)


def in_other_units(problem: ContactProblem) -> Variant:
    """Return the problem in units drawn at random."""
    draw = random.SystemRandom()
    speed, mass = (2.0 ** (draw.choice((1, -1)) * draw.choice(each)) for each in (SPEED_EXPONENTS, MASS_EXPONENTS))
    made = in_units(problem, mass=mass, length=1.0 / speed)
    return Variant(made.problem.anonymous(), made.back.diagonal())


def turned_copy(problem: ContactProblem) -> ContactProblem:
    """Return the problem with its contacts shifted, its tangents rotated, and in other units, each drawn at random."""
    rng = np.random.default_rng()
    turned = rotated(problem.anonymous(), rng.uniform(0.0, 2.0 * np.pi, size=problem.laws.n_laws)).problem
    return in_other_units(_shifted(turned, rng)).problem


def moved_copy(problem: ContactProblem) -> ContactProblem:
    """Return another problem like this one, drawn at random, in other units."""
    rng = np.random.default_rng()
    velocity = problem.free_velocity + _random_velocity(problem, rng)
    return in_other_units(_shifted(replace(problem.anonymous(), free_velocity=velocity), rng)).problem


def _shifted(problem: ContactProblem, rng: np.random.Generator) -> ContactProblem:
    """Return the problem with its contacts shifted cyclically."""
    count = problem.n_contacts
    return permuted(problem, np.roll(np.arange(count), int(rng.integers(max(count, 1))))).problem


def _random_velocity(problem: ContactProblem, rng: np.random.Generator) -> FloatArray:
    """Return G η, shape (n_rows,)."""
    alpha, contact_of_row = problem.delassus_diagonal, problem.layout.contact_of_row
    speeds = np.zeros(problem.n_contacts)
    np.maximum.at(speeds, contact_of_row, np.abs(problem.free_velocity))
    eta = np.zeros(problem.n_rows)
    moved = SHIFT * rng.uniform(-1.0, 1.0, size=problem.n_rows) * speeds[contact_of_row]
    np.divide(moved, alpha, out=eta, where=alpha > 0.0)
    velocity: FloatArray = problem.relative_velocity(eta) - problem.free_velocity
    return velocity
