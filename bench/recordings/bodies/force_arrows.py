"""Arrows for the forces of a simulation, scaled so that most of them are legible."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....problems.arrays import FloatArray
from ..contact_states import States

REFERENCE_QUANTILE, REFERENCE_LENGTH, MAX_RATIO = 0.9, 0.6, 4.0
"""The reference force is this quantile of all forces; its arrow has this length in bounding radii of its body. Lengths
grow with the square root of the force, up to ``MAX_RATIO`` times the reference, so that arrows of impacts do not cover
other arrows."""

NO_FORCES = (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=np.uint16))
"""Arguments of ``ForceArrows.add`` for a step without forces."""


@dataclass(frozen=True, eq=False)
class _StepForces:
    """Arguments of ``ForceArrows.add`` for one step."""

    number: int
    vectors: FloatArray
    points: FloatArray
    radii: FloatArray
    states: States


class ForceArrows:
    """Forces of all steps, and the arrows that show them."""

    def __init__(self) -> None:
        self._steps: list[_StepForces] = []

    def add(self, number: int, vectors: FloatArray, points: FloatArray, radii: FloatArray, states: States) -> None:
        """Add the forces of a step.

        Args:
            number: number of the step.
            vectors: forces at contacts, then those of joints [N], shape (n, 3).
            points: points where they act [m], shape (n, 3).
            radii: bounding radii of the bodies on which they act [m], shape (n,).
            states: states of the contacts, shape (n_contacts,).
        """
        self._steps.append(_StepForces(number, vectors, points, radii, states))

    @property
    def reference(self) -> float | None:
        """The force [N] whose arrow has the length ``REFERENCE_LENGTH``; None without forces."""
        magnitudes = np.concatenate([np.zeros(0), *(np.linalg.norm(step.vectors, axis=1) for step in self._steps)])
        acting = magnitudes[magnitudes > 0.0]
        return float(np.quantile(acting, REFERENCE_QUANTILE)) if len(acting) else None

    @property
    def explanation(self) -> str:
        """A sentence that explains the lengths of arrows; empty without forces."""
        if self.reference is None:
            return ""
        force = float(f"{self.reference:.2g}")
        return (
            f" The length of an arrow grows with the square root of the force: {REFERENCE_LENGTH:g} radii of the body "
            f"for {force:g} N, and at most twice that, from {MAX_RATIO * force:g} N on."
        )

    def arrows(self) -> Iterator[tuple[int, FloatArray, FloatArray, States]]:
        """Yield for each step its number, arrows [m], their origins [m], and the states of its contacts."""
        reference = self.reference or 1.0
        for step in self._steps:
            size = np.linalg.norm(step.vectors, axis=1)
            lengths = REFERENCE_LENGTH * step.radii * np.sqrt(np.minimum(size / reference, MAX_RATIO))
            yield step.number, step.vectors * (lengths / np.maximum(size, 1e-300))[:, None], step.points, step.states
