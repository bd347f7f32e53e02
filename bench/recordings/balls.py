"""Recordings of ball systems: turning balls among surfaces, and the impulses between them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ...problems.arrays import FloatArray, IntArray
from ...problems.mechanics.balls import BallSystem
from ...problems.mechanics.state import State
from ...problems.scenes.effects import Gravity
from ...problems.scenes.funnel import Funnel
from ...problems.stepping.moreau import Step
from ..report.palette import PALETTE, rgb
from .blueprints import Camera, plot, simulation_blueprint, space_view
from .contact_states import States
from .meshes import ball_mesh, in_space, surface_meshes, turned, upright
from .simulation import BODIES, IMPULSES, StepRecorder

LAYERS = 4
"""Groups of balls by their height at the start, a colour each, so that one sees them mix."""

LAYER_COLOURS = (PALETTE[0], PALETTE[4], PALETTE[1], PALETTE[5])
GLASS = (150, 170, 200, 45)
"""Colour of surfaces, nearly transparent."""

DISC_FLATNESS = 0.35
ARROW_RADII = 3.0
"""Length of the arrow of a ball's weight over ``REFERENCE_SECONDS``, in radii; longer impulses grow by their root."""

REFERENCE_SECONDS = 0.01


class BallRecorder(StepRecorder):
    """Records a system of balls or discs; see ``StepRecorder``.

    A ball is drawn in two shades, so that one sees it turn. Its orientation, which the simulation does not keep, is
    integrated from the mean angular velocity of each step.

    Args:
        system: the balls.
        file: the recording.
        title: what the viewer calls it.
        gravity: g along the last axis [m/s²], for the potential energy.
        force: replace an existing file.
        every: draw bodies and impulses at each such step.
        balls_through: q ↦ how many balls have left through the outlet, for a curve; None where there is none.
    """

    def __init__(
        self,
        system: BallSystem,
        file: Path,
        title: str = "balls",
        gravity: float = 0.0,
        force: bool = False,
        every: int = 1,
        balls_through: Callable[[FloatArray], int] | None = None,
    ) -> None:
        about = (
            f"**{title}**\n\n"
            "Left: balls, coloured by their height at the start. Right: the impulses of each step as arrows on the "
            "first ball of a contact; **teal** contacts stick, **orange** ones slip. An arrow's length grows with the "
            "root of its impulse."
        )
        super().__init__(file, title, about, force, every)
        self._system, self._gravity = system, gravity
        self._balls_through = balls_through
        self._orientations = upright(system.n_balls)
        self._before: State | None = None
        self._groups: list[IntArray] = []
        relative = np.repeat(system.radii / system.radii.max(), 3).reshape(-1, 3).astype(np.float32)
        self._scales = None if (relative == 1.0).all() else relative
        weight = float(np.median(system.masses)) * (abs(gravity) or 9.81)
        self._reference = weight * REFERENCE_SECONDS

    def _blueprint(self, state: State) -> rrb.Blueprint:
        camera = self._camera(self._in_space(state.position))
        surfaces = "/scene/surfaces/**"
        views = [
            space_view("balls", camera, [f"/{BODIES}/**", surfaces]),
            space_view("impulses", camera, [f"/{IMPULSES}/**", surfaces]),
        ]
        return simulation_blueprint(views, self._plots(), self._every)

    def _set_up(self, stream: rr.RecordingStream, state: State) -> None:
        system = self._system
        centres = self._in_space(state.position)
        radius = float(system.radii.max())
        top = float(centres[:, 2].max()) + 2.0 * radius
        flatness = DISC_FLATNESS if system.dimension == 2 else 1.0
        width = 2.0 * radius if system.dimension == 2 else float(np.abs(centres[:, :2]).max()) + 4.0 * radius
        for index, mesh in enumerate(surface_meshes(system.surfaces, top, width, system.dimension)):
            shape = rr.Mesh3D(vertex_positions=mesh.vertices, triangle_indices=mesh.triangles, albedo_factor=GLASS)
            stream.log(f"scene/surfaces/{index}", shape, static=True)
        self._groups = _layers(centres[:, 2])
        for index, colour in enumerate(LAYER_COLOURS[: len(self._groups)]):
            mesh = ball_mesh(radius, rgb(colour), flatness)
            normals = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None]
            shape = rr.Mesh3D(
                vertex_positions=mesh.vertices,
                vertex_normals=normals,
                vertex_colors=mesh.colours,
                triangle_indices=mesh.triangles,
            )
            stream.log(f"{BODIES}/{index}", shape, static=True)
        stream.log(IMPULSES, rr.Arrows3D.from_fields(radii=[0.09 * radius], show_labels=False), static=True)
        self._before = state

    def _follow(self, step: Step) -> None:
        """Turn the balls by the mean of the angular velocities at both ends of the step."""
        assert self._before is not None
        spins = 0.5 * (self._spins(self._before.velocity) + self._spins(step.state.velocity))
        self._orientations = turned(self._orientations, spins, step.state.time - self._before.time)
        self._before = step.state

    def _draw(self, stream: rr.RecordingStream, state: State) -> None:
        centres = self._in_space(state.position).astype(np.float32)
        turns = self._orientations.astype(np.float32)
        for index, members in enumerate(self._groups):
            scales = None if self._scales is None else self._scales[members]
            poses = rr.InstancePoses3D(translations=centres[members], quaternions=turns[members], scales=scales)
            stream.log(f"{BODIES}/{index}", poses)

    def _draw_impulses(self, stream: rr.RecordingStream, step: Step, states: States | None) -> None:
        contacts, system = step.contacts, self._system
        if contacts is None or states is None:
            stream.log(IMPULSES, rr.Arrows3D(vectors=np.zeros((0, 3)), origins=np.zeros((0, 3))))
            return
        pieces = contacts.directions
        first = pieces.starts[:-1]
        axes = in_space(pieces.values[first][:, :, : system.dimension])
        lanes = step.impulses.reshape(pieces.n_blocks, pieces.width)
        vectors = np.einsum("cl,clx->cx", lanes, axes)
        balls = pieces.chunks[first]
        points = self._in_space(step.state.position)[balls] - system.radii[balls, None] * axes[:, 0]
        size = np.linalg.norm(vectors, axis=1)
        shown = np.flatnonzero(size > 0.0)
        length = ARROW_RADII * system.radii[balls[shown]] * np.sqrt(size[shown] / self._reference)
        arrows = vectors[shown] * (length / size[shown])[:, None]
        drawn = rr.Arrows3D(
            vectors=arrows.astype(np.float32), origins=points[shown].astype(np.float32), class_ids=states[shown]
        )
        stream.log(IMPULSES, drawn)

    def _energies(self, state: State) -> tuple[float, float]:
        heights = self._system.centres(state.position)[:, -1]
        return self._system.kinetic_energy(state.velocity), self._gravity * float(self._system.masses @ heights)

    def _own_curves(self, state: State) -> dict[str, float]:
        return {} if self._balls_through is None else {"through": float(self._balls_through(state.position))}

    def _plots(self) -> list[rrb.TimeSeriesView]:
        through = [plot("balls through the outlet", "/curves/through", legend=False)]
        return [*(through if self._balls_through is not None else []), *super()._plots()]

    def _spins(self, velocity: FloatArray) -> FloatArray:
        """Return angular velocities in space [rad/s], shape (n, 3); in the plane (x, z) from x to z, thus about −y."""
        spins = np.zeros((self._system.n_balls, 3))
        twists = self._system.twists(velocity)[:, self._system.dimension :]
        if self._system.spins == 3:
            spins = twists
        elif self._system.spins == 1:
            spins[:, 1] = -twists[:, 0]
        return spins

    def _in_space(self, position: FloatArray) -> FloatArray:
        return in_space(self._system.centres(position))

    def _camera(self, centres: FloatArray) -> Camera:
        """Return a view of the balls as they start, but for those far below, and of the room where they fall to."""
        low, high = np.quantile(centres, (0.05, 1.0), axis=0)
        if self._system.surfaces:
            low[2] = min(low[2], 0.0) - 0.3 * float(high[2] - min(low[2], 0.0))
        middle = (low + high) / 2.0
        distance = 1.4 * float(np.linalg.norm(high - low)) + 8.0 * float(self._system.radii.max())
        lift = 0.1 if self._system.dimension == 2 else 0.32
        eye = middle + distance * np.array([0.0, -np.sqrt(1.0 - lift**2), lift])
        return Camera(tuple(eye.tolist()), tuple(middle.tolist()))


def _layers(heights: FloatArray) -> list[IntArray]:
    """Return ``LAYERS`` groups of balls of similar height and equal number, or fewer of fewer balls."""
    return [members for members in np.array_split(np.argsort(heights, kind="stable"), LAYERS) if len(members)]


def funnel_recorder(scene: Funnel, file: Path, force: bool = False, every: int = 1) -> BallRecorder:
    """Return the recorder of a funnel scene; see ``StepRecorder``."""
    gravity = sum(effect.acceleration for effect in scene.effects if isinstance(effect, Gravity))
    title = f"funnel, {scene.n_balls} {'discs' if scene.is_planar else 'balls'}"
    through = scene.balls_through if scene.outlet_radius else None
    return BallRecorder(scene.system(), file, title, gravity, force, every, through)
