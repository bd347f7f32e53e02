"""Colours and names of contact states, as the viewer takes them."""

import rerun as rr

from ..report.palette import rgb
from .contact_states import STATE_COLOURS


def write_state_colours(stream: rr.RecordingStream, root: str) -> None:
    """Give contacts under the entity ``root`` the colours and names of their states."""
    infos = [
        rr.AnnotationInfo(id=int(state), label=state.name.lower(), color=rgb(colour))
        for state, colour in STATE_COLOURS.items()
    ]
    stream.log(root, rr.AnnotationContext(infos), static=True)
