"""A scene that moves in a process of its own, with the interface of any other.

The stepper, the solver and the judge work here; gaps, masses, forces and energies of a plugin's scene are computed
there. It may raise, hang, crash or take memory without harm to this process: a request that is not answered is a
``FailedSceneError``, which ends the step, and the next request starts a fresh process.
"""

import io
import math
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...problems.arrays import FloatArray, IntArray
from ...problems.catalog.archive import ArchiveError, read_arrays
from ...problems.catalog.plugin_scenes import build_plugin_scene, plugin_scene
from ...problems.contact.factors import InverseMass
from ...problems.contact.laws import Laws
from ...problems.contact.pieces import Pieces
from ...problems.errors import ProxbenchError
from ...problems.mechanics.state import State
from ...problems.mechanics.system import ActiveContacts, Overlaps, StepAssembly
from ...problems.scenes.registry import make_scene, read_scene
from ...problems.scenes.scene import Scene
from ...problems.stepping.extrapolation import is_reversible
from ..errors import BenchError
from ..isolation.child import MisbehaviourError
from ..isolation.worker import Fault, RenewedWorker

SECONDS = 60.0
"""Wall time that a request may take [s]."""

MEMORY_BYTES = 2**31
"""Memory that a scene may take beyond what the framework itself needs."""

Arrays = dict[str, NDArray[Any]]

_UNFIT = (KeyError, ValueError, TypeError, IndexError, OverflowError, AttributeError, ProxbenchError)
"""What an answer that is none raises where it is read."""

NUMBERS = ("length", "step_size", "duration", "longest_step")
"""Numbers of a scene that must be positive and finite."""


class FailedSceneError(BenchError):
    """A scene of a plugin did not answer."""


def local_or_remote_scene(name: str, options: Mapping[str, Any] | None = None, seconds: float = SECONDS) -> Scene:
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


class RemoteSystem:
    """A system in a process of its own; see ``System``. The process ends with the object."""

    def __init__(self, name: str, options: Mapping[str, Any], seconds: float, memory_bytes: int = MEMORY_BYTES) -> None:
        """Note what to start; the process starts with the first request.

        Args:
            name: the scene, with options or without.
            options: further options.
            seconds: wall time that a request may take [s].
            memory_bytes: memory that it may take.
        """
        self._name, self._seconds = read_scene(name)[0], seconds
        self._worker = RenewedWorker(SceneTask(name, dict(options)), seconds, memory_bytes)
        self._end = weakref.finalize(self, self._worker.close)
        self._inverse_mass: InverseMass | None = None
        self.is_reversible = False
        self._shapes: tuple[tuple[int, ...], tuple[int, ...]] = ((0,), (0,))

    def scene(self) -> Scene:
        """Return the scene whose system this is.

        Raises:
            BenchError: if it cannot be built.
        """
        about, arrays = self.ask("describe")
        if "refused" in about:
            raise BenchError(str(about["refused"]))
        try:
            start = State(float(about["time"]), arrays["position"], arrays["velocity"])
            self._shapes = (start.position.shape, start.velocity.shape)
            self._check_state(start)
            self.is_reversible = about["is_reversible"] is True
            has, depth = about["has"], about["depth"]
            return Scene(
                self._name,
                dict(about["options"]),
                self,
                start,
                **{name: _positive(about[name]) for name in NUMBERS},
                kinetic_energy=lambda velocity: self._number("kinetic_energy", velocity),
                potential_energy=lambda position: self._number("potential_energy", position),
                balls_through=(lambda q: int(self._number("balls_through", q))) if has["balls_through"] else None,
                agitation=(lambda q, u: self._number("agitation", q, u)) if has["agitation"] else None,
                n_balls=int(about["n_balls"]),
                depth=None if depth is None else _positive(depth),
                coordinates={str(name): _index(start, value) for name, value in about["coordinates"].items()},
                has_few_contacts=about["has_few_contacts"] is True,
                exact=self._exact if has["exact"] else None,
            )
        except _UNFIT:
            raise self._unfit() from None

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q after ``seconds`` with u."""
        moved = self._ask_for_arrays("move", position, velocity, seconds).get("position")
        if moved is None or moved.dtype != np.float64 or moved.shape != position.shape:
            raise self._unfit()
        return moved

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M."""
        arrays = self._ask_for_arrays("assemble", midpoint, velocity, seconds, self._inverse_mass is not None)
        try:
            if "mass_data" in arrays:
                self._inverse_mass = _inverse_mass(arrays)
            inverse, free_motion = self._inverse_mass, _numbers(arrays["free_motion"], velocity.shape)
            if inverse is None or inverse.matrix.shape[0] != len(velocity):
                raise ValueError("no mass matrix of this system")
            return StepAssembly(free_motion, inverse, _contacts(arrays, len(velocity)) if "keys" in arrays else None)
        except _UNFIT:
            self._inverse_mass = None
            raise self._unfit() from None

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys and gaps [m] of the contacts with g(q) < ``limit``."""
        arrays = self._ask_for_arrays("gaps_below", position, limit)
        try:
            return _keys(arrays["keys"]), _numbers(arrays["gap"], arrays["keys"].shape)
        except _UNFIT:
            raise self._unfit() from None

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return the contacts with g(q) < 0, or None if none of them is deeper than ``tolerated`` [m]."""
        arrays = self._ask_for_arrays("overlaps", position, tolerated)
        if not arrays:
            return None
        try:
            n_dofs, inverse = self._shapes[1][0], _inverse_mass(arrays)
            normals = _pieces(arrays, n_dofs)
            if inverse.matrix.shape[0] != n_dofs or normals.width != 1:
                raise ValueError("no overlaps of this system")
            return Overlaps(_numbers(arrays["gap"], (normals.n_blocks,)), normals, inverse)
        except _UNFIT:
            raise self._unfit() from None

    def ask(self, request: str, *arguments: Any) -> tuple[dict[str, Any], Arrays]:
        """Return the answer to one request.

        Raises:
            FailedSceneError: if there is none.
        """
        try:
            answer, numbers = self._worker.ask(request, *arguments)
        except Fault as fault:
            self._inverse_mass = None  # a fresh process does not know what the last one sent
            late = f"it took longer than {self._seconds:g} s" if fault.outcome == "timeout" else fault.reason
            raise FailedSceneError(f"scene {self._name}: {late}.") from None
        try:
            length = int(answer.get("content_bytes", 0))
            return answer, read_arrays(io.BytesIO(numbers.tobytes()[:length])) if length else {}
        except (*_UNFIT, ArchiveError):
            raise self._unfit() from None

    def _ask_for_arrays(self, request: str, *arguments: Any) -> Arrays:
        return self.ask(request, *arguments)[1]

    def _number(self, request: str, *arguments: Any) -> float:
        value = self.ask("number", request, *arguments)[0].get("value")
        if value is None:
            return math.nan  # which JSON cannot write
        if not isinstance(value, int | float):
            raise self._unfit()
        return float(value)

    def _exact(self, time: float) -> State:
        arrays = self._ask_for_arrays("exact", time)
        try:
            state = State(time, arrays["position"], arrays["velocity"])
            self._check_state(state)
        except _UNFIT:
            raise self._unfit() from None
        return state

    def _check_state(self, state: State) -> None:
        for values, shape in zip((state.position, state.velocity), self._shapes, strict=True):
            _numbers(values, shape)
            if len(shape) != 1:
                raise ValueError("a vector has one axis")

    def _unfit(self) -> FailedSceneError:
        return FailedSceneError(f"scene {self._name}: its process sent something that is no answer.")


def _index(state: State, value: Any) -> int:
    if type(value) is not int or not 0 <= value < len(state.position):
        raise ValueError("no coordinate")
    return value


def _positive(value: Any) -> float:
    number = float(value)
    if not 0.0 < number < math.inf:
        raise ValueError("no positive number")
    return number


def _numbers(values: NDArray[Any], shape: tuple[int, ...]) -> FloatArray:
    if values.dtype != np.float64 or values.shape != shape or not np.isfinite(values).all():
        raise ValueError("no finite numbers of this shape")
    return values


def _keys(values: NDArray[Any]) -> IntArray:
    if values.dtype != np.int64 or values.ndim != 1 or (np.diff(values) <= 0).any():
        raise ValueError("no keys")
    return values


def _inverse_mass(arrays: Arrays) -> InverseMass:
    parts = tuple(arrays[f"mass_{part}"] for part in ("data", "indices", "indptr"))
    n_dofs = len(parts[2]) - 1
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
        if request == "describe":
            try:
                self._scene = build_plugin_scene(self.name, self.options)
            except ProxbenchError as error:
                return {"refused": str(error)}, b""
            return _described(self._scene)
        if self._scene is None:
            self._scene = build_plugin_scene(self.name, self.options)
        if request == "number":
            value = float(getattr(self._scene, arguments[0])(*arguments[1:]))
            return {"value": value if math.isfinite(value) else None}, b""
        if request == "exact":
            assert self._scene.exact is not None
            return _packed({}, _state_arrays(self._scene.exact(*arguments)))
        found: Arrays = getattr(self, f"_{request}")(self._scene.system, *arguments)
        return _packed({}, found)

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
        contacts = assembly.contacts
        if contacts is None:
            return arrays
        laws, count = contacts.laws, len(contacts.keys)
        friction = laws.friction_coefficient[laws.is_friction] if contacts.rows_per_contact > 1 else np.zeros(count)
        if laws.fixed_bound.any() or len(friction) != count:
            raise MisbehaviourError("its laws are not those of contacts with Coulomb friction")
        return {
            **arrays,
            "keys": contacts.keys.astype(np.int64),
            "gap": contacts.gap,
            "friction": friction,
            "restitution": contacts.restitution,
            **_piece_arrays(contacts.directions),
        }


def _described(scene: Scene) -> tuple[dict[str, Any], bytes]:
    about = {
        "options": dict(scene.options),
        "time": scene.start.time,
        **{name: getattr(scene, name) for name in NUMBERS},
        "n_balls": scene.n_balls,
        "depth": scene.depth,
        "coordinates": dict(scene.coordinates),
        "has_few_contacts": scene.has_few_contacts,
        "is_reversible": is_reversible(scene.system),
        "has": {name: getattr(scene, name) is not None for name in ("balls_through", "agitation", "exact")},
    }
    return _packed(about, _state_arrays(scene.start))


def _state_arrays(state: State) -> Arrays:
    return {"position": np.asarray(state.position, float), "velocity": np.asarray(state.velocity, float)}


def _mass_arrays(inverse: InverseMass) -> Arrays:
    matrix = inverse.matrix
    return {"mass_data": matrix.data, "mass_indices": matrix.indices, "mass_indptr": matrix.indptr}


def _piece_arrays(pieces: Pieces) -> Arrays:
    return {
        "starts": pieces.starts.astype(np.int64),
        "chunks": pieces.chunks.astype(np.int64),
        "values": pieces.values,
    }


def _packed(about: dict[str, Any], arrays: Arrays) -> tuple[dict[str, Any], bytes]:
    """Return an answer with arrays, padded to whole numbers as answers are."""
    if not arrays:
        return about, b""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    content = buffer.getvalue()
    return {**about, "content_bytes": len(content)}, content + bytes(-len(content) % np.dtype(float).itemsize)
