"""Steppers: named methods with options that compute a motion from one accepted step to the next.

A stepper is a frozen dataclass of its options. Its ``name`` is a text such as ``Extrapolated(tolerance=1e-8)``, which
``make_stepper`` reads. Each stepper yields instances of ``AcceptedStep``; a fixed step has a single one-step solve and
no switching point.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Self

from ...contact.solver import Stop
from ...names import name_with_options
from ..scenes.scene import Scene
from ..state import State
from .midpoint import ContactSolver
from .step import AcceptedStep, LawStates

TIME_RESOLUTION = 2.0**-20
"""Smallest time between two steps of a variable stepper, divided by the longest step."""

END_TOLERANCE = 1e-3
"""A motion has reached its end if at most this fraction of its shortest step remains, which may be rounding."""


@dataclass(frozen=True, eq=False)
class MotionSetup:
    """The motion that a stepper computes.

    Attributes:
        scene: the scene.
        solver: solves the contact problem of each one-step inclusion.
        stop: the stopping criterion of each solve.
        start: the initial state.
        until: final time [s].
        states: states of the laws in the step that led to ``start``, None if there was none.
    """

    scene: Scene
    solver: ContactSolver
    stop: Stop
    start: State
    until: float
    states: LawStates | None = None


class Stepper(ABC):
    """A stepper with its options. Subclasses are frozen dataclasses, and ``name_with_options`` creates their names.

    Attributes:
        locates_switches: whether steps are variable and switching points are located.
        holds_forces: whether states contain the mean forces Λ/Δt [N] of a step instead of its impulses Λ [N s].
        shows_solves: whether accepted steps contain their one-step solves, which may be judged.
        uses_last_impulses: whether solves may start from the impulses of the last step.
    """

    locates_switches: ClassVar[bool] = True
    holds_forces: ClassVar[bool] = True
    shows_solves: ClassVar[bool] = True
    uses_last_impulses: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return name_with_options(self)

    def with_defaults_of(self, scene: Scene) -> Self:
        """Return the stepper with those defaults of ``scene`` that its name should show."""
        return self

    @abstractmethod
    def shortest_step(self, scene: Scene) -> float:
        """Return the shortest step of the stepper [s]."""

    def resolution(self, scene: Scene) -> float:
        """Return the smallest time between two steps [s], except at switching points."""
        return TIME_RESOLUTION * scene.longest_step

    def has_reached(self, scene: Scene, state: State, until: float) -> bool:
        """Return whether ``state`` is at the time ``until`` [s] or past it, up to rounding."""
        return until - state.time <= END_TOLERANCE * self.shortest_step(scene)

    @abstractmethod
    def check(self, scene: Scene, begin: float, until: float) -> None:
        """Check the options and the times before the motion starts.

        Raises:
            ProblemError: if an option or a time is out of range, or the scene is not supported.
        """

    def steps(
        self,
        scene: Scene,
        solver: ContactSolver,
        stop: Stop,
        start: State,
        until: float,
        *,
        states: LawStates | None = None,
    ) -> Iterator[AcceptedStep]:
        """Yield the accepted steps from ``start`` to the time ``until`` [s]; for the arguments see ``MotionSetup``.

        Raises:
            ProblemError: as ``check`` does.
            StepError, MotionError: if the motion cannot be continued.
            Exception: any exception that the solver or the system raises in a fixed step.
        """
        return self.follow(MotionSetup(scene, solver, stop, start, until, states))

    @abstractmethod
    def follow(self, setup: MotionSetup) -> Iterator[AcceptedStep]:
        """Yield the accepted steps of a motion; ``steps`` lists the exceptions."""
