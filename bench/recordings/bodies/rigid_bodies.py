"""Recordings of rigid bodies: each by its shape, fixed ones, and the impulses at contacts."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ....problems.arrays import FloatArray
from ....problems.motion.bodies.contact_frame import write_frame
from ....problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from ....problems.motion.bodies.rigid.shapes import HalfSpace, Shape
from ....problems.motion.scenes.scene import Scene
from ....problems.motion.state import State
from ....problems.motion.stepping.step import Step
from ...report.charts.palette import PALETTE, rgb
from ...report.layout.text import counted
from ..blueprints import Camera, space_view
from ..contact_states import States
from ..simulation import BODIES, IMPULSES, NO_IMPULSES, Entities, SceneRecorder, arrows
from .meshes import Mesh
from .shape_meshes import shape_mesh

COLOURS = (PALETTE[0], PALETTE[4], PALETTE[1], PALETTE[5])
"""Colours of bodies, which alternate."""

GLASS = (150, 170, 200, 60)
"""Colour of fixed bodies, and of all bodies beside impulses: nearly transparent."""

OUTLINES, FIXED = "scene/outlines", "scene/fixed"
REFERENCE_SECONDS = 0.01
"""The weight of a body over this time [s] has an arrow of its bounding radius."""

REACH = 0.2
"""Greatest gap at the end of a step over the smallest bounding radius, of contacts whose impulses are drawn."""


class RigidRecorder(SceneRecorder):
    """Record a scene of rigid bodies; see ``SceneRecorder``."""

    bodies = (
        "Left: the bodies. Right: the impulses of each step as arrows on the first body of a contact; **teal** "
        "contacts stick, **orange** ones slip. An arrow's length grows with the root of its impulse."
    )

    def __init__(self, scene: Scene, file: Path, force: bool = False, every: int = 1) -> None:
        super().__init__(scene, file, force, every)
        assert isinstance(scene.system, RigidBodies)
        self._system = scene.system
        self._radii = np.array([shape.bounding_radius for shape in self._system.shapes])
        groups: dict[tuple[Shape, str], list[int]] = {}
        for body, shape in enumerate(self._system.shapes):
            groups.setdefault((shape, COLOURS[body % len(COLOURS)]), []).append(body)
        self._groups = groups
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._include(scene.start)

    @property
    def title(self) -> str:
        """The scene and its number of bodies."""
        return f"{self.scene.name}, {counted(self._system.n_bodies, 'rigid body', 'rigid bodies')}"

    def _include(self, state: State) -> None:
        centres = self._system.centres(state.position)
        self._low = np.minimum(self._low, (centres - self._radii[:, None]).min(axis=0))
        self._high = np.maximum(self._high, (centres + self._radii[:, None]).max(axis=0))

    def _views(self) -> Sequence[rrb.Spatial3DView]:
        """Return views of all places that the drawn bodies reach; long paths along x lead towards the camera."""
        extent = self._high - self._low
        direction = (0.75, -0.5, 0.43) if extent[0] > 2.0 * extent[1] else (0.35, -0.86, 0.37)
        camera = Camera.around(self._low, self._high, 1.5 * float(np.linalg.norm(extent)), direction)
        return [
            space_view("bodies", camera, [f"/{BODIES}/**", f"/{FIXED}/**"]),
            space_view("impulses", camera, [f"/{IMPULSES}/**", f"/{OUTLINES}/**", f"/{FIXED}/**"]),
        ]

    def _frame_curves(self, plots: Sequence[rrb.TimeSeriesView]) -> bool:
        super()._frame_curves(plots)
        return True  # the views are known at the end

    def _scenery(self) -> Entities:
        for index, (shape, colour) in enumerate(self._groups):
            mesh = shape_mesh(shape, rgb(colour))
            yield f"{BODIES}/{index}", _drawn(mesh)
            yield f"{OUTLINES}/{index}", _drawn(mesh, GLASS)
        yield IMPULSES, rr.Arrows3D.from_fields(radii=[0.04 * float(self._radii.max())], show_labels=False)

    def _bodies(self, state: State) -> Entities:
        self._include(state)
        poses = self._system.poses(state.position)
        for index, members in enumerate(self._groups.values()):
            placed = rr.InstancePoses3D(
                translations=poses[members, :3], quaternions=np.roll(poses[members, 3:], -1, axis=1)
            )
            yield f"{BODIES}/{index}", placed
            yield f"{OUTLINES}/{index}", placed

    def _impulses(self, step: Step, states: States | None) -> Entities:
        contacts, system = step.contacts, self._system
        if contacts is None or states is None or step.problem is None:
            return [(IMPULSES, NO_IMPULSES)]
        poses = system.poses(step.state.position)
        found = system.contacts_within(poses, REACH * float(self._radii.min()))
        keys = system.keys_of(found)
        _, ours, there = np.intersect1d(contacts.keys, keys, return_indices=True)
        axes = np.zeros((len(there), 3, 3))
        for frame, normal in zip(axes, found.normal[there], strict=True):
            write_frame(normal, 3, frame)
        n_linear = system.linear_rows
        lanes = step.problem.layout.pad(step.impulses)[ours, :n_linear]
        vectors = np.einsum("cl,clx->cx", lanes, axes[:, :n_linear])
        shown = vectors.any(axis=1)
        bodies = found.first[there][shown]
        reference = 9.81 * float(np.median(system.masses)) * REFERENCE_SECONDS
        points, lengths = found.point[there][shown], self._radii[bodies]
        return [(IMPULSES, arrows(vectors[shown], points, states[ours][shown], lengths, reference))]

    def _summary(self) -> Entities:
        """Return the fixed bodies; half-spaces are squares under the places that the bodies reach."""
        middle, width = (self._low + self._high) / 2.0, 0.75 * float(np.linalg.norm(self._high - self._low))
        for index, body in enumerate(self._system.fixed):
            mesh = _square(width) if isinstance(body.shape, HalfSpace) else shape_mesh(body.shape, GLASS[:3])
            w, x, y, z = body.orientation
            centre = np.array(body.centre)
            if isinstance(body.shape, HalfSpace):
                up = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
                centre = middle - ((middle - centre) @ up) * up
            yield f"{FIXED}/{index}", _drawn(mesh, GLASS)
            yield f"{FIXED}/{index}", rr.InstancePoses3D(translations=[centre], quaternions=[[x, y, z, w]])


def _square(width: float) -> Mesh:
    corners: FloatArray = width * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def _drawn(mesh: Mesh, factor: tuple[int, int, int, int] | None = None) -> rr.Mesh3D:
    """Return a mesh with flat faces, in its own colours or in one."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3),
        vertex_normals=normals.repeat(3, axis=0),
        vertex_colors=mesh.colours if factor is None else None,
        albedo_factor=factor,
    )
