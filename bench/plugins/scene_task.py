"""The task of the child process of a plugin's scene: build the scene, describe it, and evaluate single states."""

import struct
from dataclasses import asdict, dataclass
from typing import Any, Literal

import msgspec

from ...problems.arrays import FloatArray
from ...problems.errors import ProxbenchError
from ...problems.exchange.plugins.scenes import build_plugin_scene
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ..store.fields import Count, Number, Positive, Record
from .ball_records import BallsRecord, ball_arrays, describe_balls
from .body_records import BodiesRecord, body_arrays, describe_bodies
from .scene_arrays import Arrays, contact_arrays, mass_arrays, packed, state_arrays

NUMBER = struct.Struct("d")
"""Binary format of a single number."""


class ObservableRecord(Record, frozen=True, kw_only=True):
    """An ``Observable`` of a scene, without its function."""

    name: str
    is_count: bool
    label: str
    head: str
    rate: str


class SceneRecord(Record, frozen=True, kw_only=True):
    """The description of a scene; see ``Scene`` for the fields that have the same names.

    Attributes:
        time: time of the start [s].
        functions: names of its optional functions.
        observables: quantities that are recorded at each step.
        ending_seconds: simulated time that its stopping rule looks back [s]; None without a rule.
        balls: the balls for recordings; None without balls.
        bodies: the rigid bodies for recordings; None without rigid bodies.
    """

    options: dict[str, Any]
    time: Number
    length: Positive
    step_size: Positive
    duration: Positive
    longest_step: Positive
    n_balls: Count
    depth: Positive | None
    coordinates: dict[str, Count]
    has_few_contacts: bool
    functions: list[Literal["potential_energy", "exact"]]
    observables: list[ObservableRecord]
    ending_seconds: Number | None
    contact_names: list[str]
    view: str | None
    balls: BallsRecord | None
    bodies: BodiesRecord | None
    driven_bodies: list[Count]


_FUNCTIONS: tuple[Literal["potential_energy", "exact"], ...] = ("potential_energy", "exact")
"""Optional functions of a scene."""

_SEPARATE_FIELDS = {"balls", "bodies", "observables"}
"""Fields of the record that are converted from those of the scene."""

SAME_FIELDS = tuple(set(SceneRecord.__struct_fields__) & set(Scene.__dataclass_fields__) - _SEPARATE_FIELDS)
"""Fields of the record that are equal to those of the scene."""


@dataclass
class SceneTask:
    """The task of the child, which answers "describe", "move", "assemble", "number", "ending" and "exact".

    Attributes:
        name: name of the scene, with or without options.
        options: additional options.
    """

    name: str
    options: dict[str, Any]
    _scene: Scene | None = None

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request; if the scene cannot be built, the answer to "describe" is {"refused": sentence}."""
        try:
            self._scene = self._scene or build_plugin_scene(self.name, self.options)
        except ProxbenchError as error:
            if request != "describe":
                raise
            return {"refused": str(error)}, b""
        if request == "describe":
            arrays = state_arrays(self._scene.start) | ball_arrays(self._scene) | body_arrays(self._scene)
            return {"scene": msgspec.to_builtins(_describe(self._scene))}, packed(arrays)
        if request == "number":
            return {}, NUMBER.pack(self._number(self._scene, *arguments))
        if request == "ending":
            assert self._scene.ending is not None
            ending = self._scene.ending.find(*arguments)
            return {"ending": None if ending is None else asdict(ending)}, b""
        if request == "exact":
            assert self._scene.exact is not None
            return {}, packed(state_arrays(self._scene.exact(*arguments)))
        return {}, packed(getattr(self, f"_{request}")(self._scene.system, *arguments))

    def _number(self, scene: Scene, name: str, *arguments: Any) -> float:
        """Return an energy, given by the name of its function, or an observable, given by its index."""
        if name != "observe":
            return float(getattr(scene, name)(*arguments))
        index, position, velocity = arguments
        return float(scene.observables[index].compute(State(0.0, position, velocity)))

    def _move(self, system: Any, position: FloatArray, velocity: FloatArray, seconds: float) -> Arrays:
        return {"position": system.move(position, velocity, seconds)}

    def _assemble(self, system: Any, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> Arrays:
        assembly = system.assemble(midpoint, velocity, seconds)
        arrays = {"free_motion": assembly.free_motion, **mass_arrays(assembly.inverse_mass)}
        return arrays if assembly.contacts is None else arrays | contact_arrays(assembly.contacts)


def _describe(scene: Scene) -> SceneRecord:
    """Return the description of a scene."""
    return SceneRecord(
        **{name: getattr(scene, name) for name in SAME_FIELDS},
        time=scene.start.time,
        balls=None if scene.balls is None else describe_balls(scene.balls),
        bodies=None if scene.bodies is None else describe_bodies(scene.bodies),
        observables=[
            ObservableRecord(**{name: getattr(observable, name) for name in ObservableRecord.__struct_fields__})
            for observable in scene.observables
        ],
        ending_seconds=None if scene.ending is None else scene.ending.seconds,
        functions=[name for name in _FUNCTIONS if getattr(scene, name) is not None],
    )
