"""The state of a system at one instant."""

from dataclasses import dataclass, field

import numpy as np

from ..arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class State:
    """A system at one instant, with the impulses of the last step, from which the next solve starts.

    Attributes:
        time: t [s].
        position: q, shape (n_coordinates,).
        velocity: u, shape (n_dofs,).
        keys: contacts of the last step, ascending, shape (n_contacts,).
        impulses: their Λ [N s] after a step of ``Moreau``, their mean forces Λ/Δt [N] after one of a
            ``VariableStepper``, whose next step may be of another length; ``EventDriven`` stores neither. Rows are
            padded with zeros to as many as a contact may have, shape (n_contacts, width).
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    keys: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    impulses: FloatArray = field(default_factory=lambda: np.zeros((0, 1)))
