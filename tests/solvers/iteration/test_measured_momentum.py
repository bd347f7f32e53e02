"""Measured momentum: its memory grows if sweeps are slow, shrinks if growth does not help, and never does harm."""

import numpy as np
import pytest
from proxbench.problems import judge, load
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.iteration.measured_momentum import FIRST_MEMORY, MAX_MEMORY, MeasuredMomentum
from proxbench.solvers.iteration.stopping import MAX_CHECK_INTERVAL

MEASURED = "SORprox(relaxation=1.1, momentum='measured', form='factors')"


def memories(rate: float, sweeps: int, rule: MeasuredMomentum | None = None) -> list[float]:
    """Return the memory after each tenth sweep, while the residual falls by exp(−rate) per sweep."""
    rule = rule or MeasuredMomentum()
    found = []
    for k in range(0, sweeps + 1, 10):
        rule.record_residual(k, np.exp(-rate * k))
        found.append(1.0 / (1.0 - rule.bound))
    return found


def test_fast_convergence_keeps_the_initial_memory() -> None:
    assert memories(0.051, 1000) == pytest.approx([FIRST_MEMORY] * 101)


def test_slow_convergence_doubles_the_memory_up_to_its_bound() -> None:
    found = memories(1e-4, 2000)
    assert found[1:3] == pytest.approx([FIRST_MEMORY, 2.0 * FIRST_MEMORY])
    assert np.diff(found).min() >= -1e-9
    assert found[-1] == pytest.approx(MAX_MEMORY)


def test_the_memory_stops_growing_at_that_of_critical_damping() -> None:
    """That memory is 1/(2√δ) for a linear mode that falls by exp(−δm) per sweep."""
    decay = 1e-3
    rule, residual = MeasuredMomentum(), 1.0
    for k in range(0, 1001, 10):
        rule.record_residual(k, residual)
        residual *= np.exp(-10.0 * decay / (1.0 - rule.bound))
    assert 0.5 <= 2.0 * np.sqrt(decay) / (1.0 - rule.bound) <= 2.0


def test_an_increase_of_memory_that_slows_sweeps_is_undone_and_retried_later() -> None:
    rule, residual, grown = MeasuredMomentum(), 1.0, []
    for k in range(0, 401, 10):
        rule.record_residual(k, residual)
        is_long = rule.bound > 1.0 - 0.9 / FIRST_MEMORY
        residual *= 1.0 if is_long else 0.9
        grown.append(is_long)
    trials = np.flatnonzero(np.diff(np.array(grown, dtype=int)) == 1)
    waits = np.diff(trials)
    assert len(trials) >= 3
    assert np.all(np.diff(waits) > 0)
    assert np.mean(grown) < 0.5


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
@pytest.mark.parametrize("name", ["funnel-1000", "funnel-planar-300", "pile-100", "pile-300"])
def test_as_few_sweeps_as_the_better_constant_momentum(name: str, tolerance: float) -> None:
    """It may take more sweeps by up to one interval between checks of the residual."""
    problem = load(name)
    constant = [f"SORprox(relaxation=1.1, momentum={beta}, form='factors')" for beta in (0.65, 0.8)]
    counts = [solve(problem, solver, tolerance, max_iterations=2000).iterations for solver in (*constant, MEASURED)]
    assert counts[-1] <= 1.1 * min(counts[:-1]) + MAX_CHECK_INTERVAL


def test_a_pile_is_solved_on_which_constant_momentum_reaches_a_plateau() -> None:
    problem, stop = load("pile-1000"), Stop(1e-4, 2000)
    constant = create("SORprox(relaxation=1.1, momentum=0.8, form='factors')").prepare(problem).solve(stop)
    measured = create(MEASURED).prepare(problem).solve(stop)
    assert constant.status is Status.ITERATION_LIMIT
    assert measured.status is Status.SOLVED
    assert judge(problem, measured.impulses).residual <= 1.001e-4


@pytest.mark.parametrize("name", ["pile-300", "funnel-planar-300"])
def test_observed_and_timed_solves_are_equal_to_the_bit(name: str) -> None:
    problem = load(name)
    prepared = create(MEASURED).prepare(problem)
    timed, observed = (prepared.solve(Stop(1e-6, 500), observe=watch) for watch in (None, lambda *_: None))
    assert timed.iterations == observed.iterations
    assert np.array_equal(timed.impulses, observed.impulses)


def test_coloured_sweeps_with_measured_momentum_need_no_more_iterations() -> None:
    problem = load("pile-300")
    options = {"relaxation": 1.1}
    counts = [
        create("ColouredSORprox", momentum=momentum, **options).prepare(problem).solve(Stop(1e-4, 2000)).iterations
        for momentum in (0.8, "measured")
    ]
    assert counts[1] <= counts[0]


def test_the_only_string_accepted_for_momentum_is_measured() -> None:
    with pytest.raises(SolverError, match="'measured'"):
        create("SORprox", momentum="fast")
    with pytest.raises(SolverError, match="momentum_delay"):
        create("SORprox", momentum="measured", momentum_delay=4.0)
