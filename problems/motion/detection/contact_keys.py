"""Keys of contacts: one integer for two bodies and a feature, the same in all steps."""

from dataclasses import dataclass

import numpy as np

from ...arrays import IntArray
from ...errors import ProblemError


@dataclass(frozen=True)
class ContactKeys:
    """Keys of contacts between pairs of bodies, which may touch at several features.

    Keys ascend by the first body, then the second one, then the feature: key = (i · n_bodies + j) · n_features + f. Two
    balls, or a ball and a surface, touch at one feature; faces touch at several, one per corner of the area of contact.

    Attributes:
        n_bodies: number of bodies, including fixed ones.
        n_features: largest number of features of a pair.

    Raises:
        ProblemError: if a number is not positive, or keys do not fit into 63 bits.
    """

    n_bodies: int
    n_features: int = 1

    def __post_init__(self) -> None:
        if self.n_bodies < 1 or self.n_features < 1 or self.n_bodies**2 * self.n_features >= 2**63:
            raise ProblemError(
                f"the numbers of bodies and features must be positive, and their keys fit into 63 bits; got "
                f"{self.n_bodies} bodies with {self.n_features} features."
            )

    def encode(self, first: IntArray, second: IntArray, feature: IntArray | int = 0) -> IntArray:
        """Return the keys of contacts, shape (n_contacts,)."""
        return (first * self.n_bodies + second) * self.n_features + feature

    def decode(self, keys: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Return first bodies, second bodies and features, each of shape (n_contacts,)."""
        pairs, feature = np.divmod(keys, self.n_features)
        first, second = np.divmod(pairs, self.n_bodies)
        return first, second, feature

    def pairs(self, keys: IntArray) -> IntArray:
        """Return i · n_bodies + j of the pair of bodies of each contact, shape (n_contacts,)."""
        return keys // self.n_features
