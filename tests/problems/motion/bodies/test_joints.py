"""General systems with contacts of different numbers of rows, and with joints."""

from dataclasses import dataclass, field
from math import cos, sin, sqrt
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.scene import bare_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.event_driven.event_driven import EventDriven
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Solution, Status, Stop, create

STOP = Stop(1e-13, 100_000)
GRAVITY, MASS, INERTIA, LENGTH, RESTITUTION = 9.81, 2.0, 0.05, 0.4, 0.5
SWING = MASS * GRAVITY * LENGTH / (INERTIA + MASS * LENGTH**2)
"""Coefficient of a physical pendulum, φ̈ = −SWING sin φ [1/s²]."""


def pendulum() -> MechanicalSystem:
    """A rod in the plane, q = (x, y, φ), on a hinge at the origin, which hits a stop at φ = 0."""
    mass, weight = np.diag([MASS, MASS, INERTIA]), np.array([0.0, -MASS * GRAVITY, 0.0])

    def directions(position: np.ndarray) -> np.ndarray:
        stop = [0.0, 0.0, 1.0]
        return np.array([stop, [1.0, 0.0, -LENGTH * cos(position[2])], [0.0, 1.0, -LENGTH * sin(position[2])]]).T

    return MechanicalSystem(
        mass=lambda position: mass,
        force=lambda position, velocity: weight,
        gap=lambda position: position[2:],
        directions=directions,
        friction=[0.0],
        restitution_normal=[RESTITUTION],
        restitution_tangential=[0.0],
        rows_per_contact=1,
        joint_rows=[2],
    )


def hanging(angle: float) -> State:
    return State(0.0, np.array([LENGTH * sin(angle), -LENGTH * cos(angle), angle]), np.zeros(3))


def energy(state: State) -> float:
    """Return the energy above that of rest at φ = 0 [J]."""
    kinetic = 0.5 * float(state.velocity**2 @ [MASS, MASS, INERTIA])
    return kinetic + MASS * GRAVITY * (float(state.position[1]) + LENGTH)


def hinge_error(state: State) -> float:
    x, y, angle = state.position
    return float(np.hypot(x - LENGTH * sin(angle), y + LENGTH * cos(angle)))


@pytest.mark.slow
def test_a_pendulum_on_a_hinge_swings_and_bounces_as_in_closed_form() -> None:
    """Energy is constant up to the stop, where the spin reverses and e² of the energy remains. Errors fall with Δt."""
    errors = []
    for time_step in (1e-3, 2.5e-4):
        first, lowest, state = energy(hanging(0.5)), 0.0, hanging(0.5)
        speeds = [0.0]
        for step in MidpointRule(pendulum(), create("SORprox"), STOP, time_step).steps(state, round(0.6 / time_step)):
            assert step.status is Status.SOLVED
            state = step.state
            speeds.append(float(state.velocity[2]))
            lowest = max(lowest, hinge_error(state))
        impact = int(np.argmax(np.array(speeds) > 0.0))
        assert speeds[impact - 1] == pytest.approx(-sqrt(2.0 * SWING * (1.0 - cos(0.5))), rel=20.0 * time_step)
        assert speeds[impact] == pytest.approx(-RESTITUTION * speeds[impact - 1], rel=20.0 * time_step)
        assert energy(state) == pytest.approx(RESTITUTION**2 * first, rel=20.0 * time_step)
        errors.append(lowest)
    assert errors[0] < 3e-4
    assert errors[1] < errors[0] / 3.0


@pytest.mark.slow
def test_a_joint_never_switches_and_a_variable_step_locates_the_impact() -> None:
    scene = bare_scene("pendulum", {}, pendulum(), hanging(0.5))
    stepper = Extrapolated(tolerance=1e-8, min_step=1e-8)
    steps = list(stepper.steps(scene, create("SORprox"), STOP, scene.start, 0.6))
    found = [(switch.contact, switch.law, switch.after) for step in steps for switch in step.switches]
    assert found == [(0, "unilateral", "closed"), (0, "unilateral", "open")]
    first = energy(scene.start)
    before = next(step for step in steps if step.switches).begin
    assert energy(before) == pytest.approx(first, rel=1e-4)
    assert energy(steps[-1].end) == pytest.approx(RESTITUTION**2 * first, rel=1e-4)


def coupled_blocks(slope: float, friction: float, masses: tuple[float, float]) -> MechanicalSystem:
    """Two blocks on an incline, q = (x₁, z₁, x₂, z₂), one behind the other on a rod; only the first has friction."""
    mass = np.diag(np.repeat(masses, 2))
    weight = GRAVITY * np.diag(mass) * np.tile([sin(slope), -cos(slope)], 2)
    columns = np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [1, 0, -1, 0]], dtype=np.float64).T
    return MechanicalSystem(
        mass=lambda position: mass,
        force=lambda position, velocity: weight,
        gap=lambda position: position[1::2],
        directions=lambda position: columns,
        friction=[friction, 0.0],
        restitution_normal=[0.0, 0.0],
        restitution_tangential=[0.0, 0.0],
        rows_per_contact=[2, 1],
        joint_rows=[1],
    )


def test_contacts_of_two_rows_and_of_one_slide_together_on_a_rod() -> None:
    slope, friction, masses = 0.6, 0.5, (1.0, 3.0)
    start = State(0.0, np.array([1.0, -1e-9, 0.0, -1e-9]), np.zeros(4))
    total = sum(masses)
    acceleration = GRAVITY * (sin(slope) - friction * masses[0] / total * cos(slope))
    rule = MidpointRule(coupled_blocks(slope, friction, masses), create("SORprox"), STOP, 1e-3)
    for step in rule.steps(start, 200):
        state = step.state
    assert state.velocity[::2] == pytest.approx(0.2 * acceleration, rel=1e-9)
    assert state.keys.tolist() == [0, 1, 2]
    forces = state.impulses / 1e-3
    normal = GRAVITY * cos(slope)
    assert forces[0] == pytest.approx([masses[0] * normal, -friction * masses[0] * normal], rel=1e-9)
    assert forces[1] == pytest.approx([masses[1] * normal, 0.0], rel=1e-9)
    assert forces[2] == pytest.approx([masses[1] * (GRAVITY * sin(slope) - acceleration), 0.0], rel=1e-9)


@dataclass
class Remembering:
    """A solver that stores the start and the result of each solve, row by row."""

    starts: list[Any] = field(default_factory=list)
    ends: list[Any] = field(default_factory=list)

    def prepare(self, problem: ContactProblem) -> "Remembering":
        self._prepared = create("SORprox").prepare(problem)
        return self

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        solution = self._prepared.solve(stop, start)
        self.starts.append(start.copy())
        self.ends.append(solution.impulses.copy())
        return solution


def test_a_solve_starts_from_the_last_impulses_key_by_key() -> None:
    solver = Remembering()
    list(MidpointRule(pendulum(), solver, STOP, 1e-3).steps(hanging(0.05), 400))
    hits = [number for number, end in enumerate(solver.ends) if len(end) == 3]
    assert hits
    for number, (before, start) in enumerate(zip(solver.ends[:-1], solver.starts[1:], strict=True), start=1):
        np.testing.assert_array_equal(start[-2:], before[-2:])  # the hinge keeps its key
        if number in hits:
            assert start[0] == (before[0] if number - 1 in hits else 0.0)


def test_equal_rows_by_number_and_one_by_one_are_the_same_system() -> None:
    def end(rows: Any) -> State:
        plain = coupled_blocks(0.6, 0.5, (1.0, 3.0))
        columns = plain.directions(np.zeros(4))[:, [0, 1, 2, 0]]
        system = MechanicalSystem(
            plain.mass, plain.force, plain.gap, lambda q: columns, [0.5, 0.0], [0.0, 0.0], [0.0, 0.0], rows
        )
        start = State(0.0, np.array([1.0, -1e-9, 0.0, -1e-9]), np.zeros(4))
        return list(MidpointRule(system, create("SORprox"), STOP, 1e-3).steps(start, 20))[-1].state

    one, other = end(2), end([2, 2])
    assert one.velocity.tobytes() == other.velocity.tobytes()


@pytest.mark.parametrize(
    ("rows", "joints", "what"),
    [
        ([1, 2], [], "rows_per_contact must be 1, 2 or 3, for all or each of 1 contacts"),
        ([4], [], "rows_per_contact must be"),
        (1, [0], "joint_rows must be positive"),
    ],
)
def test_inconsistent_row_counts_are_reported(rows: Any, joints: list[int], what: str) -> None:
    plain = pendulum()
    with pytest.raises(ProblemError, match=what):
        MechanicalSystem(plain.mass, plain.force, plain.gap, plain.directions, [0.0], [0.0], [0.0], rows, joints)


def test_the_event_driven_reference_refuses_joints() -> None:
    scene = bare_scene("pendulum", {}, pendulum(), hanging(0.5))
    with pytest.raises(ProblemError, match="equal numbers of rows and no joints"):
        EventDriven().check(scene, 0.0, 1.0)
