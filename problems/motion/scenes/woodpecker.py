"""The woodpecker toy: a bird on a spring, hopping down a pole (Glocker 1995; Leine, Glocker & van Campen 2001).

q = (y, φ_M, φ_S): height of the sleeve [m], angle of the sleeve, angle of the bird [rad]. Contact 1 is
the beak on the pole, 2 the lower edge of the sleeve, and 3 its upper edge. All contacts are planar, with rows N and T.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...arrays import FloatArray
from ..bodies.system import MechanicalSystem
from ..state import State
from ..trajectories.limit_cycle import KnownCycle, SwitchEvent
from .options import Option
from .scene import Scene, SceneKind, StudyDefaults, kinetic_energy

SLEEVE_MASS, SLEEVE_INERTIA = 3e-4, 5e-9
"""Mass [kg] and moment of inertia [kg m²] of the sleeve."""

BIRD_MASS, BIRD_INERTIA = 4.5e-3, 7e-7
"""Mass [kg] and moment of inertia [kg m²] of the bird."""

POLE_RADIUS, SLEEVE_RADIUS, SLEEVE_HALF_HEIGHT = 2.5e-3, 3.1e-3, 5.8e-3
"""Radius of the pole, and radius and half the height of the sleeve [m]."""

SPRING_ARM, BIRD_ARM = 1e-2, 1.5e-2
"""Distance of the spring from the axis of the pole, and of the centre of the bird from the spring [m]."""

BEAK_HEIGHT, BEAK_ARM = 2e-2, 2.01e-2
"""Height of the beak above the centre of the bird, and its horizontal distance from the centre [m]."""

SPRING_STIFFNESS, GRAVITY = 5.6e-3, 9.81
"""Stiffness of the spring [N m/rad], and default gravitational acceleration [m/s²]."""

FRICTION = 0.3
"""Default μ of all contacts."""

RESTITUTION = (0.5, 0.0, 0.0)
"""Default ε_N of beak, lower edge and upper edge."""

PERIOD = 0.14597606514375183
"""Duration of one limit cycle [s], computed event by event in 45-digit arithmetic."""

DESCENT = 0.019445379284716507
"""Descent in one limit cycle [m]."""

SWITCH_EVENTS = (
    SwitchEvent(-0.03959340699946194, "friction", 1, "slip", "stick"),
    SwitchEvent(0.0, "friction", 1, "stick", "slip"),
    SwitchEvent(0.005820757234809802, "unilateral", 1, "closed", "open"),
    SwitchEvent(0.016709825280643503, "unilateral", 2, "open", "closed"),
    SwitchEvent(0.016709825280643503, "unilateral", 2, "closed", "open"),
    SwitchEvent(0.019811178939636433, "unilateral", 0, "open", "closed"),
    SwitchEvent(0.019811178939636433, "unilateral", 0, "closed", "open"),
    SwitchEvent(0.020390700477988667, "unilateral", 2, "open", "closed"),
    SwitchEvent(0.022245391272032778, "unilateral", 2, "closed", "open"),
    SwitchEvent(0.05753380196015821, "unilateral", 1, "open", "closed"),
    SwitchEvent(0.05753380196015821, "unilateral", 1, "closed", "open"),
    SwitchEvent(0.06026253599142089, "unilateral", 1, "open", "closed"),
)
"""Switching points of one limit cycle in the order of table 1 of Studer & Glocker (2005), with times after the section
[s], computed event by event in 45-digit arithmetic."""

CONTACT_NAMES = ("beak", "lower edge", "upper edge")
"""Names of the contacts by key (the paper counts contacts from 1); the edges belong to the sleeve."""

RANGES = (0.01945, 0.47, 17.57)
"""Ranges of y [m], φ_S [rad] and its velocity [rad/s] in one period."""

OVERLAP = 1e-12
"""Initial depth [m] at which rounding cannot open a closed contact; this depth rotates the sleeve by 2e-10 rad."""

_MASS = np.array(
    [
        [BIRD_MASS + SLEEVE_MASS, BIRD_MASS * SPRING_ARM, BIRD_MASS * BIRD_ARM],
        [BIRD_MASS * SPRING_ARM, SLEEVE_INERTIA + BIRD_MASS * SPRING_ARM**2, BIRD_MASS * SPRING_ARM * BIRD_ARM],
        [BIRD_MASS * BIRD_ARM, BIRD_MASS * SPRING_ARM * BIRD_ARM, BIRD_INERTIA + BIRD_MASS * BIRD_ARM**2],
    ]
)

_DIRECTIONS = np.array(
    [
        [0.0, 1.0, 0.0, 1.0, 0.0, 1.0],
        [0.0, SPRING_ARM, SLEEVE_HALF_HEIGHT, SLEEVE_RADIUS, -SLEEVE_HALF_HEIGHT, SLEEVE_RADIUS],
        [-BEAK_HEIGHT, BIRD_ARM - BEAK_ARM, 0.0, 0.0, 0.0, 0.0],
    ]
)
"""W, columns N1, T1, N2, T2, N3, T3."""


def _gap(position: FloatArray) -> FloatArray:
    play, tilt = SLEEVE_RADIUS - POLE_RADIUS, SLEEVE_HALF_HEIGHT * position[1]
    beak = SPRING_ARM + BIRD_ARM - BEAK_ARM - POLE_RADIUS - BEAK_HEIGHT * position[2]
    return np.array([beak, play + tilt, play - tilt])


def bird_centre(position: FloatArray) -> FloatArray:
    """Return the bird's centre of mass (x, y, z) [m], with z upwards and the motion in the plane y = 0, shape (3,).

    Its height is linear in the angles, as in the equations of motion; q has shape (3,).
    """
    height = position[0] + SPRING_ARM * position[1] + BIRD_ARM * position[2]
    return np.array([SPRING_ARM + BIRD_ARM, 0.0, height])


def contact_points(position: FloatArray) -> FloatArray:
    """Return the points of the pole at the heights of beak, lower edge and upper edge [m], shape (3, 3).

    The gradients of the heights are the columns T of W; axes are those of ``bird_centre``, and q has shape (3,).
    """
    height, sleeve, bird = position
    beak = height + SPRING_ARM * sleeve + (BIRD_ARM - BEAK_ARM) * bird + BEAK_HEIGHT
    middle, edge = height + SLEEVE_RADIUS * sleeve, SLEEVE_HALF_HEIGHT
    return np.array([[POLE_RADIUS, 0.0, z] for z in (beak, middle - edge, middle + edge)])


def woodpecker(
    friction: float | None = FRICTION, beak_restitution: float = RESTITUTION[0], gravity: float = GRAVITY
) -> MechanicalSystem:
    """Return the woodpecker's equations of motion.

    Args:
        friction: μ of all contacts; if None, contacts have one row and no friction.
        beak_restitution: ε_N of the beak; ε_N of the edges of the sleeve is 0.
        gravity: g [m/s²].

    Raises:
        ProblemError: if a coefficient is out of range.
    """

    def force(position: FloatArray, velocity: FloatArray) -> FloatArray:
        spring = SPRING_STIFFNESS * (position[1] - position[2])
        bird_weight = BIRD_MASS * gravity
        total_weight = (BIRD_MASS + SLEEVE_MASS) * gravity
        return np.array([-total_weight, -spring - bird_weight * SPRING_ARM, spring - bird_weight * BIRD_ARM])

    directions = _DIRECTIONS if friction is not None else _DIRECTIONS[:, ::2]
    return MechanicalSystem(
        mass=lambda position: _MASS,
        force=force,
        gap=_gap,
        directions=lambda position: directions,
        friction=np.full(3, friction or 0.0),
        restitution_normal=(beak_restitution, *RESTITUTION[1:]),
        restitution_tangential=np.zeros(3),
        rows_per_contact=1 if friction is None else 2,
        is_reversible=True,
    )


def potential_energy(position: FloatArray, gravity: float = GRAVITY) -> float:
    """Return V(q) [J] of the weight and the spring; q has shape (3,)."""
    height, sleeve, bird = position
    weight = (BIRD_MASS + SLEEVE_MASS) * height + BIRD_MASS * (SPRING_ARM * sleeve + BIRD_ARM * bird)
    return float(gravity * weight + 0.5 * SPRING_STIFFNESS * (sleeve - bird) ** 2)


def published_start() -> State:
    """Return the initial state from the literature; after some periods, the motion reaches the limit cycle."""
    return State(0.0, np.array([0.0, -0.1036, -0.2788]), np.array([-0.3411, 0.0, -7.4583]))


def section_start(overlap: float = 0.0) -> State:
    """Return the state of the limit cycle in which the lower edge of the sleeve begins to slip.

    Args:
        overlap: depth [m] of the lower edge in the pole. At 0, rounding of the gap determines whether the first steps
            detect a closed contact; with ``OVERLAP`` they always do.
    """
    sleeve_angle = -(SLEEVE_RADIUS - POLE_RADIUS + overlap) / SLEEVE_HALF_HEIGHT
    return State(0.0, np.array([0.0, sleeve_angle, -0.20513534924352575]), np.array([0.0, 0.0, 17.574666205576078]))


def section_error(state: State) -> float:
    """Return the largest error of y, φ_S and its velocity after one period, each relative to its range in the cycle."""
    start = section_start()
    errors = (
        state.position[0] - start.position[0] + DESCENT,
        state.position[2] - start.position[2],
        state.velocity[2] - start.velocity[2],
    )
    return max(abs(float(error)) / extent for error, extent in zip(errors, RANGES, strict=True))


LIMIT_CYCLE = KnownCycle(
    PERIOD,
    DESCENT,
    SWITCH_EVENTS,
    section=1,
    section_error=section_error,
    source="table 1 of the paper",
    transient=60,  # the deviation is multiplied by 0.839 in each period, and by 3e-5 in 60 periods
)
"""The limit cycle; at its section the lower edge of the sleeve begins to slip."""


def _build(name: str, options: Mapping[str, Any]) -> Scene:
    gravity = options["gravity"] or 0.0
    system = woodpecker(options["friction"], options["restitution"] or 0.0, gravity)
    start = published_start() if options["start"] == "published" else section_start(OVERLAP)
    is_default = all(options[key] == option.default for key, option in _OPTIONS.items() if key != "start")
    return Scene(
        name,
        options,
        system,
        start,
        length=POLE_RADIUS,
        step_size=2e-5,
        duration=1.0,
        kinetic_energy=kinetic_energy(system, start),
        potential_energy=lambda position: potential_energy(position, gravity),
        coordinates={"sleeve angle [rad]": 1, "bird angle [rad]": 2, "sleeve height [m]": 0},
        has_few_contacts=True,
        contact_names=CONTACT_NAMES,
        limit_cycle=replace(LIMIT_CYCLE, matches_scene_options=is_default),
        view="woodpecker",
    )


_OPTIONS = {
    "gravity": Option(GRAVITY, "gravitational acceleration [m/s²]", can_be_off=True),
    "friction": Option(FRICTION, "friction coefficient; off: no friction laws", can_be_off=True),
    "restitution": Option(RESTITUTION[0], "normal restitution of the beak", highest=1.0, can_be_off=True),
    "start": Option("published", "initial state", choices=("published", "cycle")),
}

WOODPECKER = SceneKind(
    "the woodpecker toy, hopping down its pole",
    _OPTIONS,
    _build,
    StudyDefaults({"start": "cycle"}, duration=PERIOD, is_limit_cycle=True),
)
"""The scene ``woodpecker``."""
