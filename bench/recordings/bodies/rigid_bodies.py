"""Recordings of rigid bodies: shapes, fixed bodies, joints, and the forces at contacts and joints."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ....problems.arrays import FloatArray
from ....problems.contact.matrices.contact_frame import contact_frames
from ....problems.motion.bodies.rigid.joints import RigidJoints
from ....problems.motion.bodies.rigid.orientation import rotation_matrices
from ....problems.motion.bodies.rigid.shapes import HalfSpace, Shape
from ....problems.motion.scenes.scene import Scene
from ....problems.motion.state import State
from ....problems.motion.stepping.step import Step
from ...report.charts.palette import PALETTE, rgb
from ...report.layout.text import counted
from ..blueprints import ABOVE, BESIDE, CameraFit, space_view
from ..contact_states import States
from ..scene_recorder import BODIES, IMPULSES, Entities, SceneRecorder
from .contact_patches import NO_PATCHES, patches
from .force_arrows import NO_FORCES, ForceArrows
from .joints import JOINTS, joint_impulses, joint_points, joint_shapes
from .meshes import Mesh
from .planes import Rectangle, faces, grid_spacing, is_ground
from .shape_meshes import lightened, shape_mesh, shape_points

LAYER_COLOURS = (PALETTE[0], PALETTE[4], PALETTE[1], PALETTE[5])
"""Colours of quarters of the bodies by their height at the start; every other body has a lighter shade."""

WALL_COLOUR = (128, 136, 150)
"""Colour of driven bodies."""

GLASS = (150, 170, 200, 60)
"""Colour of fixed bodies, and of all bodies in the view of forces: nearly transparent."""

GRID = (150, 170, 200, 90)
"""Colour of the lines on half-spaces."""

OUTLINES, FIXED, PATCHES, JOINT_FORCES = "scene/outlines", "scene/fixed", "scene/patches", "scene/joint_forces"
"""Entities of the outlines of bodies, fixed bodies, contact patches, and forces of joints."""

DIRECTION = (0.35, -0.86, 0.37)
"""Direction from the bodies to the camera."""

REACH = 0.2
"""Largest gap at the end of a step, relative to the smallest bounding radius, of contacts whose forces are drawn."""

MIN_FORCE = 1e-6
"""Force below which nothing is drawn, relative to the largest force of a step."""


class RigidRecorder(SceneRecorder):
    """Record a scene of rigid bodies; see ``SceneRecorder``."""

    def __init__(self, scene: Scene, file: Path, force: bool = False, every: int = 1) -> None:
        super().__init__(scene, file, force, every)
        assert scene.bodies is not None
        self._system = system = scene.bodies
        self._radii = np.array([shape.bounding_radius for shape in system.shapes])
        self._groups: dict[tuple[Shape, tuple[int, int, int]], list[int]] = {}
        colours = _body_colours(system.centres(scene.start.position), scene.driven_bodies)
        for body, key in enumerate(zip(system.shapes, colours, strict=True)):
            self._groups.setdefault(key, []).append(body)
        self._fits = [CameraFit(DIRECTION, aspect) for aspect in (BESIDE, ABOVE)]
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._arrows = ForceArrows()
        bounded = [fixed_body for fixed_body in system.fixed if not isinstance(fixed_body.shape, HalfSpace)]
        for fixed_body in bounded:
            self._include(fixed_body.shape, np.array([[*fixed_body.centre, *fixed_body.orientation]]))
        self._include_bodies(scene.start)
        self._has_fixed_view = bool(bounded)

    @property
    def title(self) -> str:
        """The scene and its number of bodies."""
        return f"{self.scene.name}, {counted(self._system.n_bodies, 'rigid body', 'rigid bodies')}"

    def _explanation(self) -> str:
        text = (
            "Bodies are coloured by their height at the start, in alternating shades. **Teal** contacts stick, "
            "**orange** ones slip; arrows are forces on the first body, and lines join the loaded contacts of two "
            "bodies."
        )
        if self._joints is not None:
            text += (
                " Joints are **white**, with friction **yellow**, with a motor **purple**, and their forces **blue**."
            )
        if self.scene.driven_bodies:
            text += " **Grey** bodies are driven."
        text += self._arrows.explanation
        if any(is_ground(body) for body in self._system.fixed):
            text += f" Lines on the ground are {grid_spacing(self._width):g} m apart."
        return text

    @property
    def _joints(self) -> RigidJoints | None:
        joints = self._system.joints
        return joints if isinstance(joints, RigidJoints) else None

    @property
    def _width(self) -> float:
        """Half the width of the square that represents the ground [m]."""
        return 0.75 * float(np.linalg.norm(self._high - self._low))

    def _include_bodies(self, state: State) -> None:
        """Include the bodies of a state in the views."""
        poses = self._system.poses(state.position)
        for (shape, _), members in self._groups.items():
            self._include(shape, poses[members])

    def _include(self, shape: Shape, poses: FloatArray) -> None:
        """Include bodies of one shape at ``poses`` (x [m], quaternion), shape (n, 7), in the views."""
        points = shape_points(shape) @ rotation_matrices(poses[:, 3:]).transpose(0, 2, 1) + poses[:, None, :3]
        points = points.reshape(-1, 3)
        self._low, self._high = np.minimum(self._low, points.min(axis=0)), np.maximum(self._high, points.max(axis=0))
        for fit in self._fits:
            fit.include(points)

    @property
    def _is_stacked(self) -> bool:
        beside, above = self._fits
        return above.depth > beside.depth

    def _views(self) -> Sequence[rrb.Spatial3DView]:
        camera = self._fits[int(self._is_stacked)].camera()
        joints = [f"/{JOINTS}/**"] if self._joints is not None else []
        forces = [f"/{entity}/**" for entity in (IMPULSES, PATCHES, JOINT_FORCES, OUTLINES, FIXED)]
        return [
            space_view("bodies", camera, [f"/{BODIES}/**", f"/{FIXED}/**", *joints]),
            space_view("forces", camera, [*forces, *joints]),
        ]

    def _widen_axes(self, plots: Sequence[rrb.TimeSeriesView]) -> bool:
        super()._widen_axes(plots)
        return True  # the views are known only at the end

    def _scenery(self) -> Entities:
        for index, (shape, colour) in enumerate(self._groups):
            mesh = shape_mesh(shape, colour)
            yield f"{BODIES}/{index}", _mesh_entity(mesh)
            yield f"{OUTLINES}/{index}", _mesh_entity(mesh, GLASS)
        thickness = max(0.04 * float(np.median(self._radii)), 0.003 * float(np.linalg.norm(self._high - self._low)))
        yield IMPULSES, rr.Arrows3D.from_fields(radii=[thickness], show_labels=False)
        yield JOINT_FORCES, rr.Arrows3D.from_fields(radii=[thickness], colors=[rgb(PALETTE[5])])
        yield PATCHES, rr.LineStrips3D.from_fields(radii=[0.5 * thickness], show_labels=False)

    def _bodies(self, state: State) -> Entities:
        poses = self._system.poses(state.position)
        if not self._has_fixed_view:
            self._include_bodies(state)
        for index, members in enumerate(self._groups.values()):
            instances = rr.InstancePoses3D(
                translations=poses[members, :3], quaternions=np.roll(poses[members, 3:], -1, axis=1)
            )
            yield f"{BODIES}/{index}", instances
            yield f"{OUTLINES}/{index}", instances
        if self._joints is not None:
            yield from joint_shapes(self._joints, poses, float(self._radii.min()))

    def _impulses(self, step: Step, states: States | None) -> Entities:
        contacts, system = step.contacts, self._system
        if contacts is None or states is None or step.problem is None:
            self._arrows.add(self._step_number, *NO_FORCES)
            return [(PATCHES, NO_PATCHES)]
        poses = system.poses(step.state.position)
        nearby = system.contacts_within(poses, REACH * float(self._radii.min()))
        _, in_step, in_nearby = np.intersect1d(contacts.keys, system.keys_of(nearby), return_indices=True)
        axes = contact_frames(nearby.normal[in_nearby])
        n_linear = system.linear_rows
        lanes = step.problem.layout.pad(step.impulses)[in_step, :n_linear]
        vectors = np.einsum("cl,clx->cx", lanes, axes[:, :n_linear])
        size = np.linalg.norm(vectors, axis=1)
        is_drawn = size > MIN_FORCE * size.max(initial=0.0)
        in_nearby, vectors, drawn_states = in_nearby[is_drawn], vectors[is_drawn], states[in_step][is_drawn]
        first, points = nearby.first[in_nearby], nearby.point[in_nearby]
        pairs = np.column_stack([first, nearby.second[in_nearby]])
        radii, origins = self._radii[first], points
        if self._joints is not None:
            joint_bodies = [joint.first for joint in self._joints.joints]
            vectors = np.concatenate([vectors, joint_impulses(self._joints, system.first_joint_key, step)])
            origins = np.concatenate([points, [joint_points(joint, poses)[0][0] for joint in self._joints.joints]])
            radii = np.append(radii, self._radii[joint_bodies])
        self._arrows.add(self._step_number, vectors / self._step_seconds, origins, radii, drawn_states)
        return [(PATCHES, patches(pairs, points, nearby.normal[in_nearby], drawn_states))]

    def _final_entities(self) -> Iterable[tuple[int, Entities]]:
        """Yield the arrows of all steps, whose lengths depend on all forces."""
        for number, vectors, points, states in self._arrows.arrows():
            if not self._has_fixed_view:
                for fit in self._fits:
                    fit.include(points + vectors)
            n = len(states)
            entities = [(IMPULSES, rr.Arrows3D(vectors=vectors[:n], origins=points[:n], class_ids=states))]
            if self._joints is not None:
                entities.append((JOINT_FORCES, rr.Arrows3D(vectors=vectors[n:], origins=points[n:])))
            yield number, entities

    def _summary(self) -> Entities:
        """Return the fixed bodies; planes are rectangles behind or below the region that the bodies reach."""
        for index, body in enumerate(self._system.fixed):
            w, x, y, z = body.orientation
            if not isinstance(body.shape, HalfSpace):
                instance = rr.InstancePoses3D(translations=[body.centre], quaternions=[[x, y, z, w]])
                yield f"{FIXED}/{index}", _mesh_entity(shape_mesh(body.shape, GLASS[:3]), GLASS)
                yield f"{FIXED}/{index}", instance
            elif faces(body, DIRECTION):  # a half-space that faces away would hide the bodies
                rectangle = Rectangle.of(body, self._low, self._high, self._width if is_ground(body) else None)
                yield f"{FIXED}/{index}", _mesh_entity(rectangle.mesh(), GLASS)
                if is_ground(body):
                    lines = rectangle.grid(grid_spacing(self._width))
                    yield f"{FIXED}/{index}/grid", rr.LineStrips3D(lines, colors=[GRID], radii=[5e-4 * self._width])


def _body_colours(centres: FloatArray, driven_bodies: Sequence[int]) -> list[tuple[int, int, int]]:
    """Return the colour of each body by the share of bodies whose centres [m], shape (n, 3), are lower.

    Driven bodies all have ``WALL_COLOUR`` and do not count.
    """
    is_free = np.ones(len(centres), dtype=bool)
    is_free[list(driven_bodies)] = False
    heights = np.sort(centres[is_free, 2])
    width = 1e-3 * float(np.linalg.norm(np.ptp(centres[is_free], axis=0)))
    shares = np.searchsorted(heights, centres[:, 2] - width) / len(heights)
    colours = [rgb(LAYER_COLOURS[min(int(share * len(LAYER_COLOURS)), len(LAYER_COLOURS) - 1)]) for share in shares]
    shades = [lightened(colour) if body % 2 else colour for body, colour in enumerate(colours)]
    return [
        shade if is_body_free else WALL_COLOUR for shade, is_body_free in zip(shades, is_free.tolist(), strict=True)
    ]


def _mesh_entity(mesh: Mesh, factor: tuple[int, int, int, int] | None = None) -> rr.Mesh3D:
    """Return a mesh in its own colours or the colour ``factor``; without normals, its faces are flat."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = (normals / np.linalg.norm(normals, axis=1)[:, None]).repeat(3, axis=0)
    if mesh.normals is not None:
        normals = mesh.normals[mesh.triangles].reshape(-1, 3)
    return rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3),
        vertex_normals=normals,
        vertex_colors=mesh.colours if factor is None else None,
        albedo_factor=factor,
    )
