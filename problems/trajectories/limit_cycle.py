"""The error of the woodpecker after one period of its limit cycle, from the section back to it."""

from ..mechanics.state import State
from ..scenes.woodpecker import DESCENT, section_start

RANGES = (0.01945, 0.47, 17.57)
"""What y [m], φ_S [rad] and its velocity [rad/s] range over in one period."""


def section_error(state: State) -> float:
    """Return the largest error of y, φ_S and its velocity after one period, each over its range in the cycle."""
    start = section_start()
    errors = (
        state.position[0] - start.position[0] + DESCENT,
        state.position[2] - start.position[2],
        state.velocity[2] - start.velocity[2],
    )
    return max(abs(float(error)) / reach for error, reach in zip(errors, RANGES, strict=True))
