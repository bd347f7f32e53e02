"""The published limit cycle of the woodpecker, and the deviation of a state from it."""

from proxbench.problems.motion.scenes.woodpecker import DESCENT, section_start
from proxbench.problems.motion.state import State

SWITCH_EVENTS = (
    (0.005820757234809802, "unilateral", 2, "closed", "open"),
    (0.016709825280643503, "unilateral", 3, "open", "closed"),
    (0.016709825280643503, "unilateral", 3, "closed", "open"),
    (0.019811178939636433, "unilateral", 1, "open", "closed"),
    (0.019811178939636433, "unilateral", 1, "closed", "open"),
    (0.020390700477988667, "unilateral", 3, "open", "closed"),
    (0.022245391272032778, "unilateral", 3, "closed", "open"),
    (0.05753380196015821, "unilateral", 2, "open", "closed"),
    (0.05753380196015821, "unilateral", 2, "closed", "open"),
    (0.06026253599142089, "unilateral", 2, "open", "closed"),
    (0.10638265814428989, "friction", 2, "slip", "stick"),
    (0.14597606514375183, "friction", 2, "stick", "slip"),
)
"""Time after the section [s], law, contact from 1 on, before, after; computed with 45 digits. The paper's table 1
has the same twelve rows and begins with the last two."""

TIMES = [incident[0] for incident in SWITCH_EVENTS]


def section_error(state: State) -> float:
    """Largest error of y, φ_S and its velocity after one period, each over its range in the cycle."""
    start = section_start()
    return max(
        abs(state.position[0] - start.position[0] + DESCENT) / 0.01945,
        abs(state.position[2] - start.position[2]) / 0.47,
        abs(state.velocity[2] - start.velocity[2]) / 17.57,
    )
