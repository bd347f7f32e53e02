"""The woodpecker's incidents in the order of the published table, and its period and descent."""

import numpy as np
import pytest
from proxbench.bench.variable.incidents import cycles, incidents, relative_deviations
from proxbench.bench.variable.plan import make_variable_plan
from proxbench.bench.variable.running import simulate_variable
from proxbench.bench.variable.simulation import VariableSimulation
from proxbench.problems.scenes.woodpecker import INCIDENTS, PERIOD


@pytest.fixture(scope="module")
def pecking() -> VariableSimulation:
    return simulate_variable(make_variable_plan("woodpecker", {"start": "cycle"}, duration=2.8 * PERIOD))


def test_complete_periods_have_the_incidents_of_the_published_table(pecking: VariableSimulation) -> None:
    motion = cycles(pecking)
    assert len(motion.cycles) == 2
    assert all(cycle.is_published for cycle in motion.cycles)
    for cycle in motion.cycles:
        assert np.abs(cycle.deviations).max() < 1e-6


def test_period_and_descent_are_those_of_the_limit_cycle(pecking: VariableSimulation) -> None:
    motion = cycles(pecking)
    assert motion.count == 1
    assert np.abs(relative_deviations(motion, 1)) == pytest.approx([0.0, 0.0], abs=1e-5)


def test_a_period_with_an_incident_too_many_is_not_the_published_one(pecking: VariableSimulation) -> None:
    first = cycles(pecking).cycles[0]
    doubled = type(first)((*first.incidents, first.incidents[-1]), first.section, first.height)
    assert not doubled.is_published


def test_incidents_are_in_order_of_time(pecking: VariableSimulation) -> None:
    times = [incident.time for incident in incidents(pecking)]
    assert times == sorted(times)
    assert len(times) >= 2 * len(INCIDENTS)
