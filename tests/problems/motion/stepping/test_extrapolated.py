"""Extrapolation: refused arguments, the starts of solvers, and the chosen number of sequences."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.inclines import BlockOnIncline
from proxbench.problems.motion.scenes.resting import Stack
from proxbench.problems.motion.scenes.scene import bare_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.sequences import StepCounter, take_sequence
from proxbench.problems.motion.stepping.step import AcceptedStep
from proxbench.solvers import Solution, Stop, create

STOP = Stop(1e-13, 100_000)


def motion(system: Any, start: State, until: float, solver: Any = None, **options: Any) -> list[AcceptedStep]:
    still = State(0.0, np.ones(1), np.zeros(1))
    scene = replace(bare_scene("own", {}, damped(), still), system=system, start=start)
    chosen: Any = {"tolerance": 1e-6, "min_step": 1e-8, "max_step": 2e-2, **options}
    return list(Extrapolated(**chosen).steps(scene, solver or create("SORprox"), STOP, start, until))


def damped() -> MechanicalSystem:
    """A unit mass on a damped spring, and a contact that is never reached."""
    return MechanicalSystem(
        mass=lambda position: np.eye(1),
        force=lambda position, velocity: -position - 0.5 * velocity,
        gap=lambda position: position + 10.0,
        directions=lambda position: np.ones((1, 1)),
        friction=[0.0],
        restitution_normal=[0.0],
        restitution_tangential=[0.0],
        rows_per_contact=1,
    )


@pytest.mark.parametrize(("turned", "is_refused"), [(1.0, False), (0.0, False), (-1e-3, True), (-1.0, True)])
def test_an_extrapolated_velocity_must_not_slip_against_the_friction_of_its_steps(
    turned: float, is_refused: bool
) -> None:
    block = BlockOnIncline(slope=0.3, friction=0.5, speed=1.0)
    counter = StepCounter(block.system(), create("SORprox"), STOP)
    sequence = take_sequence(counter, block.start(), 1e-2, 2, None)
    assert sequence.end is not None
    assert sequence.states.slips
    last = np.concatenate([sequence.end.position, turned * sequence.end.velocity])
    found = Extrapolated().complete_attempt(replace(sequence, errors=[0.0]), last, 0.01)
    assert (found.end is None) is is_refused
    if found.end is not None:
        assert np.array_equal(np.concatenate([found.end.position, found.end.velocity]), last)
        assert found.end.time == 0.01


class Recording:
    """SORprox that records the distances between its initial and its returned impulses."""

    def __init__(self) -> None:
        self.solver, self.distances = create("SORprox"), list[float]()

    def prepare(self, problem: ContactProblem) -> "RecordingPrepared":
        return RecordingPrepared(self.solver.prepare(problem), self.distances)


@dataclass
class RecordingPrepared:
    prepared: Any
    distances: list[float]

    def solve(self, stop: Stop, start: Any = None) -> Solution:
        solution: Solution = self.prepared.solve(stop, start)
        if start is not None and np.any(start):
            self.distances.append(float(np.abs(start - solution.impulses).max() / solution.impulses.max()))
        return solution


def test_solvers_start_from_impulses_of_the_same_force_whatever_the_step() -> None:
    """At rest, forces are constant, so impulses Λ = F Δt over steps of any length are known in advance."""
    stack, recording = Stack(masses=(1.0, 2.0)), Recording()
    steps = motion(stack.system(), stack.start(), 0.1, recording)
    lengths = {round(length, 12) for step in steps for _, length in step.substeps}
    assert len(lengths) > 3
    assert len(recording.distances) > 10
    assert max(recording.distances[2:]) <= 1e-9


def test_more_sequences_are_taken_where_they_promise_less_work() -> None:
    """k sequences take k (k + 1)/2 steps. A choice by another cost model takes twice as many steps here."""
    steps = motion(damped(), State(0.0, np.ones(1), np.zeros(1)), 6.0, tolerance=1e-3, max_step=5.0)
    assert sum(step.solves for step in steps) <= 90
