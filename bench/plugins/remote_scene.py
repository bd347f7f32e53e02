"""A scene that moves in a process of its own, with the interface of any other.

The stepper, the solver and the judge work here; gaps, masses, forces and energies of a plugin's scene are computed
there. It may raise, hang, crash or take memory without harm to this process: a request that is not answered is a
``FailedSceneError``, which ends the step, and the next request starts a fresh process.
"""

import io
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import msgspec
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.factors import InverseMass
from ...problems.contact.laws import Laws
from ...problems.contact.matrices.pieces import Pieces
from ...problems.errors import ProxbenchError
from ...problems.exchange.archive import read_arrays
from ...problems.exchange.plugin_scenes import build_plugin_scene, plugin_scene
from ...problems.motion.bodies.system import ActiveContacts, Overlaps, StepAssembly
from ...problems.motion.scenes.registry import make_scene, read_scene
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.sequences import is_reversible
from ..errors import BenchError
from ..isolation.child import MisbehaviourError
from ..isolation.worker import REQUEST_SECONDS, Fault, RenewedWorker, no_answer
from ..store.fields import Count, Number, Positive, Record
from ..store.outcome import Outcome
from .ball_records import BallsRecord, ball_arrays, described_balls, read_balls

T = TypeVar("T")

Arrays = dict[str, NDArray[Any]]

_NUMBER = struct.Struct("d")

_UNFIT = (KeyError, ValueError, TypeError, IndexError, OverflowError, AttributeError, ProxbenchError)
"""Exceptions that reading a malformed answer raises."""


class FailedSceneError(BenchError):
    """A scene of a plugin did not answer."""


class SceneRecord(Record, frozen=True, kw_only=True):
    """What a scene says of itself; see ``Scene`` for the fields that have the same names.

    Attributes:
        time: when it begins [s].
        is_reversible: of its system.
        functions: those that it has of the ones that a scene may lack.
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
    functions: list[Literal["potential_energy", "balls_through", "agitation", "exact"]]
    balls: BallsRecord | None


_FUNCTIONS = ("potential_energy", "balls_through", "agitation", "exact")
"""Functions that a scene may lack."""

_SAME = tuple(name for name in SceneRecord.__struct_fields__ if name in Scene.__dataclass_fields__ and name != "balls")
"""Fields of the record that the scene has as they are."""


def local_or_remote_scene(
    name: str, options: Mapping[str, Any] | None = None, seconds: float = REQUEST_SECONDS
) -> Scene:
    """Return a scene by its name: itself if Proxbench has it, else one that moves in a process of its own.

    Args:
        name: its name, with options or without.
        options: further options.
        seconds: wall time that a plugin's scene may take for one answer [s].

    Raises:
        ProblemError: for an unknown scene or option, with the nearest name, or a value out of range.
        BenchError: if a plugin's scene cannot be built.
    """
    if plugin_scene(read_scene(name)[0]) is None:
        return make_scene(name, options)
    return RemoteSystem(name, options or {}, seconds).scene()


class RemoteSystem(RenewedWorker):
    """A system in a process of its own; see ``System``. The process ends with the object."""

    def __init__(self, name: str, options: Mapping[str, Any], seconds: float) -> None:
        """Note what to start.

        Args:
            name: the scene, with options or without.
            options: further options.
            seconds: wall time that a request may take [s].
        """
        super().__init__(SceneTask(name, dict(options)), seconds)
        self._name = read_scene(name)[0]
        self._inverse_mass: InverseMass | None = None
        self.is_reversible = False
        self._sizes = (0, 0)

    def scene(self) -> Scene:
        """Return the scene whose system this is.

        Raises:
            BenchError: if it cannot be built.
        """
        answer, content = self.ask("describe")
        if "refused" in answer:
            raise BenchError(str(answer["refused"]))
        try:
            about, arrays = msgspec.convert(answer["scene"], SceneRecord), _unpacked(content)
            self._sizes = (len(arrays["position"]), len(arrays["velocity"]))
            start = self._state(about.time, arrays)
            if any(index >= len(start.position) for index in about.coordinates.values()):
                raise ValueError("no coordinate")
            balls = None if about.balls is None else read_balls(about.balls, arrays, *self._sizes)
        except _UNFIT:
            raise self.failure(no_answer()) from None
        self.is_reversible = about.is_reversible
        has = about.functions
        return Scene(
            self._name,
            system=self,
            start=start,
            **{name: getattr(about, name) for name in _SAME},
            kinetic_energy=lambda velocity: self._number("kinetic_energy", velocity),
            potential_energy=(lambda q: self._number("potential_energy", q)) if "potential_energy" in has else None,
            balls_through=(lambda q: int(self._number("balls_through", q))) if "balls_through" in has else None,
            agitation=(lambda q, u: self._number("agitation", q, u)) if "agitation" in has else None,
            exact=self._exact if "exact" in has else None,
            balls=balls,
        )

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q after ``seconds`` with u."""
        shape = position.shape
        return self._arrays(lambda arrays: _array(arrays["position"], shape), "move", position, velocity, seconds)

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M."""

        def read(arrays: Arrays) -> StepAssembly:
            if self._inverse_mass is None or "mass_data" in arrays:
                self._inverse_mass = _inverse_mass(arrays, len(velocity))
            contacts = _contacts(arrays, len(velocity)) if "keys" in arrays else None
            return StepAssembly(_numbers(arrays["free_motion"], velocity.shape), self._inverse_mass, contacts)

        return self._arrays(read, "assemble", midpoint, velocity, seconds, self._inverse_mass is not None)

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys and gaps [m] of the contacts with g(q) < ``limit``."""

        def read(arrays: Arrays) -> tuple[IntArray, FloatArray]:
            return _keys(arrays["keys"]), _numbers(arrays["gap"], arrays["keys"].shape)

        return self._arrays(read, "gaps_below", position, limit)

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return the contacts with g(q) < 0, or None if none of them is deeper than ``tolerated`` [m]."""

        def read(arrays: Arrays) -> Overlaps | None:
            if not arrays:
                return None
            n_dofs = self._sizes[1]
            normals = _pieces(arrays, n_dofs)
            if normals.width != 1:
                raise ValueError("no normals")
            return Overlaps(_numbers(arrays["gap"], (normals.n_blocks,)), normals, _inverse_mass(arrays, n_dofs))

        return self._arrays(read, "overlaps", position, tolerated)

    def failure(self, fault: Fault) -> Exception:
        """Return the error of a request that is not answered."""
        late = f"it took longer than {self.seconds:g} s" if fault.outcome is Outcome.TIMEOUT else fault.reason
        return FailedSceneError(f"scene {self._name}: {late}.")

    def close(self) -> None:
        """End the process."""
        self._inverse_mass = None  # a fresh process does not know what the last one sent
        super().close()

    def _arrays(self, read: Callable[[Arrays], T], request: str, *arguments: Any) -> T:
        """Return what ``read`` finds in the arrays of an answer."""
        _, content = self.ask(request, *arguments)
        try:
            return read(_unpacked(content))
        except _UNFIT:
            self.close()
            raise self.failure(no_answer()) from None

    def _number(self, request: str, *arguments: Any) -> float:
        _, content = self.ask("number", request, *arguments)
        if len(content) != _NUMBER.size:
            raise self.failure(no_answer())
        return float(_NUMBER.unpack(content)[0])

    def _exact(self, time: float) -> State:
        return self._arrays(lambda arrays: self._state(time, arrays), "exact", time)

    def _state(self, time: float, arrays: Arrays) -> State:
        position, velocity = (
            _numbers(arrays[name], (size,)) for name, size in zip(("position", "velocity"), self._sizes, strict=True)
        )
        return State(time, position, velocity)


def _unpacked(content: bytes) -> Arrays:
    return read_arrays(io.BytesIO(content)) if content else {}


def _array(values: NDArray[Any], shape: tuple[int, ...]) -> FloatArray:
    if values.dtype != np.float64 or values.shape != shape:
        raise ValueError("no numbers of this shape")
    return values


def _numbers(values: NDArray[Any], shape: tuple[int, ...]) -> FloatArray:
    if not np.isfinite(_array(values, shape)).all():
        raise ValueError("no finite numbers")
    return values


def _keys(values: NDArray[Any]) -> IntArray:
    if values.dtype != np.int64 or values.ndim != 1 or (np.diff(values) <= 0).any():
        raise ValueError("no keys")
    return values


def _inverse_mass(arrays: Arrays, n_dofs: int) -> InverseMass:
    parts = tuple(arrays[f"mass_{part}"] for part in ("data", "indices", "indptr"))
    matrix = sp.csr_array(parts, shape=(n_dofs, n_dofs))
    matrix.check_format(full_check=True)
    return InverseMass.create(matrix)


def _pieces(arrays: Arrays, n_dofs: int) -> Pieces:
    """Return pieces whose indices compiled code may believe."""
    starts, chunks, values = arrays["starts"], arrays["chunks"], arrays["values"]
    if starts.dtype != np.int64 or chunks.dtype != np.int64 or starts.ndim != 1 or chunks.ndim != 1 or values.ndim != 3:
        raise ValueError("no pieces")
    n_chunks, rest = divmod(n_dofs, values.shape[2])
    fits = starts[0] == 0 and starts[-1] == len(chunks) and (np.diff(starts) >= 0).all() and not rest
    if not fits or (chunks < 0).any() or (chunks > n_chunks).any() or values[chunks == n_chunks].any():
        raise ValueError("no pieces of this system")
    return Pieces(starts, chunks, _numbers(values, (len(chunks), *values.shape[1:])), n_chunks)


def _contacts(arrays: Arrays, n_dofs: int) -> ActiveContacts:
    keys, directions = _keys(arrays["keys"]), _pieces(arrays, n_dofs)
    rows, count = directions.width, len(keys)
    if directions.n_blocks != count or rows not in (1, 2, 3):
        raise ValueError("no direction for each contact")
    laws = Laws.contacts(_numbers(arrays["friction"], (count,)), rows, count)
    gap, restitution = _numbers(arrays["gap"], (count,)), _numbers(arrays["restitution"], (rows * count,))
    return ActiveContacts(keys, gap, laws, directions, restitution, rows)


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
            return {"scene": _described(self._scene)}, _packed(arrays)
        if request == "number":
            return {}, _NUMBER.pack(getattr(self._scene, arguments[0])(*arguments[1:]))
        if request == "exact":
            assert self._scene.exact is not None
            return {}, _packed(_state_arrays(self._scene.exact(*arguments)))
        return {}, _packed(getattr(self, f"_{request}")(self._scene.system, *arguments))

    def _move(self, system: Any, position: FloatArray, velocity: FloatArray, seconds: float) -> Arrays:
        return {"position": system.move(position, velocity, seconds)}

    def _gaps_below(self, system: Any, position: FloatArray, limit: float) -> Arrays:
        keys, gap = system.gaps_below(position, limit)
        return {"keys": keys.astype(np.int64), "gap": gap}

    def _overlaps(self, system: Any, position: FloatArray, tolerated: float) -> Arrays:
        found = system.overlaps(position, tolerated)
        if found is None:
            return {}
        return {"gap": found.gap, **_piece_arrays(found.normals), **_mass_arrays(found.inverse_mass)}

    def _assemble(
        self, system: Any, midpoint: FloatArray, velocity: FloatArray, seconds: float, mass_is_known: bool
    ) -> Arrays:
        assembly = system.assemble(midpoint, velocity, seconds)
        arrays: Arrays = {"free_motion": assembly.free_motion}
        if not mass_is_known or assembly.inverse_mass is not self._sent:
            arrays |= _mass_arrays(assembly.inverse_mass)
            self._sent = assembly.inverse_mass
        return arrays if assembly.contacts is None else arrays | _contact_arrays(assembly.contacts)


def _described(scene: Scene) -> dict[str, Any]:
    """Return the fields of ``SceneRecord``."""
    about = {name: getattr(scene, name) for name in _SAME}
    return {
        **about,
        "options": dict(scene.options),
        "coordinates": dict(scene.coordinates),
        "time": scene.start.time,
        "is_reversible": is_reversible(scene.system),
        "balls": None if scene.balls is None else described_balls(scene.balls),
        "functions": [name for name in _FUNCTIONS if getattr(scene, name) is not None],
    }


def _state_arrays(state: State) -> Arrays:
    return {"position": np.asarray(state.position, float), "velocity": np.asarray(state.velocity, float)}


def _mass_arrays(inverse: InverseMass) -> Arrays:
    return {f"mass_{part}": getattr(inverse.matrix, part) for part in ("data", "indices", "indptr")}


def _piece_arrays(pieces: Pieces) -> Arrays:
    starts, chunks = pieces.starts.astype(np.int64), pieces.chunks.astype(np.int64)
    return {"starts": starts, "chunks": chunks, "values": pieces.values}


def _contact_arrays(contacts: ActiveContacts) -> Arrays:
    laws, count = contacts.laws, len(contacts.keys)
    friction = laws.friction_coefficient[laws.is_friction] if contacts.rows_per_contact > 1 else np.zeros(count)
    if laws.fixed_bound.any() or len(friction) != count:
        raise MisbehaviourError("its laws are not those of contacts with Coulomb friction")
    own = {"keys": contacts.keys.astype(np.int64), "gap": contacts.gap, "restitution": contacts.restitution}
    return {**own, "friction": friction, **_piece_arrays(contacts.directions)}


def _packed(arrays: Arrays) -> bytes:
    if not arrays:
        return b""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()
