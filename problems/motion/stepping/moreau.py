"""Moreau's midpoint rule with a fixed step."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar, Self

from ...errors import ProblemError
from ..scenes.scene import Scene
from .midpoint import MidpointRule
from .step import AcceptedStep, check_finite
from .stepper import MotionSetup, Stepper


@dataclass(frozen=True)
class Moreau(Stepper):
    """Moreau's midpoint rule with equal steps, the last of which reaches or passes the end.

    Attributes:
        step: Δt [s]; that of the scene if None.
    """

    step: float | None = None

    locates_switches: ClassVar[bool] = False
    holds_forces: ClassVar[bool] = False

    def with_defaults_of(self, scene: Scene) -> Self:
        """Return the stepper with its own step size, or the default of the scene."""
        return self if self.step is not None else replace(self, step=scene.step_size)

    def shortest_step(self, scene: Scene) -> float:
        """Return Δt [s]."""
        return scene.step_size if self.step is None else self.step

    def resolution(self, scene: Scene) -> float:
        """Return Δt [s]."""
        return self.shortest_step(scene)

    def check(self, scene: Scene, begin: float, until: float) -> None:
        """Check Δt.

        Raises:
            ProblemError: if Δt is not positive and finite, or is longer than the motion.
        """
        length = self.shortest_step(scene)
        if not 0.0 < length < math.inf:
            raise ProblemError(f"step of Moreau must be positive and finite, got {length} s.")
        if length > until - begin:
            raise ProblemError(f"step of Moreau, {length} s, must not be longer than the duration, {until - begin} s.")

    def follow(self, setup: MotionSetup) -> Iterator[AcceptedStep]:
        """Yield the steps of a motion."""
        scene, state = setup.scene, setup.start
        rule = MidpointRule(scene.system, setup.solver, setup.stop, self.shortest_step(scene), depth=scene.depth)
        while not self.has_reached(scene, state, setup.until):
            wall_start = perf_counter()
            step = rule.step(state)
            seconds = perf_counter() - wall_start
            check_finite(state, step.state)
            substeps = ((step, rule.time_step),)
            yield AcceptedStep(state, step.state, substeps, iterations=step.iterations, seconds=seconds)
            state = step.state
