"""Event-driven integration of systems with few contacts, an independent reference for time stepping.

During a smooth phase every contact keeps its mode: open, stick, slip forwards or slip backwards. Phases are integrated
by an explicit Runge–Kutta method of order 8 under the contact laws at acceleration level (see ``acceleration``). A
phase ends at the first event:

    open contact        g falls to 0                                    impact, see below
    closed contact      λ_N falls to 0                                  it opens
    sticking contact    μ λ_N − |λ_T| falls to 0                        it begins to slip against λ_T
    slipping contact    γ_T reaches 0                                   it sticks, or slips the other way

An impact solves one contact problem with all contacts that are closed or hit: −(G Λ + (I + ε) Wᵀu) ∈ N_C(Λ), the impact
law of Moreau's rule. After the impact, contacts with γ_N = 0 are closed, and contacts with γ_N > 0 are open. A closed
contact slips if γ_T ≠ 0.

The inclusion at acceleration level determines the modes of the next phase. It is one contact problem for all contacts
with γ_N = 0; those with γ_T = 0 may stick, or begin to slip in the direction of γ̇_T. The problem is degenerate for the
contact of the event, where λ_N = 0 = γ̇_N, or |λ_T| = μ λ_N and γ̇_T = 0. That contact therefore opens or slips, as the
sign of its event function indicates, and the inclusion determines the modes of the other contacts only.

After a contact has opened, its gap velocity is monitored until it becomes negative, and then its gap. The zero of the
gap at the beginning of a flight is therefore not mistaken for its end, however short the flight.

The given solver solves impacts and accelerations; ``Enumeration`` solves them exactly. If friction permits several
solutions, the one that the solver finds is used. If contacts are redundant, the forces of least norm are used. These
forces also determine when one of several sticking contacts begins to slip.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ....arrays import FloatArray
from ....contact.judge import judge
from ....contact.problem import ContactProblem
from ....contact.solver import Stop
from ....errors import ProblemError, ProxbenchError, error_text
from ...bodies.system import MechanicalSystem
from ...state import State
from ..midpoint import ContactSolver
from ..step import LawName, LawState
from .acceleration import AccelerationLaws, Modes, least_change
from .events import Trigger, TriggerFactory
from .motion import AccumulationError, Event, Motion, MotionError, Phase

ROUNDING = 1e-12
"""Velocities and accelerations below this fraction of the largest ones in the same problem count as zero."""

SIMULTANEOUS = 1e-6
"""Contacts that would hit within this fraction of the shortest flight count as simultaneous."""

TRUSTED_RESIDUAL = 1e-9
"""Largest judged residual of an accepted solution."""

MAX_EVENTS_AT_ONCE = 100
"""Largest number of phases within the shortest flight; more indicate that no mode is consistent."""

ABSOLUTE_TOLERANCE = 1e-15
"""Absolute tolerance of the integration of smooth phases, in the units of q and u."""

MAX_START_GAP = 1e-6
"""Largest gap or penetration [m] at which a contact counts as closed at the start; its gap is then set to 0."""


@dataclass(eq=False)
class Integration:
    """A motion in progress.

    Attributes:
        system: the mechanical system.
        solver: solves impacts and accelerations.
        stop: the stopping criterion of each solve.
        start: the initial state.
        tolerance: relative tolerance of the integration of smooth phases.
        longest_step: longest time between two states [s].
        flight: shortest flight [s]; see ``EventDriven``.
        events: the events so far, in order of time.
        phases: the smooth phases so far.
        time: the current time [s].
        position: the current q, shape (n,).
        velocity: the current u, shape (n,).
        modes: the current mode of each contact.
        armed: whether the gap of an open contact is monitored, instead of its gap velocity, shape (n_contacts,).
    """

    system: MechanicalSystem
    solver: ContactSolver
    stop: Stop
    start: State
    tolerance: float
    longest_step: float
    flight: float
    events: list[Event] = field(default_factory=list)
    phases: list[Phase] = field(default_factory=list)
    _impact_times: dict[int, list[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.time = self.start.time
        self.laws = AccelerationLaws(self.system)
        self.width, self.n = self.laws.width, len(self.start.position)
        self.position, self.velocity = self.start.position.copy(), self.start.velocity.copy()
        n_contacts = len(np.asarray(self.system.friction))
        self.modes = Modes(np.zeros(n_contacts, dtype=np.bool_), np.zeros(n_contacts))
        self.armed = np.ones(n_contacts, dtype=np.bool_)

    def motion(self) -> Motion:
        """Return the motion computed so far."""
        return Motion(tuple(self.events), tuple(self.phases), self._state())

    def advance_to(self, until: float) -> Iterator[None]:
        """Advance to the time ``until`` [s], phase by phase.

        Yields:
            None after each phase, so that the caller may read the current state.

        Raises:
            MotionError: if the motion cannot start or continue; it has the motion computed so far.
        """
        phase_starts = deque([-np.inf], maxlen=MAX_EVENTS_AT_ONCE)
        try:
            self.begin()
            while self.time < until:
                if len(phase_starts) == MAX_EVENTS_AT_ONCE and self.time - phase_starts[0] < self.flight:
                    raise MotionError(
                        f"at t = {self.time:.9g} s the contact modes change {MAX_EVENTS_AT_ONCE} times within "
                        f"{self.flight:.0e} s, because no modes are consistent within rounding error; use a "
                        "time-stepping method, such as Moreau.",
                        self.motion(),
                    )
                phase_starts.append(self.time)
                self.advance(until)
                yield
        except ProxbenchError:
            raise
        except Exception as failure:
            message = f"after t = {self.time:.9g} s the motion cannot be continued: {error_text(failure)}."
            raise MotionError(message, self.motion()) from failure

    def begin(self) -> None:
        """Find the modes at the start."""
        try:
            self.system.check(self.position, self.velocity)
        except ProblemError as reason:
            raise MotionError(f"the motion cannot start at t = {self.time:.9g} s: {reason}", self.motion()) from None
        self._directions = self.system.directions(self.position)
        gap, velocity = self.system.gap(self.position), self._contact_velocity()
        if gap.min(initial=0.0) < -MAX_START_GAP:
            contact = int(np.argmin(gap))
            raise MotionError(
                f"contact {contact} penetrates by {-gap[contact]:.2e} m at the start; separate the bodies.",
                self.motion(),
            )
        touching = gap <= MAX_START_GAP
        margin = ROUNDING * np.abs(velocity).max(initial=0.0)
        hitting = touching & (velocity[:, 0] < -margin)
        closed = touching & (np.abs(velocity[:, 0]) <= margin)
        self.armed = ~touching
        self.modes = Modes(closed, self._slip(closed, velocity, margin))
        if hitting.any():
            self._impact(hitting)
        else:
            self._begin_phase(self.modes)
            self.events.clear()  # determining the initial modes is not an event

    def advance(self, until: float) -> None:
        """Integrate one phase, up to ``until`` or to the event that ends it."""
        triggers = TriggerFactory(self.laws, self.modes, self.armed).triggers(self.position, self.velocity)
        for trigger in triggers:
            if trigger.is_due(self.position, self.velocity):
                self._switch(trigger)
                return
        from scipy.integrate import solve_ivp  # takes 0.2 s to import, and few scenes need it

        solution = solve_ivp(
            self._rates,
            (self.time, until),
            np.concatenate([self.position, self.velocity]),
            method="DOP853",
            rtol=self.tolerance,
            atol=ABSOLUTE_TOLERANCE,
            max_step=self.longest_step,
            events=[trigger.for_scipy() for trigger in triggers],
            dense_output=True,
        )
        if solution.status < 0:
            raise MotionError(
                f"the integration of a smooth phase failed at t = {solution.t[-1]:.9g} s: {solution.message}",
                self.motion(),
            )
        self.phases.append(Phase(self.time, float(solution.t[-1]), solution.sol))
        self.time = float(solution.t[-1])
        self.position, self.velocity = solution.y[: self.n, -1].copy(), solution.y[self.n :, -1].copy()
        self._check_directions()
        for trigger, times in zip(triggers, solution.t_events or [], strict=True):
            if len(times):
                self._switch(trigger)
                return

    def _rates(self, time: float, state_vector: FloatArray) -> FloatArray:
        position, velocity = state_vector[: self.n], state_vector[self.n :]
        acceleration, _ = self.laws.motion(position, velocity, self.modes)
        if not np.isfinite(acceleration).all():  # otherwise solve_ivp would not end
            raise MotionError(f"the motion is no longer finite at t = {time:.9g} s.", self.motion())
        return np.concatenate([velocity, acceleration])

    def _switch(self, trigger: Trigger) -> None:
        """Find the modes after an event."""
        contact, modes = trigger.contact, self.modes
        if trigger.kind == "turn":
            self.armed[contact] = True
            return
        if trigger.kind == "hit":
            velocity = self._contact_velocity()[:, 0]
            is_imminent = self.system.gap(self.position) + SIMULTANEOUS * self.flight * velocity <= 0.0
            hitting = ~modes.closed & self.armed & is_imminent & (velocity < 0.0)
            hitting[contact] = True
            self._impact(hitting)
            return
        closed, slip = modes.closed.copy(), modes.slip.copy()
        closed[contact] = trigger.kind != "open"
        slip[contact] = trigger.direction
        self._begin_phase(Modes(closed, slip))

    def _impact(self, hitting: NDArray[np.bool_]) -> None:
        """Apply the impact law to all contacts that are closed or hit, and find the modes after it."""
        is_involved = self.modes.closed | hitting
        contacts = np.flatnonzero(is_involved)
        rows = (self.width * contacts[:, None] + np.arange(self.width)).ravel()
        directions = self.system.directions(self.position)[:, rows]
        responses = np.linalg.solve(self.system.mass(self.position), directions)
        before = directions.T @ self.velocity
        restitution = np.repeat(np.asarray(self.system.restitution_tangential)[contacts], self.width)
        restitution[:: self.width] = np.asarray(self.system.restitution_normal)[contacts]
        delassus, friction = directions.T @ responses, np.asarray(self.system.friction)[contacts]
        problem = ContactProblem.from_delassus(
            0.5 * (delassus + delassus.T), (1.0 + restitution) * before, friction, self.width
        )
        solution = self._solve(problem, "impact")
        self.velocity = self.velocity + responses @ solution
        impulses = np.zeros((len(is_involved), self.width))
        impulses[contacts] = solution.reshape(-1, self.width)
        margin = ROUNDING * np.abs(before).max(initial=0.0)
        after = self._contact_velocity()
        closed = is_involved & (after[:, 0] <= margin)
        self._begin_phase(Modes(closed, self._slip(closed, after, margin)), hitting, impulses)
        self._check_accumulation(hitting & (after[:, 0] > margin))

    def _begin_phase(
        self, candidates: Modes, hitting: NDArray[np.bool_] | None = None, impulses: FloatArray | None = None
    ) -> None:
        """Begin a phase: project onto the constraints, and find the modes from the laws at acceleration level."""
        self._project(candidates)
        closed, slip = candidates.closed.copy(), candidates.slip.copy()
        if closed.any():
            try:
                problem = self.laws.problem(self.position, self.velocity, candidates)
            except ProblemError as reason:
                raise MotionError(
                    f"at t = {self.time:.9g} s the laws at acceleration level do not form a valid contact problem: "
                    f"{str(reason).rstrip('.')}; friction may drive a slipping contact into penetration (Painlevé). "
                    "Use a time-stepping method, such as Moreau.",
                    self.motion(),
                ) from None
            accelerations = problem.relative_velocity(self._solve(problem, "acceleration"))
            margin = ROUNDING * np.abs(problem.free_velocity).max(initial=0.0)
            rows = self.laws.constraints(self.position, self.velocity, candidates).rows
            for row, acceleration in zip(rows.tolist(), accelerations.tolist(), strict=True):
                contact, is_friction = divmod(row, self.width)
                if is_friction:
                    slip[contact] = np.sign(acceleration) if abs(acceleration) > margin else 0.0
                else:
                    closed[contact] = acceleration <= margin
        modes = Modes(closed, np.where(closed, slip, 0.0))
        self._record(modes, np.zeros_like(closed) if hitting is None else hitting, impulses)
        self.armed[self.modes.closed | modes.closed | (False if hitting is None else hitting)] = False
        self.modes = modes

    def _project(self, candidates: Modes) -> None:
        """Project q and u onto g = 0, γ_N = 0 and γ_T = 0 of sticking contacts, in the kinetic metric."""
        directions = self.system.directions(self.position)
        normal = self.width * np.flatnonzero(candidates.closed)
        if not len(normal):
            return
        mass = self.system.mass(self.position)
        gap = self.system.gap(self.position)[candidates.closed]
        self.position = self.position - least_change(mass, directions[:, normal], gap)
        rows = self.laws.constraints(self.position, self.velocity, candidates).rows
        constrained = self.system.directions(self.position)[:, rows]
        self.velocity = self.velocity - least_change(mass, constrained, constrained.T @ self.velocity)

    def _check_directions(self) -> None:
        """Raise ``ProblemError`` if W has changed and the system has no ``direction_rates``."""
        directions, scale = self.system.directions(self.position), np.abs(self._directions).max(initial=0.0)
        if self.system.direction_rates is None and np.abs(directions - self._directions).max() > ROUNDING * scale:
            raise ProblemError("the force directions W depend on q; give the system 'direction_rates', (q, u) ↦ Ẇᵀ u.")

    def _record(self, modes: Modes, hitting: NDArray[np.bool_], impulses: FloatArray | None) -> None:
        """Record the changes of contact states as events."""
        state, no_impulse = self._state(), np.zeros(self.width)

        def add_event(law: LawName, i: int, before: LawState, after: LawState, impulses_of_event: FloatArray) -> None:
            self.events.append(Event(self.time, law, i, before, after, state, impulses_of_event))

        for i in range(len(modes.closed)):
            was_closed, is_closed = bool(self.modes.closed[i]), bool(modes.closed[i])
            if hitting[i] and impulses is not None:
                add_event("unilateral", i, "open", "closed", impulses[i])
            if (was_closed or hitting[i]) and not is_closed:
                add_event("unilateral", i, "closed", "open", no_impulse)
            if was_closed and is_closed and self.width == 2 and self.modes.sticks(i) != modes.sticks(i):
                friction: tuple[LawState, LawState] = ("slip", "stick") if modes.sticks(i) else ("stick", "slip")
                add_event("friction", i, *friction, no_impulse)

    def _check_accumulation(self, bouncing: NDArray[np.bool_]) -> None:
        """Raise ``AccumulationError`` if the flights of a contact become shorter than ``flight``."""
        for i in np.flatnonzero(bouncing).tolist():
            times = self._impact_times.setdefault(i, [])
            times.append(self.time)
            if len(times) < 3:
                continue
            flight, previous = times[-1] - times[-2], times[-2] - times[-3]
            if flight < min(self.flight, previous):
                time_to_rest = flight * flight / (previous - flight)
                raise AccumulationError(self.motion(), i, len(times), flight, self.time + time_to_rest)

    def _solve(self, problem: ContactProblem, level: str) -> FloatArray:
        """Return the solution of a contact problem; raise ``MotionError`` if its residual is too large."""
        solution = self.solver.prepare(problem).solve(self.stop, None)
        residual = judge(problem, solution.impulses).residual
        if not residual <= TRUSTED_RESIDUAL:
            raise MotionError(
                f"at t = {self.time:.9g} s the solver reaches only a residual of {residual:.1e} for the {level} law "
                f"({solution.status}); use Enumeration for up to six contacts, or a smaller tolerance.",
                self.motion(),
            )
        impulses: FloatArray = solution.impulses
        return impulses

    def _state(self) -> State:
        return State(self.time, self.position.copy(), self.velocity.copy())

    def _contact_velocity(self) -> FloatArray:
        """Return γ = Wᵀ u [m/s], shape (n_contacts, width)."""
        velocity: FloatArray = self.system.directions(self.position).T @ self.velocity
        return velocity.reshape(-1, self.width)

    def _slip(self, closed: NDArray[np.bool_], velocity: FloatArray, margin: float) -> FloatArray:
        """Return the direction in which closed contacts slip, 0 for |γ_T| up to ``margin``."""
        if self.width == 1:
            return np.zeros(len(closed))
        tangential = velocity[:, 1]
        return np.where(closed & (np.abs(tangential) > margin), np.sign(tangential), 0.0)
