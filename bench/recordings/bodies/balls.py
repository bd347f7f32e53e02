"""Recordings of balls: rotating balls, surfaces, and the impulses at contacts."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.matrices.pieces import Pieces
from ....problems.motion.scenes.scene import Scene
from ....problems.motion.state import State
from ....problems.motion.stepping.step import Step
from ...report.charts.palette import PALETTE, rgb
from ...report.layout.text import counted
from ..blueprints import Camera, space_view
from ..contact_states import States
from ..scene_recorder import BODIES, IMPULSES, NO_IMPULSES, Entities, SceneRecorder, arrows
from .meshes import ball_mesh, identity_orientations, in_space, surface_meshes, turned

LAYER_COLOURS = (PALETTE[0], PALETTE[4], PALETTE[1], PALETTE[5])
"""Colours of groups of balls by their initial height, to show how they mix."""

GLASS = (150, 170, 200, 45)
"""Colour of surfaces, nearly transparent."""

DISC_FLATNESS = 0.35
"""Thickness of a drawn disc, relative to its diameter."""

ARROW_RADII = 3.0
"""Length of the arrow of a ball's weight over ``REFERENCE_SECONDS``, in radii. Lengths grow with the square root of the
impulse."""

REFERENCE_SECONDS = 0.01
"""Time over which the weight of a ball gives the reference impulse of arrows [s]."""


class BallRecorder(SceneRecorder):
    """Record a scene of balls or discs; see ``SceneRecorder``.

    A ball has two shades, to show its rotation. Orientations, which simulations do not store, are integrated
    from the mean angular velocity of successive drawn states.
    """

    def __init__(self, scene: Scene, file: Path, force: bool = False, every: int = 1) -> None:
        super().__init__(scene, file, force, every)
        assert scene.balls is not None
        self._system = system = scene.balls
        self._orientations = identity_orientations(system.n_balls)
        self._layers: list[IntArray] = []
        relative_radii = np.repeat(system.radii / system.radii.max(), 3).reshape(-1, 3).astype(np.float32)
        self._scales = None if (relative_radii == 1.0).all() else relative_radii
        option: Any = scene.options.get("gravity")
        gravity = float(option) if isinstance(option, int | float) else 0.0
        self._reference = float(np.median(system.masses)) * (abs(gravity) or 9.81) * REFERENCE_SECONDS

    @property
    def title(self) -> str:
        """The scene and its number of balls or discs."""
        return f"{self.scene.name}, {counted(self.scene.n_balls, 'disc' if self._system.dimension == 2 else 'ball')}"

    def _explanation(self) -> str:
        return (
            "Left: balls, coloured by their height at the start. Right: the impulses of each step as arrows at the "
            "first ball of each contact; **teal** contacts stick, **orange** ones slip. An arrow's length grows with "
            "the square root of its impulse."
        )

    def _views(self) -> Sequence[rrb.Spatial3DView]:
        camera = self._camera(self._in_space(self.scene.start))
        return [
            space_view(name, camera, [f"/{entity}/**", "/scene/surfaces/**"])
            for name, entity in (("balls", BODIES), ("impulses", IMPULSES))
        ]

    def _scenery(self) -> Entities:
        system, centres = self._system, self._in_space(self.scene.start)
        is_planar, radius = system.dimension == 2, float(system.radii.max())
        # groups of similar height and equal size
        order = np.argsort(centres[:, 2], kind="stable")
        self._layers = [members for members in np.array_split(order, len(LAYER_COLOURS)) if len(members)]
        top = float(centres[:, 2].max()) + 2.0 * radius
        width = 2.0 * radius if is_planar else float(np.abs(centres[:, :2]).max()) + 4.0 * radius
        for index, mesh in enumerate(surface_meshes(system.surfaces, top, width, system.dimension)):
            shape = rr.Mesh3D(vertex_positions=mesh.vertices, triangle_indices=mesh.triangles, albedo_factor=GLASS)
            yield f"scene/surfaces/{index}", shape
        for index, colour in enumerate(LAYER_COLOURS[: len(self._layers)]):
            mesh = ball_mesh(radius, rgb(colour), DISC_FLATNESS if is_planar else 1.0)
            shape = rr.Mesh3D(
                vertex_positions=mesh.vertices,
                vertex_normals=mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None],
                vertex_colors=mesh.colours,
                triangle_indices=mesh.triangles,
            )
            yield f"{BODIES}/{index}", shape
        yield IMPULSES, rr.Arrows3D.from_fields(radii=[0.09 * radius], show_labels=False)

    def _bodies(self, state: State) -> Entities:
        spins = 0.5 * (self._spins(self._last_state.velocity) + self._spins(state.velocity))
        self._orientations = turned(self._orientations, spins, state.time - self._last_state.time)
        centres = self._in_space(state)
        for index, members in enumerate(self._layers):
            scales = None if self._scales is None else self._scales[members]
            quaternions = self._orientations[members]
            poses = rr.InstancePoses3D(translations=centres[members], quaternions=quaternions, scales=scales)
            yield f"{BODIES}/{index}", poses

    def _impulses(self, step: Step, states: States | None) -> Entities:
        contacts, system = step.contacts, self._system
        if contacts is None or states is None:
            return [(IMPULSES, NO_IMPULSES)]
        pieces = contacts.directions
        assert isinstance(pieces, Pieces)  # true for all ball systems
        first_chunks = pieces.starts[:-1]
        axes = in_space(pieces.values[first_chunks][:, :, : system.dimension])
        vectors = np.einsum("cl,clx->cx", step.impulses.reshape(pieces.n_blocks, pieces.width), axes)
        balls = pieces.chunks[first_chunks]
        points = self._in_space(step.state)[balls] - system.radii[balls, None] * axes[:, 0]
        is_loaded = vectors.any(axis=1)
        lengths = ARROW_RADII * system.radii[balls[is_loaded]]
        return [(IMPULSES, arrows(vectors[is_loaded], points[is_loaded], states[is_loaded], lengths, self._reference))]

    def _spins(self, velocity: FloatArray) -> FloatArray:
        """Return angular velocities in space [rad/s], shape (n, 3); discs turn from x to z, thus about −y."""
        twists = self._system.twists(velocity)[:, self._system.dimension :]
        if self._system.n_rotations == 3:
            return twists
        spins = np.zeros((self._system.n_balls, 3))
        spins[:, 1] = -twists.sum(axis=1)  # sums one component, or none
        return spins

    def _in_space(self, state: State) -> FloatArray:
        return in_space(self._system.centres(state.position))

    def _camera(self, centres: FloatArray) -> Camera:
        """Return a view of the balls at the start, except the lowest ones, and of the space into which they fall."""
        low, high = np.quantile(centres, (0.05, 1.0), axis=0)
        if self._system.surfaces:
            low[2] = min(low[2], 0.0) - 0.3 * float(high[2] - min(low[2], 0.0))
        lift = 0.1 if self._system.dimension == 2 else 0.32
        distance = 1.4 * float(np.linalg.norm(high - low)) + 8.0 * float(self._system.radii.max())
        return Camera.around(low, high, distance, (0.0, -np.sqrt(1.0 - lift**2), lift))
