"""How much of De Saxcé's term enters the matrix of a Newton step: the share z of ζ, from 0 to 1.

The residuals always hold all of it. With z = 1 the step is Newton's, which is fast, and stands still where the path
turns; z = 0 leaves the term where it is, which makes each step that of a convex cone program and the whole De Saxcé's
fixed point, slow and safe. In between z follows the steps: one that meets a boundary before half of it reduces z, one
of more than nine tenths raises it again. Where even the least z leaves a step short, it is not the turn that is met,
and z goes back to 1: near a contact that neither opens nor closes strictly only Newton's step goes on.
"""

from collections.abc import Callable
from typing import Literal, Protocol

import numpy as np

from ...problems.arrays import FloatArray

Damping = Literal["none", "global", "contact"]

LEAST_SHARE = 0.1
"""z is never reduced below it."""

SHORT, LONG = 0.5, 0.9
"""Parts of a step that count as short and as long."""

REDUCTION, GROWTH = 0.8, 1.1
"""What z is multiplied with after a short and after a long step."""


class Share(Protocol):
    """The shares of one solve."""

    @property
    def values(self) -> FloatArray:
        """Z of every contact, shape (n,)."""
        ...

    def note(self, part: float, longest: FloatArray) -> None:
        """Note that ``part`` of a step was done, of which each contact could have gone ``longest``, shape (n,)."""
        ...


class Undamped:
    """z = 1 throughout: Newton's method."""

    def __init__(self, n_contacts: int) -> None:
        self.values: FloatArray = np.ones(n_contacts)

    def note(self, part: float, longest: FloatArray) -> None:
        """See ``Share``."""


class GlobalDamping:
    """One z for all contacts, by the part of each step that was done."""

    def __init__(self, n_contacts: int) -> None:
        self.values: FloatArray = np.ones(n_contacts)

    def note(self, part: float, longest: FloatArray) -> None:
        """See ``Share``."""
        self.values = _adapted(self.values, np.full_like(self.values, part))


class ContactDamping:
    """A z of its own for each contact, by how far that contact could have gone."""

    def __init__(self, n_contacts: int) -> None:
        self.values: FloatArray = np.ones(n_contacts)

    def note(self, part: float, longest: FloatArray) -> None:
        """See ``Share``."""
        self.values = _adapted(self.values, longest)


def _adapted(values: FloatArray, parts: FloatArray) -> FloatArray:
    factor = np.where(parts < SHORT, REDUCTION, np.where(parts > LONG, GROWTH, 1.0))
    is_in_vain = (parts < SHORT) & (values == LEAST_SHARE)
    adapted: FloatArray = np.where(is_in_vain, 1.0, np.clip(factor * values, LEAST_SHARE, 1.0))
    return adapted


SHARES: dict[Damping, Callable[[int], Share]] = {
    "none": Undamped,
    "global": GlobalDamping,
    "contact": ContactDamping,
}
"""By name; each is made from the number of contacts."""
