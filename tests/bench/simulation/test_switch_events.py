"""Switching points of the woodpecker in the order of the published table, and its period and descent."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.simulation import Simulation
from proxbench.problems.motion.scenes.woodpecker import PERIOD, SWITCH_EVENTS
from proxbench.problems.motion.trajectories.limit_cycle import CycleSequence, find_cycles


def periods(simulation: Simulation) -> CycleSequence:
    known = simulation.plan.scene.limit_cycle
    assert known is not None
    return find_cycles(known, simulation.switch_events, simulation.times, simulation.trajectory[:, 0])


@pytest.fixture(scope="module")
def pecking() -> Simulation:
    return simulate(make_simulation_plan("woodpecker", {"start": "cycle"}, duration=2.8 * PERIOD))


@pytest.mark.slow
def test_complete_periods_have_the_incidents_of_the_published_table(pecking: Simulation) -> None:
    motion = periods(pecking)
    assert len(motion.cycles) == 2
    assert all(cycle.is_published for cycle in motion.cycles)
    for cycle in motion.cycles:
        assert np.abs(cycle.deviations).max() < 1e-6


def test_period_and_descent_are_those_of_the_limit_cycle(pecking: Simulation) -> None:
    motion = periods(pecking)
    assert motion.count == 1
    assert np.abs(motion.relative_deviations(1)) == pytest.approx([0.0, 0.0], abs=1e-5)


def test_a_period_with_an_incident_too_many_is_not_the_published_one(pecking: Simulation) -> None:
    first = periods(pecking).cycles[0]
    doubled = replace(first, switch_events=(*first.switch_events, first.switch_events[-1]))
    assert not doubled.is_published


def test_incidents_are_in_order_of_time(pecking: Simulation) -> None:
    times = [event.time for event in pecking.switch_events]
    assert times == sorted(times)
    assert len(times) >= 2 * len(SWITCH_EVENTS)
