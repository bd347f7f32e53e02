"""A scene in a separate process, with the ``Scene`` interface.

The process describes the scene, and evaluates single states: energies, observables, and the contacts that a recording
draws. Another process computes the steps of a simulation (``simulation.remote_steps``). If the scene raises
an exception, hangs, crashes or exhausts memory, this process is not affected. A request without an answer raises
``FailedSceneError``, and the next request starts a new process.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.exchange.plugins.scenes import plugin_scene
from ...problems.motion.bodies.system import StepAssembly, System
from ...problems.motion.scenes.registry import make_scene, parse_scene
from ...problems.motion.scenes.scene import EndingRule, Observable, Scene, SceneEnding
from ...problems.motion.state import State
from ..errors import BenchError
from ..isolation.worker import REQUEST_SECONDS, Fault, RenewedWorker
from ..store.outcome import Outcome
from .ball_records import read_balls
from .body_records import read_bodies
from .scene_arrays import (
    MALFORMED_ANSWER_ERRORS,
    Arrays,
    checked_array,
    finite_numbers,
    read_contacts,
    read_inverse_mass,
    read_state,
    unpacked,
)
from .scene_task import NUMBER, SAME_FIELDS, ObservableRecord, SceneRecord, SceneTask

T = TypeVar("T")
"""The result of reading an answer."""


class FailedSceneError(BenchError):
    """A scene of a plugin did not answer."""


def local_or_remote_scene(
    name: str, options: Mapping[str, Any] | None = None, seconds: float = REQUEST_SECONDS
) -> Scene:
    """Return a scene by its name: a built-in scene itself, a plugin's scene in a separate process.

    Args:
        name: name of the scene, with or without options.
        options: additional options.
        seconds: wall time limit of one answer of a plugin's scene [s].

    Raises:
        ProblemError: for an unknown scene or option, or a value out of range; the message suggests the nearest name.
        BenchError: if a plugin's scene cannot be built.
    """
    if plugin_scene(parse_scene(name)[0]) is None:
        return make_scene(name, options)
    return RemoteSystem(name, options or {}, seconds).scene()


class RemoteSystem(RenewedWorker):
    """The system of a scene in a separate process, for single states; the process ends with the object."""

    def __init__(self, name: str, options: Mapping[str, Any], seconds: float) -> None:
        """Store the name and options of the scene; the process starts with the first request.

        Args:
            name: name of the scene, with or without options.
            options: additional options.
            seconds: wall time limit of a request [s].
        """
        super().__init__(SceneTask(name, dict(options)), seconds)
        self._name = parse_scene(name)[0]
        self._sizes = (0, 0)

    def scene(self) -> Scene:
        """Return the scene of this system.

        Raises:
            BenchError: if it cannot be built.
        """
        answer, content = self.ask("describe")
        if "refused" in answer:
            raise BenchError(str(answer["refused"]))
        try:
            record, arrays = msgspec.convert(answer["scene"], SceneRecord), unpacked(content)
            self._sizes = (len(arrays["position"]), len(arrays["velocity"]))
            start = read_state(record.time, arrays, *self._sizes)
            if any(index >= len(start.position) for index in record.coordinates.values()):
                raise ValueError("a coordinate is out of range")
            balls = None if record.balls is None else read_balls(record.balls, arrays, *self._sizes)
            bodies = None if record.bodies is None else read_bodies(record.bodies, arrays, *self._sizes)
            if bodies is not None and any(body >= bodies.n_bodies for body in record.driven_bodies):
                raise ValueError("a driven body is out of range")
        except MALFORMED_ANSWER_ERRORS:
            raise self.reject_answer() from None
        functions = record.functions
        return Scene(
            self._name,
            system=cast(System, self),  # it has all methods that are called
            start=start,
            **{name: getattr(record, name) for name in SAME_FIELDS},
            kinetic_energy=lambda velocity: self._number("kinetic_energy", velocity),
            potential_energy=(lambda q: self._number("potential_energy", q))
            if "potential_energy" in functions
            else None,
            observables=[self._observable(index, observable) for index, observable in enumerate(record.observables)],
            ending=None if record.ending_seconds is None else EndingRule(record.ending_seconds, self._ending),
            exact=self._exact if "exact" in functions else None,
            balls=balls,
            bodies=bodies,
        )

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return the coordinates after a motion of ``seconds`` [s] from ``position`` with ``velocity``."""
        shape = position.shape
        return self._read(lambda arrays: checked_array(arrays["position"], shape), "move", position, velocity, seconds)

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Return the quantities of a step of ``seconds`` [s] at the midpoint q_M, as ``System.assemble`` does."""

        def read(arrays: Arrays) -> StepAssembly:
            free_motion = finite_numbers(arrays["free_motion"], velocity.shape)
            contacts = read_contacts(arrays, len(velocity)) if "keys" in arrays else None
            return StepAssembly(free_motion, read_inverse_mass(arrays, len(velocity)), contacts)

        return self._read(read, "assemble", midpoint, velocity, seconds)

    def failure(self, fault: Fault) -> Exception:
        """Return the error for a request without an answer."""
        reason = f"it took longer than {self.seconds:g} s" if fault.outcome is Outcome.TIMEOUT else fault.reason
        return FailedSceneError(f"scene {self._name}: {reason}.")

    def _read(self, read: Callable[[Arrays], T], request: str, *arguments: Any) -> T:
        """Return the result of ``read`` for the arrays of an answer; if they are malformed, end the process."""
        _, content = self.ask(request, *arguments)
        try:
            return read(unpacked(content))
        except MALFORMED_ANSWER_ERRORS:
            raise self.reject_answer() from None

    def _number(self, request: str, *arguments: Any) -> float:
        """Return the value of a scalar function of the scene."""
        _, content = self.ask("number", request, *arguments)
        if len(content) != NUMBER.size:
            raise self.reject_answer()
        return float(NUMBER.unpack(content)[0])

    def _observable(self, index: int, record: ObservableRecord) -> Observable:
        return Observable(
            compute=lambda state: self._number("observe", index, state.position, state.velocity),
            **msgspec.structs.asdict(record),
        )

    def _ending(self, steps: NDArray[np.void]) -> SceneEnding | None:
        answer, _ = self.ask("ending", steps)
        try:
            return msgspec.convert(answer["ending"], SceneEnding | None)
        except MALFORMED_ANSWER_ERRORS:
            raise self.reject_answer() from None

    def _exact(self, time: float) -> State:
        return self._read(lambda arrays: read_state(time, arrays, *self._sizes), "exact", time)
