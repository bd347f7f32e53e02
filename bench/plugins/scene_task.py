"""The child's half of a scene of a plugin: it builds the scene, describes it, and answers for its system."""

import struct
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.matrices.factors import InverseMass
from ...problems.errors import ProxbenchError
from ...problems.exchange.plugin_scenes import build_plugin_scene
from ...problems.motion.scenes.scene import Observable, Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.sequences import is_reversible
from ..store.fields import Count, Number, Positive, Record
from .ball_records import BallsRecord, ball_arrays, described_balls
from .scene_arrays import Arrays, contact_arrays, mass_arrays, packed, piece_arrays

NUMBER = struct.Struct("d")
"""How a single number is sent."""


class ObservableRecord(Record, frozen=True, kw_only=True):
    """An ``Observable`` of a scene, without its function."""

    name: str
    is_count: bool
    label: str
    head: str
    rate: str


class SceneRecord(Record, frozen=True, kw_only=True):
    """What a scene says of itself; see ``Scene`` for the fields that have the same names.

    Attributes:
        time: when it begins [s].
        is_reversible: of its system.
        functions: those that it has of the ones that a scene may lack.
        observables: what is recorded at each step.
        ending_seconds: how far its rule of ending looks back [s], None if it has none.
        balls: what recordings draw, None if there are no balls.
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
    is_reversible: bool
    functions: list[Literal["potential_energy", "exact"]]
    observables: list[ObservableRecord]
    ending_seconds: Number | None
    contact_names: list[str]
    view: str | None
    balls: BallsRecord | None


_FUNCTIONS = ("potential_energy", "exact")
"""Functions that a scene may lack."""

_MADE_APART = {"balls", "observables"}

SAME_FIELDS = tuple(set(SceneRecord.__struct_fields__) & set(Scene.__dataclass_fields__) - _MADE_APART)
"""Fields of the record that the scene has as they are."""


@dataclass
class SceneTask:
    """The child's half: answers "describe", "move", "assemble", "gaps_below", "overlaps", "number" and "exact"."""

    name: str
    options: dict[str, Any]
    _scene: Scene | None = None
    _sent: InverseMass | None = None

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request."""
        try:
            self._scene = self._scene or build_plugin_scene(self.name, self.options)
        except ProxbenchError as error:
            if request != "describe":
                raise
            return {"refused": str(error)}, b""
        if request == "describe":
            arrays = _state_arrays(self._scene.start) | ball_arrays(self._scene)
            return {"scene": _described(self._scene)}, packed(arrays)
        if request == "number":
            return {}, NUMBER.pack(self._number(self._scene, *arguments))
        if request == "ending":
            assert self._scene.ending is not None
            ending = self._scene.ending.find(*arguments)
            return {"ending": None if ending is None else asdict(ending)}, b""
        if request == "exact":
            assert self._scene.exact is not None
            return {}, packed(_state_arrays(self._scene.exact(*arguments)))
        return {}, packed(getattr(self, f"_{request}")(self._scene.system, *arguments))

    def _number(self, scene: Scene, name: str, *arguments: Any) -> float:
        if name != "observe":
            return float(getattr(scene, name)(*arguments))
        index, position, velocity = arguments
        return float(scene.observables[index].compute(State(0.0, position, velocity)))

    def _move(self, system: Any, position: FloatArray, velocity: FloatArray, seconds: float) -> Arrays:
        return {"position": system.move(position, velocity, seconds)}

    def _gaps_below(self, system: Any, position: FloatArray, limit: float) -> Arrays:
        keys, gap = system.gaps_below(position, limit)
        return {"keys": keys.astype(np.int64), "gap": gap}

    def _overlaps(self, system: Any, position: FloatArray, tolerated: float) -> Arrays:
        found = system.overlaps(position, tolerated)
        if found is None:
            return {}
        return {"gap": found.gap, **piece_arrays(found.normals), **mass_arrays(found.inverse_mass)}

    def _assemble(
        self, system: Any, midpoint: FloatArray, velocity: FloatArray, seconds: float, mass_is_known: bool
    ) -> Arrays:
        assembly = system.assemble(midpoint, velocity, seconds)
        arrays: Arrays = {"free_motion": assembly.free_motion}
        if not mass_is_known or assembly.inverse_mass is not self._sent:
            arrays |= mass_arrays(assembly.inverse_mass)
            self._sent = assembly.inverse_mass
        return arrays if assembly.contacts is None else arrays | contact_arrays(assembly.contacts)


def _described(scene: Scene) -> dict[str, Any]:
    """Return the fields of ``SceneRecord``."""
    about = {name: getattr(scene, name) for name in SAME_FIELDS}
    return {
        **about,
        "options": dict(scene.options),
        "coordinates": dict(scene.coordinates),
        "time": scene.start.time,
        "is_reversible": is_reversible(scene.system),
        "balls": None if scene.balls is None else described_balls(scene.balls),
        "observables": [_observable_fields(one) for one in scene.observables],
        "ending_seconds": None if scene.ending is None else scene.ending.seconds,
        "contact_names": list(scene.contact_names),
        "functions": [name for name in _FUNCTIONS if getattr(scene, name) is not None],
    }


def _observable_fields(observable: Observable) -> dict[str, Any]:
    return {name: getattr(observable, name) for name in ObservableRecord.__struct_fields__}


def _state_arrays(state: State) -> Arrays:
    return {"position": np.asarray(state.position, float), "velocity": np.asarray(state.velocity, float)}
