"""Long simulations do not drift, gain energy or leak memory.

With PROXBENCH_PROFILE=full, they have their full length; otherwise, they are short enough for daily tests.
"""

import gc
import os

import numpy as np
import psutil
import pytest
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.simulation import Simulation
from proxbench.problems.motion.scenes.resting import Stack
from proxbench.problems.motion.scenes.woodpecker import PERIOD
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.trajectories.limit_cycle import CycleSequence, find_cycles
from proxbench.solvers import Status, Stop, create

FULL = os.environ.get("PROXBENCH_PROFILE") == "full"

BALLS, REST_SECONDS = (500, 20.0) if FULL else (30, 1.0)
PERIODS = 500 if FULL else 6
STACK_SECONDS = 60.0 if FULL else 3.0
POURED = 1000 if FULL else 60

MAX_ADDED_BYTES = 40 * 2**20
"""Memory that a simulation may add [bytes]: for its rows, numba and the allocator."""


def periods_of(simulation: Simulation) -> CycleSequence:
    known = simulation.plan.scene.limit_cycle
    assert known is not None
    return find_cycles(known, simulation.switch_events, simulation.times, simulation.trajectory[:, 0])


def memory() -> int:
    gc.collect()
    return psutil.Process().memory_info().rss


def energy(simulation: Simulation) -> np.ndarray:  # type: ignore[type-arg]
    return simulation.steps["kinetic_energy"] + simulation.steps["potential_energy"]


def test_settled_pile_remains_at_rest() -> None:
    settling = 2.0
    simulate(make_simulation_plan("pile", {"balls": BALLS}, duration=0.3))  # compile kernels, fill caches
    before = memory()
    pile = simulate(make_simulation_plan("pile", {"balls": BALLS}, duration=settling + REST_SECONDS, states=1))
    grown = memory() - before
    rests = pile.steps["time"] > settling
    rest, energies = pile.steps[rests], energy(pile)[rests]
    quarter = len(rest) // 4
    print(
        f"pile of {BALLS}: {pile.wall_seconds:.0f} s wall, {pile.unsolved.sum()} steps unsolved while it settles; "
        f"penetration {rest['penetration'][:quarter].max():.4f} first, {rest['penetration'][-quarter:].max():.4f} "
        f"last quarter, energy {energies[0]:.9g} to {energies[-1]:.9g} J, "
        f"largest residual {rest['residual'].max():.1e}, memory {grown / 2**20:+.1f} MiB"
    )
    assert np.isfinite(energies).all()
    assert not pile.unsolved[rests].any()
    assert rest["penetration"][-quarter:].max() <= 1.02 * rest["penetration"][:quarter].max()
    assert np.maximum.accumulate(energies)[-1] <= energies[0] * (1.0 + 1e-6)
    assert rest["kinetic_energy"].max() <= 1e-4 * abs(energies[0])
    assert grown < MAX_ADDED_BYTES


def test_woodpecker_stays_on_its_limit_cycle() -> None:
    simulate(make_simulation_plan("woodpecker", {"start": "cycle"}, duration=0.3))
    before = memory()
    toy = simulate(make_simulation_plan("woodpecker", {"start": "cycle"}, duration=(PERIODS + 0.5) * PERIOD))
    grown = memory() - before
    motion = periods_of(toy)
    periods = np.diff(motion.sections)
    print(
        f"woodpecker: {motion.count + 1} periods, {toy.steps['solves'].sum()} solves, {toy.wall_seconds:.0f} s wall, "
        f"largest deviation of a period {np.abs(periods / PERIOD - 1).max():.1e}, deepest penetration "
        f"{toy.steps['penetration'].max():.1e}, memory {grown / 2**20:+.1f} MiB"
    )
    assert len(motion.cycles) >= PERIODS - 1
    assert all(cycle.is_published for cycle in motion.cycles)
    assert np.abs(periods / PERIOD - 1.0).max() < 1e-6
    assert np.isfinite(toy.trajectory).all()
    assert grown < MAX_ADDED_BYTES


@pytest.mark.skipif(not FULL, reason="needs ninety periods")
def test_woodpecker_converges_to_its_limit_cycle_from_the_published_start() -> None:
    toy = simulate(make_simulation_plan("woodpecker", {"start": "published"}, duration=91.0 * PERIOD))
    motion = periods_of(toy)
    assert motion.count == 90
    period, descent = motion.relative_deviations(30)
    print(f"woodpecker from the published start, periods 61 to 90: period {period:+.1e}, descent {descent:+.1e}")
    assert abs(period) < 1e-6
    assert abs(descent) < 1e-6


@pytest.mark.parametrize("solver", ["SORprox", "NSGS"])
def test_stack_of_ten_remains_at_rest(solver: str) -> None:
    stack, length = Stack((1.0,) * 10), 1e-3
    moreau = MidpointRule(stack.system(), create(solver), Stop(1e-10, 100_000), length)
    start = state = stack.start()
    moreau.step(state)  # loads the kernels
    count, depths, before = round(STACK_SECONDS / length), [], memory()
    for step in moreau.steps(state, count):
        assert step.status is Status.SOLVED
        assert step.contacts is not None
        depths.append(-float(step.contacts.gap.min()))
        state = step.state
    grown = memory() - before
    moved = float(np.abs(state.position - start.position).max())
    print(f"stack of 10, {STACK_SECONDS:g} s: moved {moved:.1e} m, speed {np.abs(state.velocity).max():.1e} m/s")
    assert moved < 1e-8
    assert np.abs(state.velocity).max() < 1e-8
    assert max(depths[-10:]) <= max(depths[:10]) + 1e-8
    assert grown < MAX_ADDED_BYTES


def test_emptying_a_funnel_twice_gives_identical_results() -> None:
    plan = make_simulation_plan("funnel", {"balls": POURED, "outlet": 4.5}, duration=12.0)
    first = simulate(plan)
    before = memory()
    again = simulate(plan)
    grown = memory() - before
    energies = energy(again)
    print(
        f"funnel of {POURED}: {first.ending} at {first.state.time:.3f} s, {first.wall_seconds:.0f} and "
        f"{again.wall_seconds:.0f} s wall, deepest after 0.4 s "
        f"{again.steps['penetration'][again.steps['time'] > 0.4].max(initial=0.0):.4f}, memory {grown / 2**20:+.1f} MiB"
    )
    assert first.ending == again.ending == "emptied"
    assert not first.unsolved.any()
    assert np.isfinite(energies).all()
    np.testing.assert_array_equal(first.state.position, again.state.position)
    np.testing.assert_array_equal(first.steps["kinetic_energy"], again.steps["kinetic_energy"])
    assert grown < MAX_ADDED_BYTES
