"""The scenes on which engines are compared, with their exact answers.

======================= ======================================================= ==================================
scene                   bodies                                                  exact answer
======================= ======================================================= ==================================
``thrown-cube``         a cube at 6 m/s on a floor, μ = 0.5                     v = 6 m/s − μ g t, lift 0
``incline-slide``       a cube on a slope, tan θ = 0.6, μ = 0.5                 a = g (sin θ − μ cos θ), lift 0
``incline-rest``        a cube on a slope, tan θ = 0.4, μ = 0.5                 rests
``stack``               cubes of 1, 10 and 100 kg, the light one below          rests, penetration 0
``pile``                100 balls, which fall into a closed funnel              rest in the end, overlap 0
``funnel``              250 balls, which pour through a funnel                  overlap 0; energy never grows
======================= ======================================================= ==================================

A sliding cube with μ < 1 does not topple, because the supporting force acts μ/2 edge lengths ahead of its centre.
The solution of a cone program, whose velocity lies in the dual cone, instead throws the cube up: v_N = μ ‖v_T‖ with
‖v_T‖ = v − μ v_N gives v_N = μ v/(1 + μ²), here a rise of v_N²/(2g) = 293.6 mm.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from .....problems.arrays import FloatArray
from .....problems.motion.scenes.funnel import CONE_HEIGHT, MASS, RADIUS, STANDARD_EFFECTS, STANDARD_GRAVITY, Funnel
from .....problems.motion.scenes.scene import OVERLAP
from .description import Body, Description, Motion, Panel

THROW_SPEED, SLIDING_FRICTION = 6.0, 0.5
"""Initial speed of the thrown cube [m/s], and friction coefficient of the scenes of one cube."""

HALF_EDGE, CUBE_MASS = 0.1, 8.0
"""Half the edge length [m] and mass [kg] of the cube of these scenes."""

FACETS = 32
"""Number of flat panels around a funnel."""

WALL_HEIGHT, PANEL_THICKNESS = 0.5, 0.05
"""Height of the wall above a funnel, and thickness of its panels [m]."""

SETTLED_SECONDS = 0.1
"""Time at the end of a pile over which its overlap is measured [s]."""


def describe(name: str) -> Description:
    """Return a scene by its name.

    Raises:
        KeyError: if the name is not in ``SCENES``.
    """
    return SCENES[name]()


def _thrown_cube() -> Description:
    cube = Body(True, HALF_EDGE, CUBE_MASS, (0.0, 0.0, HALF_EDGE), (THROW_SPEED, 0.0, 0.0))
    errors = ("lift [mm]", "speed [%]")
    options = {"speed": THROW_SPEED}
    return _cube_scene("thrown-cube", (cube,), SLIDING_FRICTION, 1.0, errors, _measure_throw, "thrown_box", options)


def _measure_throw(scene: Description, motion: Motion) -> tuple[float, ...]:
    """Return the largest rise of the centre [mm], and the error of the final speed relative to the initial one [%]."""
    exact = THROW_SPEED - SLIDING_FRICTION * STANDARD_GRAVITY * motion.times[-1]
    return _lift(motion), 100.0 * abs(motion.velocities[-1, 0, 0] - exact) / THROW_SPEED


def _incline(name: str, slope: float) -> Description:
    """Return a cube on an incline of the given slope tan θ, on which it slides or rests."""
    angle = np.arctan(slope)
    cube = Body(True, HALF_EDGE, CUBE_MASS, (0.0, 0.0, HALF_EDGE))
    gravity = (STANDARD_GRAVITY * float(np.sin(angle)), 0.0, -STANDARD_GRAVITY * float(np.cos(angle)))
    slides = slope > SLIDING_FRICTION
    errors = ("distance [%]" if slides else "drift [mm]", "lift [mm]")
    measure = _measure_slide if slides else _measure_drift
    options = {"slope": float(angle)}
    return _cube_scene(
        name, (cube,), SLIDING_FRICTION, 1.0, errors, measure, "box_on_incline", options, gravity=gravity
    )


def _measure_slide(scene: Description, motion: Motion) -> tuple[float, ...]:
    """Return the relative error of the distance a t²/2 [%], and the largest rise of the centre [mm]."""
    acceleration = scene.gravity[0] + scene.friction * scene.gravity[2]
    exact = 0.5 * acceleration * motion.times[-1] ** 2
    distance = motion.positions[-1, 0, 0] - motion.positions[0, 0, 0]
    return 100.0 * abs(distance - exact) / exact, _lift(motion)


def _measure_drift(scene: Description, motion: Motion) -> tuple[float, ...]:
    """Return the largest displacement of a resting cube in the plane of its slope [mm], and its largest rise [mm]."""
    return _drift(motion), _lift(motion)


def _stack() -> Description:
    cubes = tuple(Body(True, 0.25, mass, (0.0, 0.0, 0.25 + 0.5 * k)) for k, mass in enumerate((1.0, 10.0, 100.0)))
    errors = ("penetration [mm]", "drift [mm]", "last speed [mm/s]", "energy gained [m g L]")
    options = {"n_boxes": len(cubes), "ratio": 100.0, "heavy_on_top": True}
    return _cube_scene("stack", cubes, 0.7, 2.0, errors, _measure_stack, "box_stack", options)


def _measure_stack(scene: Description, motion: Motion) -> tuple[float, ...]:
    """Return the largest penetration [mm], drift [mm] and final speed [mm/s], and the energy gained [m g L]."""
    heights = motion.positions[:, :, 2]
    half = scene.bodies[0].half_size
    gaps = np.diff(heights, axis=1, prepend=-half) - 2.0 * half  # as if a cube lay below the floor at height 0
    penetration, speed = -1e3 * min(0.0, float(gaps.min())), 1e3 * float(_speeds(motion)[-1].max())
    return penetration, _drift(motion), speed, scene.energy_gained(motion)


def _pile() -> Description:
    errors = ("overlap [r]", "last energy [m g r]", "energy gained [m g r]")
    return _ball_scene("pile", 100, 0.0, 1.5, errors, _measure_pile)


def _measure_pile(scene: Description, motion: Motion) -> tuple[float, ...]:
    """Return the overlap of balls at the end [r], the final kinetic energy per ball and the energy gained [m g r]."""
    settled = motion.positions[motion.times > motion.times[-1] - SETTLED_SECONDS]
    kinetic = 0.5 * float((_speeds(motion)[-1] ** 2).mean()) / (STANDARD_GRAVITY * scene.length)
    return max(deepest_overlap(scene, frame) for frame in settled), kinetic, scene.energy_gained(motion)


def pour(balls: int) -> Description:
    """Return the scene ``funnel`` with a number of balls."""
    errors = ("overlap [r]", "energy gained [m g r]", "balls through")
    return _ball_scene("funnel", balls, 4.5, 0.6, errors, _measure_funnel)


def _measure_funnel(scene: Description, motion: Motion) -> tuple[float, ...]:
    """Return the largest overlap of balls [r], the energy gained [m g r], and the number of balls below the outlet."""
    overlap = max(deepest_overlap(scene, frame) for frame in motion.positions)
    return overlap, scene.energy_gained(motion), float(np.count_nonzero(motion.positions[-1, :, 2] < 0.0))


def _cube_scene(
    name: str,
    cubes: tuple[Body, ...],
    friction: float,
    duration: float,
    errors: tuple[str, ...],
    measure: Callable[[Description, Motion], tuple[float, ...]],
    own_scene: str,
    own_options: dict[str, Any],
    gravity: tuple[float, float, float] = (0.0, 0.0, -STANDARD_GRAVITY),
) -> Description:
    """Return a scene of cubes of one size; its own options get the overlap, size, mass and friction of the cubes."""
    edge = 2.0 * cubes[0].half_size
    common = {"overlap": OVERLAP, "size": (edge, edge, edge), "mass": cubes[0].mass, "friction": friction}
    own = (own_scene, own_options | common)
    return Description(name, cubes, friction, duration, 2e-3, 0.02, edge, errors, 0.01, measure, *own, gravity=gravity)


def _ball_scene(
    name: str,
    count: int,
    outlet: float,
    duration: float,
    errors: tuple[str, ...],
    measure: Callable[[Description, Motion], tuple[float, ...]],
) -> Description:
    """Return a scene of balls that start as in Proxbench's scene of that name, in a funnel of flat panels."""
    start = Funnel(count, STANDARD_EFFECTS, outlet).start()
    velocities = start.velocity.reshape(count, -1)[:, :3]
    centres = start.position.reshape(count, 3)
    balls = tuple(
        Body(False, RADIUS, MASS, tuple(map(float, x)), tuple(map(float, v)))  # type: ignore[arg-type]
        for x, v in zip(centres, velocities, strict=True)
    )
    own = (name, {"balls": count, "restitution": 0.0})
    return Description(
        name, balls, 0.3, duration, 1e-3, 0.01, RADIUS, errors, 1e-3, measure, *own, _panels(), not outlet
    )


def _panels() -> tuple[Panel, ...]:
    """Return the cone of 45° and the wall above it, each of ``FACETS`` boxes that touch the round funnel from outside.

    Below its top, a box is wider than its facet; the excess lies behind the adjacent boxes.
    """
    outlet = 4.5 * RADIUS
    top = outlet + CONE_HEIGHT
    width = top * float(np.tan(np.pi / FACETS)) + PANEL_THICKNESS
    up = np.array([0.0, 0.0, 1.0])
    panels = []
    for angle in 2.0 * np.pi * np.arange(FACETS) / FACETS:
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])
        for lower, along, length in (
            (outlet * outward, (outward + up) * np.sqrt(0.5), CONE_HEIGHT * np.sqrt(2.0)),
            (top * outward + CONE_HEIGHT * up, up, WALL_HEIGHT),
        ):
            across = np.cross(up, outward)
            inward = np.cross(along, across)
            centre = lower + 0.5 * length * along - 0.5 * PANEL_THICKNESS * inward
            half = (0.5 * float(length), width, 0.5 * PANEL_THICKNESS)
            panels.append(Panel(centre, half, np.column_stack([along, across, inward])))
    return tuple(panels)


def _lift(motion: Motion) -> float:
    """Return the largest rise of a centre above its start [mm]."""
    return 1e3 * float((motion.positions[:, :, 2] - motion.positions[0, :, 2]).max())


def _drift(motion: Motion) -> float:
    """Return the largest displacement of a centre from its start, parallel to the floor [mm]."""
    displacements = motion.positions[:, :, :2] - motion.positions[0, :, :2]
    return 1e3 * float(np.linalg.norm(displacements, axis=2).max())


def _speeds(motion: Motion) -> FloatArray:
    """Return the speeds of all centres [m/s], shape (n_frames, n_bodies)."""
    speeds: FloatArray = np.linalg.norm(motion.velocities, axis=2)
    return speeds


def deepest_overlap(scene: Description, centres: FloatArray) -> float:
    """Return the largest overlap of two balls, in radii; walls are ignored, because the funnels differ."""
    from scipy.spatial import cKDTree

    distances = np.asarray(cKDTree(centres).query(centres, k=2)[0])  # the nearest centre is a ball's own
    return max(0.0, 2.0 - float(distances[:, 1].min()) / scene.length)


SCENES: dict[str, Callable[[], Description]] = {
    "thrown-cube": cache(_thrown_cube),
    "incline-slide": lambda: _incline("incline-slide", 0.6),
    "incline-rest": lambda: _incline("incline-rest", 0.4),
    "stack": cache(_stack),
    "pile": cache(_pile),
    "funnel": cache(lambda: pour(250)),
}
"""Functions that describe the scenes, by name."""
