"""Damping: the share z of De Saxcé's term ζ in the matrix of a Newton step, from 0 to 1.

The residuals always contain the whole term. With z = 1 the step is Newton's, which is fast but stagnates where the path
turns. With z = 0 the term is constant; each step is that of a convex cone program, and the method is De Saxcé's fixed
point, slow and safe. In between z adapts: a step that meets a boundary before one half reduces z, a step of more than
nine tenths increases it. If a step is short even with the smallest z, the reason is not a turn, and z returns to 1:
near a contact that neither opens nor closes strictly only Newton's step makes progress.
"""

from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray

Damping = Literal["none", "global", "contact"]

MIN_SHARE = 0.1
"""Smallest z."""

SHORT, LONG = 0.5, 0.9
"""Fractions of a step below and above which it is short or long."""

REDUCTION, GROWTH = 0.8, 1.1
"""Factors of z after a short and after a long step."""


class Undamped:
    """z = 1 always: Newton's method.

    Attributes:
        values: z of every contact, shape (n,).
    """

    def __init__(self, n_contacts: int) -> None:
        self.values: FloatArray = np.ones(n_contacts)

    def record(self, part: float, longest: FloatArray) -> None:
        """Record a step of length ``part``; ``longest``, shape (n,), is the longest step that each contact allows."""


class GlobalDamping(Undamped):
    """One z for all contacts, from the length of each step."""

    def record(self, part: float, longest: FloatArray) -> None:
        """See ``Undamped``."""
        self.values = _adapted(self.values, np.full_like(self.values, part))


class ContactDamping(Undamped):
    """A separate z for each contact, from the longest step that it allows."""

    def record(self, part: float, longest: FloatArray) -> None:
        """See ``Undamped``."""
        self.values = _adapted(self.values, longest)


def _adapted(values: FloatArray, parts: FloatArray) -> FloatArray:
    factor = np.where(parts < SHORT, REDUCTION, np.where(parts > LONG, GROWTH, 1.0))
    is_ineffective = (parts < SHORT) & (values == MIN_SHARE)
    adapted: FloatArray = np.where(is_ineffective, 1.0, np.clip(factor * values, MIN_SHARE, 1.0))
    return adapted


SHARES: dict[Damping, type[Undamped]] = {"none": Undamped, "global": GlobalDamping, "contact": ContactDamping}
"""Dampings by name; each takes the number of contacts."""
