"""Recordings of the woodpecker: pole, sleeve and bird as simple shapes, in the plane (x, z) of its motion."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ....problems.arrays import FloatArray
from ....problems.motion.scenes import woodpecker as toy
from ....problems.motion.state import State
from ....problems.motion.stepping.step import Step
from ...report.charts.palette import rgb
from ..blueprints import Camera, plot, space_view
from ..contact_states import States
from ..scene_recorder import BODIES, IMPULSES, NO_IMPULSES, Entities, SceneRecorder, arrows, step_size_plot
from .meshes import planar_orientation

WOOD, BRASS, FEATHERS = rgb("#b08a5b"), rgb("#d9b45b"), rgb("#2f6f8f")
CREST, BEAK, BELLY = rgb("#d94f3d"), rgb("#f0c75e"), rgb("#e9e2d0")
POLE_MARGIN = 0.06
"""Length of the pole above and below the path of the sleeve [m]."""

ARROW_LENGTH = 0.012
"""Length of the arrow of the toy's weight over ``REFERENCE_SECONDS`` [m]. Lengths grow with the square root
of the impulse."""

REFERENCE_SECONDS = 0.001
"""Time over which the weight of the toy gives the reference impulse of arrows [s]."""

FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Axes N and T of every contact; without friction, only N is used."""


class WoodpeckerRecorder(SceneRecorder):
    """Record the woodpecker; see ``SceneRecorder``."""

    _lowest, _highest = np.inf, -np.inf

    def _explanation(self) -> str:
        return (
            "A bird on a spring hops down a pole, held by a sleeve that jams and slips. Arrows show the impulses of "
            "beak and sleeve; **teal** contacts stick, **orange** ones slip. An arrow's length grows with the "
            "square root of its impulse."
        )

    def _views(self) -> Sequence[rrb.Spatial3DView]:
        height = float(self.scene.start.position[0])
        camera = Camera(np.array([0.012, -0.12, height + 0.012]), np.array([0.012, 0.0, height - 0.004]))
        return [space_view("woodpecker", camera, ["/scene/**"], tracking=f"/{BODIES}/sleeve")]

    def _plots(self) -> list[rrb.TimeSeriesView]:
        return [plot("angles [rad]", "/curves/angles"), *super()._plots(), step_size_plot()]

    def _scenery(self) -> Entities:
        return [
            *_sleeve(),
            *_bird(),
            (IMPULSES, rr.Arrows3D.from_fields(radii=[3e-4], show_labels=False)),
            (f"{BODIES}/spring", rr.LineStrips3D.from_fields(colors=[BRASS], radii=[2.5e-4])),
        ]

    def _bodies(self, state: State) -> Entities:
        height, sleeve, bird = state.position
        self._lowest, self._highest = min(self._lowest, float(height)), max(self._highest, float(height))
        centre = toy.bird_centre(state.position)
        foot = np.array([toy.SLEEVE_RADIUS, 0.0, height + sleeve * toy.SLEEVE_RADIUS])
        return [
            (f"{BODIES}/sleeve", _pose(np.array([0.0, 0.0, height]), sleeve)),
            (f"{BODIES}/bird", _pose(centre, bird)),
            (f"{BODIES}/spring", rr.LineStrips3D([_coil(foot, centre)])),
        ]

    def _impulses(self, step: Step, states: States | None) -> Entities:
        if step.contacts is None or states is None:
            return [(IMPULSES, NO_IMPULSES)]
        lanes = step.impulses.reshape(len(states), -1)
        vectors = lanes @ FRAME[: lanes.shape[1]]
        weight = (toy.BIRD_MASS + toy.SLEEVE_MASS) * toy.GRAVITY * REFERENCE_SECONDS
        points = toy.contact_points(step.state.position)[step.contacts.keys]
        return [(IMPULSES, arrows(vectors, points, states, ARROW_LENGTH, weight))]

    def _own_curves(self, state: State) -> dict[str, float]:
        return {"angles/sleeve": float(state.position[1]), "angles/bird": float(state.position[2])}

    def _summary(self) -> Entities:
        low, high = self._lowest - POLE_MARGIN, self._highest + POLE_MARGIN
        pole = rr.Cylinders3D(
            lengths=[high - low],
            radii=[toy.POLE_RADIUS],
            centers=[[0.0, 0.0, (low + high) / 2.0]],
            colors=[WOOD],
            fill_mode="solid",
        )
        return [("scene/pole", pole)]


def _pose(centre: FloatArray, angle: float) -> rr.Transform3D:
    """Return the pose of a body at ``centre`` [m], shape (3,), rotated by ``angle`` [rad] from x to z."""
    return rr.Transform3D(translation=centre, quaternion=rr.Quaternion(xyzw=planar_orientation(angle)))


def _coil(start: FloatArray, end: FloatArray, turns: int = 5, radius: float = 1.4e-3) -> FloatArray:
    """Return a spring between two points as a line, shape (n, 3)."""
    shares = np.linspace(0.0, 1.0, 16 * turns + 1)
    angle = 2.0 * np.pi * turns * shares
    amplitude = radius * np.minimum(1.0, 6.0 * np.minimum(shares, 1.0 - shares))
    coil: FloatArray = start + shares[:, None] * (end - start)
    coil[:, 1] += amplitude * np.cos(angle)
    coil[:, 2] += amplitude * np.sin(angle)
    return coil


def _sleeve() -> Entities:
    """Yield the sleeve, relative to its centre: rings around the pole."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    ring = toy.SLEEVE_RADIUS * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    heights = np.linspace(-toy.SLEEVE_HALF_HEIGHT, toy.SLEEVE_HALF_HEIGHT, 9)
    strips = [ring + np.array([0.0, 0.0, z]) for z in heights]
    yield f"{BODIES}/sleeve/rings", rr.LineStrips3D(strips, colors=[BRASS], radii=[5e-4])


def _bird() -> Entities:
    """Yield the bird, relative to its centre of mass, with its beak at (−BEAK_ARM, BEAK_HEIGHT)."""
    beak = np.array([-toy.BEAK_ARM, 0.0, toy.BEAK_HEIGHT])
    head = np.array([-0.0085, 0.0, 0.0165])
    shapes = rr.Ellipsoids3D(
        centers=[
            [0.0, 0.0, 0.0],
            [-0.0028, 0.0, -0.001],
            head,
            head + np.array([0.0012, 0.0, 0.0046]),
            head + np.array([-0.0032, -0.0043, 0.0012]),
        ],
        half_sizes=[
            [0.0062, 0.006, 0.0135],
            [0.0048, 0.0052, 0.0105],
            [0.0058, 0.0055, 0.0055],
            [0.0048, 0.0016, 0.0026],
            [0.0009] * 3,
        ],
        quaternions=[
            planar_orientation(0.35),
            planar_orientation(0.35),
            planar_orientation(0.0),
            planar_orientation(-0.3),
            planar_orientation(0.0),
        ],
        colors=[FEATHERS, BELLY, FEATHERS, CREST, (20, 20, 24)],
        fill_mode="solid",
    )
    yield f"{BODIES}/bird/body", shapes
    lines = [[head + np.array([-0.004, 0.0, 0.0]), beak], [[0.003, 0.0, -0.011], [0.0085, 0.0, -0.024]]]
    yield f"{BODIES}/bird/details", rr.LineStrips3D(lines, colors=[BEAK, FEATHERS], radii=[7e-4, 1.5e-3])
