"""The task of a child process of a study: create scene and solver, and simulate."""

import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....problems.contact.solver import Status
from ....problems.errors import ProxbenchError
from ....problems.exchange.plugins.scenes import build_plugin_scene, plugin_scene
from ....problems.motion.scenes.registry import make_scene, parse_scene
from ....problems.motion.scenes.scene import Scene
from ....problems.motion.stepping.step import NOT_FINITE, AcceptedStep
from ....problems.motion.trajectories.pour import MotionRecorder
from ....problems.motion.trajectories.problem import TrajectoryProblem
from ...errors import FailedSimulationError
from ...isolation.process_usage import ContextSwitches
from ...simulation.plan import SimulationPlan
from ...simulation.run import advance
from ...simulation.simulation import Simulation
from ...simulation.starts import UnsupportedStepError
from ...simulation.step_times import StepClocks
from .methods import Method, scaled_stepper

EXACT_INSTANTS = 200
"""Number of instants of a motion in closed form at which its displacement is taken."""

MAX_SOLVES = 10_000
"""Limit of the solves of a stepper that locates switches: with a coarse solver, laws may switch forever."""


class TrajectoryRequest:
    """Requests to the process of a case, with their arguments; plain strings, as in ``MeasuringRequest``.

    WARM_UP (value, member)   simulate a member at a value of the ladder, without the time limit of a simulation
    SIMULATE (value, member)  simulate it within this time limit
    EXACT_END                 the exact end of the motion
    """

    WARM_UP = "warm_up"
    SIMULATE = "simulate"
    EXACT_END = "exact_end"


@dataclass
class TrajectoryTask:
    """The task of a case.

    Attributes:
        problem: the problem.
        method: the stepper with its solver.
        seconds: wall time limit of a simulation [s].
        max_solves: limit of the solves of a stepper that locates switches.
    """

    problem: TrajectoryProblem
    method: Method
    seconds: float
    max_solves: int = MAX_SOLVES

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer a ``TrajectoryRequest``, given by its name and arguments.

        Raises:
            Exception: any exception of a plugin.
        """
        if request == TrajectoryRequest.EXACT_END:
            return self._exact_end(), b""
        value, member = arguments
        # the warm-up simulates the whole motion, which has contacts of all kinds, within the limit of the case
        task = replace(self, seconds=math.inf) if request == TrajectoryRequest.WARM_UP else self
        try:
            return task._simulate(value, member), b""
        except UnsupportedStepError as error:
            return {"unsupported_reason": str(error)}, b""

    def _exact_end(self) -> dict[str, Any]:
        """Return the exact end of the motion (empty if unknown), its start and displacement, and the scene's length."""
        scene, measure, duration = self._scene(self.problem.members[0]), self.problem.measure, self.problem.duration
        recorder = MotionRecorder(scene)
        start = measure.values(recorder, duration)
        facts = {"start": start, "length": scene.length}
        if scene.exact is None:
            return {"values": {}, "displacement": 0.0, **facts}
        for part in np.linspace(0.0, 1.0, EXACT_INSTANTS + 1)[1:]:
            recorder.record(scene.exact(scene.start.time + float(part) * duration))
        return {"values": measure.values(recorder, duration), "displacement": recorder.displacement, **facts}

    def _scene(self, member: float) -> Scene:
        """Return the scene, with the seed ``member`` if members are seeds."""
        name, options = parse_scene(self.problem.name)
        if self.problem.varies_seeds:
            options["seed"] = int(member)
        return make_scene(name, options) if plugin_scene(name) is None else build_plugin_scene(name, options)

    def _plan(self, value: float, member: float) -> SimulationPlan:
        """Return the plan of the simulation of a member at a value of the ladder."""
        scene, (stepper, tolerance) = self._scene(member), self.method.setting(value)
        stepper = stepper.with_defaults_of(scene)
        if not self.problem.varies_seeds:
            stepper = scaled_stepper(stepper, member, self.problem.duration)
        return SimulationPlan(
            scene,
            stepper,
            self.problem.duration,
            self.method.solver.make(),
            tolerance,
            self.method.record.max_iterations,
            self.method.record.start,
            states=1,
        )

    def _simulate(self, value: float, member: float) -> dict[str, Any]:
        """Simulate a member at a value of the ladder; return the fields of a ``SimulationRound``."""
        plan = self._plan(value, member)
        simulation, recorder, solves = Simulation(plan), MotionRecorder(plan.scene), 0
        max_solves = self.max_solves if plan.stepper.locates_switches else math.inf
        clocks, before, end = StepClocks(plan.solver), ContextSwitches.now(), time.monotonic() + self.seconds

        def on_step(number: int, step: AcceptedStep) -> None:
            nonlocal solves
            solves += step.solves
            recorder.record(step.end)

        status, reason = Status.SOLVED, ""
        try:
            advance(
                simulation,
                on_step=[on_step],
                should_stop=lambda: solves > max_solves or time.monotonic() > end,
                watch_steps=clocks.watch,
            )
        except FailedSimulationError as failure:
            status, reason = Status.STALLED, _reason(failure)
        progress = f"at {simulation.state.time:.4g} of {plan.until:.4g} s"
        values = self.problem.measure.values(recorder, self.problem.duration)
        if status is Status.SOLVED and not simulation.is_finished:
            status, reason = Status.TIME_LIMIT, f"given up after {self.seconds:g} s, {progress}"
            if solves > max_solves:
                status, reason = Status.ITERATION_LIMIT, f"given up after {max_solves} one-step solves, {progress}"
        elif status is Status.SOLVED and not np.isfinite(list(values.values())).all():
            status, reason = Status.DIVERGED, NOT_FINITE
        return {
            "status": status.value,
            "iterations": int(simulation.steps["solves"].sum()),
            "message": reason,
            "prepare": [0.0],
            "solve": [clocks.wall],
            "processor": [clocks.processor],
            **ContextSwitches.now().since(before)._asdict(),
            "steps": simulation.n_steps,
            "unsolved": int(simulation.unsolved.sum()),
            "overlapping": int(simulation.overlapping.sum()),
            "values": values if status is Status.SOLVED else {},
            "displacement": recorder.displacement if status is Status.SOLVED else 0.0,
        }


def _reason(failure: FailedSimulationError) -> str:
    """Return why a step failed, if the failure is a result of the measurement.

    Raises:
        UnsupportedStepError: if the solver does not support the step.
        BaseException: any exception of solver or scene that is not a ``ProxbenchError``.
    """
    cause: BaseException = failure
    while cause.__cause__ is not None:
        cause = cause.__cause__
    if isinstance(cause, UnsupportedStepError) or not isinstance(cause, ProxbenchError):
        raise cause
    return str(failure).rstrip(".")
