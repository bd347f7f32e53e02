"""Problems that are like another one, so that a solver works on them as on that one, and remembers nothing of them.

In units of powers of two every floating-point operation gives the same digits, so that a solver takes the same steps to
the same impulses, though no number of the problem is what it was: G → m G, c → s c, Λ → (s/m) Λ, and moments of rolling
friction by a length more. The exponent of m is even, because roots of masses are taken.
"""

import random
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.catalog.storage import problem_bytes
from ....problems.contact.problem import ContactProblem
from ....problems.hard.transformations import in_units, permuted

MASS_EXPONENTS = (2, 4, 6)
"""Even powers of two that m is drawn from, or their inverses."""

SPEED_EXPONENTS = tuple(range(1, 9))
"""Powers of two that s is drawn from, or their inverses."""

LEAST_CHANGE, LARGEST_CHANGE = 0.5, 1.5
"""Range of the factors on the free velocities of contacts in ``another``."""


@dataclass(frozen=True)
class Variant:
    """A problem in other units.

    Attributes:
        problem: the problem, without name, provenance and answer.
        units: what its impulses are multiplied with to be those of the problem as it was, row by row, shape (n_rows,).
    """

    problem: ContactProblem
    units: FloatArray

    @cached_property
    def data(self) -> bytes:
        """The problem as the content of a file."""
        return problem_bytes(self.problem)


def in_other_units(problem: ContactProblem, number: int) -> Variant:
    """Return the problem in units drawn at random; as ``number`` is even or odd, its speeds are larger or smaller.

    A solver with a fixed tolerance in m/s works longer in the one and shorter in the other.
    """
    draw = random.SystemRandom()
    direction = 1 if number % 2 == 0 else -1
    speed = 2.0 ** (direction * draw.choice(SPEED_EXPONENTS))
    mass = 2.0 ** (draw.choice((1, -1)) * draw.choice(MASS_EXPONENTS))
    made = in_units(problem, mass=mass, length=1.0 / speed)
    return Variant(made.problem.anonymous(), made.back.diagonal())


def another(problem: ContactProblem) -> ContactProblem:
    """Return a problem of the same laws, sizes and sparsity, with contacts in another order and another solution.

    The free velocity of each contact is multiplied by a number of its own, and units are others.
    """
    rng = np.random.default_rng()
    other = permuted(problem.anonymous(), rng.permutation(problem.n_contacts)).problem
    factors: FloatArray = rng.uniform(LEAST_CHANGE, LARGEST_CHANGE, size=other.n_contacts)
    changed = replace(other, free_velocity=other.free_velocity * factors[other.layout.contact_of_row])
    return in_other_units(changed, int(rng.integers(2))).problem


@lru_cache(maxsize=4)
def first_variant(problem: ContactProblem) -> Variant:
    """Return the problem in other units, one for all cases of a problem."""
    return in_other_units(problem, 0)


@lru_cache(maxsize=4)
def another_data(problem: ContactProblem) -> bytes:
    """Return ``another`` as the content of a file, one for all cases of a problem."""
    return problem_bytes(another(problem))
