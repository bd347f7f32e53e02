"""Steppers by name, ``Extrapolated(tolerance=1e-8)``: how a motion is followed from accepted step to accepted step.

Each is a frozen dataclass of its options, which ``make_stepper`` makes from its name and ``name`` writes again. All of
them yield ``AcceptedStep``: a fixed step is one with a single one-step solve and no switching point.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from time import perf_counter
from typing import Any, ClassVar, Self

import numpy as np

from ...contact.problem import ContactProblem
from ...errors import ProblemError, suggestion
from ...names import check_options, described, read_name
from ..bodies.system import MechanicalSystem
from ..scenes.scene import Scene
from ..state import State
from .accepted_step import AcceptedStep
from .contact_states import LawStates, SwitchingPoint
from .event_driven import integrator
from .extrapolation import Extrapolation, Scheme
from .extrapolation import StepDoubling as DoublingScheme
from .moreau import ContactSolver, check_finite
from .moreau import Moreau as MidpointRule
from .switching import Anticipating, LastStepOnly, NestedIntervals, Search
from .variable_step import VariableStep
from .warming import WarmClock, warm_up

SEARCHES: dict[str, type[Search]] = {"anticipating": Anticipating, "nested": NestedIntervals, "last": LastStepOnly}
"""Searches for switching points by name."""

FINENESS = 2.0**-20
"""Shortest time that a variable step is taken to resolve, over the longest step: any two steps are distinct."""

LEFT = 1e-3
"""A motion has reached its end when less than this part of its shortest step is left, which rounding may leave."""


class Stepper(ABC):
    """A stepper with its options. Subclasses are frozen dataclasses, so that ``described`` writes their names.

    Attributes:
        locates_switches: whether steps are variable, and their switching points known.
        holds_forces: whether states hold the mean forces Λ/Δt of a step in place of its impulses.
        shows_solves: whether accepted steps have the one-step solves behind them, which may be judged.
        uses_last_impulses: whether solves are offered the impulses of the last step to start from.
    """

    locates_switches: ClassVar[bool] = True
    holds_forces: ClassVar[bool] = True
    shows_solves: ClassVar[bool] = True
    uses_last_impulses: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def fitted(self, scene: Scene) -> Self:
        """Return the stepper with the numbers that it takes from ``scene``, as far as its name shall say them."""
        return self

    @abstractmethod
    def shortest(self, scene: Scene) -> float:
        """Return the shortest step that is taken on purpose [s]."""

    def resolution(self, scene: Scene) -> float:
        """Return a time [s] within which no two steps end, but for those at switching points."""
        return FINENESS * scene.longest_step

    def ends(self, scene: Scene, state: State, until: float) -> bool:
        """Whether ``state`` is at the time ``until`` [s] or past it, up to rounding."""
        return until - state.time <= LEFT * self.shortest(scene)

    @abstractmethod
    def rule(self, scene: Scene, solver: ContactSolver, stop: Any) -> Any:
        """Return what takes the steps.

        Raises:
            ProblemError: if an option is out of range, or the scene not of a kind it can follow.
        """

    def check(self, scene: Scene, solver: ContactSolver, begin: float, until: float) -> None:
        """Look at what ``steps`` is given, before anything starts.

        Raises:
            ProblemError: as ``rule``, or if a time is too short.
        """
        self.rule(scene, solver, None)

    @abstractmethod
    def steps(
        self, scene: Scene, solver: ContactSolver, stop: Any, start: State, until: float, states: LawStates | None
    ) -> Iterator[AcceptedStep]:
        """Yield the accepted steps from ``start`` to the time ``until`` [s].

        Args:
            scene: what moves.
            solver: any solver of the framework.
            stop: the stop criterion handed to it at each one-step inclusion.
            start: where the motion begins.
            until: when it ends [s].
            states: states of the laws in the step that led to ``start``, None if there was none.

        Raises:
            StepError, MotionError: if the motion cannot be continued.
            Exception: whatever the solver or the system raises in a fixed step.
        """


@dataclass(frozen=True)
class Moreau(Stepper):
    """Moreau's midpoint rule with a fixed step, the last of which reaches or passes the end.

    Attributes:
        step: Δt [s]; the scene's if None.
    """

    step: float | None = None

    locates_switches: ClassVar[bool] = False
    holds_forces: ClassVar[bool] = False

    def fitted(self, scene: Scene) -> Self:
        """Return the stepper with a size."""
        return self if self.step is not None else replace(self, step=scene.step_size)

    def shortest(self, scene: Scene) -> float:
        """Return Δt [s]."""
        return scene.step_size if self.step is None else self.step

    def resolution(self, scene: Scene) -> float:
        """Return Δt [s]."""
        return self.shortest(scene)

    def rule(self, scene: Scene, solver: ContactSolver, stop: Any) -> MidpointRule:
        """Return what takes the steps."""
        return MidpointRule(scene.system, solver, stop, self.shortest(scene), depth=scene.depth)

    def check(self, scene: Scene, solver: ContactSolver, begin: float, until: float) -> None:
        """Look at Δt; it must not be longer than the motion."""
        length = self.shortest(scene)
        if not 0.0 < length < math.inf:
            raise ProblemError(f"step of Moreau must be positive and finite, got {length} s.")
        if length > until - begin:
            raise ProblemError(f"step of Moreau, {length} s, must not be longer than the duration, {until - begin} s.")

    def steps(
        self, scene: Scene, solver: ContactSolver, stop: Any, start: State, until: float, states: LawStates | None
    ) -> Iterator[AcceptedStep]:
        """Yield the steps, each timed without what it compiles."""
        rule, clock, state = self.rule(scene, solver, stop), WarmClock(), start
        while not self.ends(scene, state, until):
            step, seconds = clock.step(rule, state)
            check_finite(state, step.state)
            yield AcceptedStep(state, step.state, ((step, rule.time_step),), seconds=seconds)
            state = step.state


class Variable(Stepper):
    """A variable step; the options of every one are the attributes here.

    Attributes:
        tolerance: relative error of one step.
        min_step: to which switching points are located [s].
        max_step: longest step [s]; the scene's if None.
        search: how switching points are located: "anticipating", "nested" intervals or "last" step only.
    """

    tolerance: float
    min_step: float
    max_step: float | None
    search: str

    def __post_init__(self) -> None:
        if self.search not in SEARCHES:
            raise ProblemError(f"there is no search {self.search!r}{suggestion(self.search, SEARCHES)}")

    @abstractmethod
    def scheme(self) -> Scheme:
        """Return how smooth steps are taken."""

    def shortest(self, scene: Scene) -> float:
        """Return Δt_min [s]."""
        return self.min_step

    def rule(self, scene: Scene, solver: ContactSolver, stop: Any) -> VariableStep:
        """Return what takes the steps."""
        longest = scene.longest_step if self.max_step is None else self.max_step
        search = SEARCHES[self.search]
        return VariableStep(scene.system, solver, stop, self.tolerance, self.min_step, longest, self.scheme(), search)

    def check(self, scene: Scene, solver: ContactSolver, begin: float, until: float) -> None:
        """Look at the options; Δt_min must separate times."""
        self.rule(scene, solver, None).check_times(begin, until)

    def steps(
        self, scene: Scene, solver: ContactSolver, stop: Any, start: State, until: float, states: LawStates | None
    ) -> Iterator[AcceptedStep]:
        """Yield the accepted steps, when kernels are compiled."""
        rule = self.rule(scene, solver, stop)
        warm_up(rule, start, until, states)
        yield from rule.steps(start, until, states)


@dataclass(frozen=True)
class Extrapolated(Variable):
    """Moreau's rule, extrapolated between switching points.

    Attributes:
        levels: most sequences of one extrapolation.
    """

    tolerance: float = 1e-7
    min_step: float = 1e-9
    max_step: float | None = None
    levels: int = 4
    search: str = "anticipating"

    def scheme(self) -> Scheme:
        """Return the extrapolation."""
        return Extrapolation(self.levels)


@dataclass(frozen=True)
class StepDoubling(Variable):
    """The paper's stepper: one step against two halves, and nested intervals."""

    tolerance: float = 1e-5
    min_step: float = 1e-7
    max_step: float | None = None
    search: str = "nested"

    def scheme(self) -> Scheme:
        """Return the one step against two."""
        return DoublingScheme()


@dataclass(frozen=True)
class EventDriven(Stepper):
    """The event-driven reference: smooth motion between events, for systems of few contacts given by functions.

    Its solver finds the impulses of impacts and the forces after events, to a residual of 1e-9 or better.

    Attributes:
        tolerance: relative error of the integration of smooth motion.
        max_step: longest time between two states that are noted [s]; the scene's if None.
        flight: time between two impacts [s] below which they are taken to accumulate.
    """

    tolerance: float = 1e-13
    max_step: float | None = None
    flight: float = 1e-7

    holds_forces: ClassVar[bool] = False
    shows_solves: ClassVar[bool] = False
    uses_last_impulses: ClassVar[bool] = False

    def shortest(self, scene: Scene) -> float:
        """Return the shortest flight [s]."""
        return self.flight

    def rule(self, scene: Scene, solver: ContactSolver, stop: Any) -> integrator.EventDriven:
        """Return the integrator."""
        if not isinstance(scene.system, MechanicalSystem):
            raise ProblemError(
                "EventDriven follows scenes given by functions M, h, g and W (woodpecker), not this one."
            )
        longest = self._length(scene)
        return integrator.EventDriven(
            scene.system, solver, stop, relative_tolerance=self.tolerance, longest_step=longest, resolution=self.flight
        )

    def steps(
        self, scene: Scene, solver: ContactSolver, stop: Any, start: State, until: float, states: LawStates | None
    ) -> Iterator[AcceptedStep]:
        """Yield the motion at the ends of its phases and at times between them."""
        counting, begin, began = _Counting(solver), start, perf_counter()
        for piece in self.rule(scene, counting, stop).phases(start, until):
            seconds, solves = perf_counter() - began, counting.taken()
            count = max(1, math.ceil((piece.end.time - begin.time) / self._length(scene)))
            for time in np.linspace(begin.time, piece.end.time, count + 1)[1:-1].tolist():
                end = piece.at(time)
                yield AcceptedStep(begin, end, (), solves=0)
                begin = end
            switches = tuple(SwitchingPoint(e.time, e.time, e.law, e.contact, e.before, e.after) for e in piece.events)
            yield AcceptedStep(begin, piece.end, (), switches=switches, solves=solves, seconds=seconds)
            begin, began = piece.end, perf_counter()

    def _length(self, scene: Scene) -> float:
        return scene.longest_step if self.max_step is None else self.max_step


@dataclass
class _Counting:
    """A solver whose problems are counted."""

    solver: ContactSolver
    count: int = 0

    def prepare(self, problem: ContactProblem) -> Any:
        self.count += 1
        return self.solver.prepare(problem)

    def taken(self) -> int:
        """Return how many problems there were since the last call."""
        count, self.count = self.count, 0
        return count


STEPPERS: dict[str, type[Stepper]] = {kind.__name__: kind for kind in (Moreau, Extrapolated, StepDoubling, EventDriven)}
"""Steppers by name."""

EXAMPLE = "Extrapolated(tolerance=1e-8)"

_TYPES = {str: (str, "a name"), int: (int, "a whole number")}
"""Types of values, and words for them, by the type of the default; all others are numbers."""


def make_stepper(text: str) -> Stepper:
    """Return a stepper: ``make_stepper("Moreau(step=5e-4)")``.

    Raises:
        ProblemError: for an unknown name, option or search, with the nearest one, or a value of the wrong kind.
    """
    written = read_name(text, "stepper", EXAMPLE, ProblemError)
    name = written.plain
    if name not in STEPPERS:
        raise ProblemError(f"there is no stepper {name!r}{suggestion(name, STEPPERS)}")
    kind: Any = STEPPERS[name]
    if written.parts:
        raise ProblemError(f"cannot read {text!r:.200} as a stepper; name its options: {EXAMPLE}.")
    known = {field.name: field.default for field in fields(kind)}
    check_options(name, written.options, known, ProblemError)
    for option, value in written.options.items():
        if value is None and known[option] is None:  # a number of the scene
            continue
        types, words = _TYPES.get(type(known[option]), ((int, float), "a number"))
        if not isinstance(value, types) or isinstance(value, bool):
            raise ProblemError(f"{option} of {name} must be {words}, got {value!r}.")
    stepper: Stepper = kind(**written.options)
    return stepper
