"""Contact states under given impulses (open, stick or slip) and their colours."""

from enum import IntEnum

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from ..report.charts.palette import rgb

OPEN_SHARE = 1e-6
"""Share of the largest normal impulse below which a contact is open. Interior-point iterates are never exactly zero."""

SLIP_SHARE = 1.0 - 1e-4
"""Share of the friction bound above which a contact slips."""

States = NDArray[np.uint16]
"""The ``ContactState`` of each contact, shape (n_contacts,)."""


class ContactState(IntEnum):
    """The state of a contact; a closed contact without friction slips."""

    OPEN = 0
    STICK = 1
    SLIP = 2


STATE_COLOURS = {ContactState.OPEN: "#8a8f98", ContactState.STICK: "#2fb6a8", ContactState.SLIP: "#ff9f1c"}
"""Colours of contacts by state."""


def contact_states(layout: BlockLayout, lanes: FloatArray) -> States:
    """Return the ``ContactState`` of every contact, shape (n_contacts,).

    A friction law without a unilateral law is never open, and a joint always sticks. Rolling friction is ignored.

    Args:
        layout: the contacts.
        lanes: Λ [N s], padded to shape (n_contacts, width), with or without rolling lanes. Infinite and NaN entries
            count as zero.
    """
    finite = np.where(np.isfinite(lanes), lanes, 0.0)
    normal = finite[:, 0]
    bound = layout.fixed_bound + layout.friction_coefficient * np.maximum(normal[layout.partner], 0.0)
    tangent = np.sqrt((finite[:, 1 : 1 + layout.sliding] ** 2).sum(axis=1))
    states = np.where(tangent >= SLIP_SHARE * bound, ContactState.SLIP, ContactState.STICK)
    has_normal = layout.normal_law >= 0
    is_closed = normal > OPEN_SHARE * normal.max(initial=0.0)
    states = np.where(has_normal & ~is_closed, ContactState.OPEN, states)
    return np.where(layout.is_bilateral, ContactState.STICK, states).astype(np.uint16)


def count_states(states: States) -> NDArray[np.int64]:
    """Return the numbers of open, sticking and slipping contacts, shape (3,)."""
    return np.bincount(states, minlength=len(ContactState))


def write_state_colours(stream: rr.RecordingStream, root: str) -> None:
    """Write the colours and names of contact states for the entities below ``root``."""
    annotations = [
        rr.AnnotationInfo(id=int(state), label=state.name.lower(), color=rgb(colour))
        for state, colour in STATE_COLOURS.items()
    ]
    stream.log(root, rr.AnnotationContext(annotations), static=True)
