"""The event-driven stepper, an independent reference for time stepping; see ``integration`` for the method."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar

import numpy as np

from ....contact.problem import ContactProblem
from ....contact.solver import Prepared, Stop
from ....errors import ProblemError
from ...bodies.system import MechanicalSystem
from ...scenes.scene import Scene
from ...state import State
from ..midpoint import ContactSolver
from ..step import AcceptedStep, SwitchingPoint
from ..stepper import MotionSetup, Stepper
from .integration import Integration
from .motion import Motion


@dataclass(frozen=True)
class EventDriven(Stepper):
    """The event-driven reference: smooth motion between events, for systems given by functions, with few contacts.

    Its solver must find the impulses of impacts and the forces after events to a residual of 1e-9 or better;
    Enumeration finds them exactly.

    Attributes:
        tolerance: relative error of the integration of smooth motion.
        max_step: longest time between two states [s], that of the scene if None; two events of one contact within this
            time may be missed.
        flight: time between two impacts [s] below which a bouncing contact is assumed to come to rest by infinitely
            many impacts; flights of 1e-7 s are 1e-14 m high under gravity, the rounding of positions of decimetres.
    """

    tolerance: float = 1e-13
    max_step: float | None = None
    flight: float = 1e-7

    holds_forces: ClassVar[bool] = False
    shows_solves: ClassVar[bool] = False
    uses_last_impulses: ClassVar[bool] = False

    def shortest_step(self, scene: Scene) -> float:
        """Return the shortest flight [s]."""
        return self.flight

    def longest_step(self, scene: Scene) -> float:
        """Return the longest time between two states [s]."""
        return scene.longest_step if self.max_step is None else self.max_step

    def check(self, scene: Scene, begin: float, until: float) -> None:
        """Check the options, the scene and the times; see ``Stepper``."""
        _check_system(scene)
        for name, value in {**vars(self), "max_step": self.longest_step(scene)}.items():
            if not value > 0.0:
                raise ProblemError(f"{name} must be positive, got {value}.")
        if not begin <= until < np.inf:
            raise ProblemError(f"until must be finite and not before the start ({begin} s), got {until}.")

    def follow(self, setup: MotionSetup) -> Iterator[AcceptedStep]:
        """Yield the motion at the ends of its phases and at times between them.

        Raises:
            ProblemError: as ``check`` does.
            AccumulationError, MotionError: as ``simulate`` does.
        """
        counting_solver, begin, wall_start = _CountingSolver(setup.solver), setup.start, perf_counter()
        for phase in self._phases(replace(setup, solver=counting_solver)):
            seconds, solves = perf_counter() - wall_start, counting_solver.pop_count()
            count = max(1, math.ceil((phase.end.time - begin.time) / self.longest_step(setup.scene)))
            for time in np.linspace(begin.time, phase.end.time, count + 1)[1:-1].tolist():
                end = phase.at(time)
                yield AcceptedStep(begin, end, (), solves=0)
                begin = end
            switches = tuple(SwitchingPoint(e.time, e.time, e.law, e.contact, e.before, e.after) for e in phase.events)
            yield AcceptedStep(begin, phase.end, (), switches=switches, solves=solves, seconds=seconds)
            begin, wall_start = phase.end, perf_counter()

    def simulate(self, scene: Scene, solver: ContactSolver, stop: Stop, start: State, until: float) -> Motion:
        """Return the motion from ``start`` to the time ``until`` [s].

        Raises:
            AccumulationError: if impacts accumulate.
            MotionError: if the start penetrates, M, h, g or W is invalid, a contact problem has no solution, or no
                mode is consistent; like AccumulationError, it contains the motion found so far.
            ProblemError: as ``check`` does, or if W depends on q while the system has no ``direction_rates``.
        """
        integration = self._begin(MotionSetup(scene, solver, stop, start, until))
        for _ in integration.advance_to(until):
            pass
        return integration.motion()

    def _phases(self, setup: MotionSetup) -> Iterator[Motion]:
        """Yield the motion in pieces: one phase, the events at its end, and the state after them."""
        integration = self._begin(setup)
        n_events = n_phases = 0
        for _ in integration.advance_to(setup.until):
            if len(integration.phases) > n_phases:  # an event that is due at once has no phase
                yield Motion(
                    tuple(integration.events[n_events:]), tuple(integration.phases[n_phases:]), integration.motion().end
                )
                n_events, n_phases = len(integration.events), len(integration.phases)

    def _begin(self, setup: MotionSetup) -> Integration:
        scene, start = setup.scene, setup.start
        self.check(scene, start.time, setup.until)
        options = (self.tolerance, self.longest_step(scene), self.flight)
        return Integration(_check_system(scene), setup.solver, setup.stop, start, *options)


def _check_system(scene: Scene) -> MechanicalSystem:
    """Return the system of ``scene``, or raise ``ProblemError`` if this stepper does not support it."""
    system = scene.system
    if not isinstance(system, MechanicalSystem):
        raise ProblemError("EventDriven supports scenes given by functions M, h, g and W (woodpecker), not this one.")
    if not system.has_equal_rows:
        raise ProblemError("EventDriven needs contacts with equal numbers of rows and no joints; use another stepper.")
    if system.width > 2:
        raise ProblemError("EventDriven supports planar friction or none; this scene has spatial friction.")
    return system


@dataclass
class _CountingSolver:
    """A solver that counts the problems that it prepares."""

    solver: ContactSolver
    count: int = 0

    def prepare(self, problem: ContactProblem) -> Prepared:
        self.count += 1
        return self.solver.prepare(problem)

    def pop_count(self) -> int:
        """Return the number of problems since the last call."""
        count, self.count = self.count, 0
        return count
