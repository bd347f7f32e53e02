"""Restarts begin at the best iterate and are limited by counted work."""

from types import SimpleNamespace

import numpy as np
import pytest
from proxbench.problems import ContactProblem, load
from proxbench.problems.contact.residual import Residual
from proxbench.problems.hard.families import Family, random_problem
from proxbench.solvers import Solution, Status, Stop, create
from proxbench.solvers.composite import restarts as restarts_module
from proxbench.solvers.composite.restarts import Restarts
from proxbench.solvers.iteration.loop import IterationDriver
from proxbench.solvers.iteration.stopping import Monitor
from proxbench.solvers.newton.linearised import Equations
from proxbench.solvers.newton.steps import NewtonRunner
from proxbench.solvers.newton.work import Work
from proxbench.solvers.sweeps.delassus import DelassusIterates, DelassusSweep
from proxbench.solvers.sweeps.safeguarded import SafeguardedIterates
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes


def restarts_of(
    problem: ContactProblem, first: np.ndarray, stop: Stop
) -> tuple[Restarts, IterationDriver, NewtonRunner]:
    """Return the restarts of a solve without iterations."""
    sweep = DelassusSweep.over(problem, diagonal_step_sizes(problem, 1.5))

    def begin(impulses: np.ndarray) -> SafeguardedIterates:
        return SafeguardedIterates(DelassusIterates(sweep, impulses))

    driver = IterationDriver(begin(first), begin, Monitor(stop), None)
    newton = NewtonRunner(Equations(problem, Residual(problem)), driver)
    return Restarts(newton, sweep, first), driver, newton


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_restarts_begin_from_the_best_iterate(seed: int) -> None:
    """One step from impulses that have the states of the solution solves the problem; from others it does not."""
    problem = random_problem(Family(6, dim=2, n_dofs=30, friction=0.5, states=("slip", "open")), seed)
    assert problem.answer is not None
    witness = np.asarray(problem.answer.witness)
    far = np.random.default_rng(seed).uniform(10.0, 20.0, problem.n_rows)
    restarts, driver, newton = restarts_of(problem, far, Stop(1e-9))
    near = witness * (1.0 + 1e-3)
    driver.monitor.check_convergence(0, newton.residual(near), near)
    assert restarts.run() == (Status.SOLVED, "")
    assert driver.iteration == 1
    assert newton.residual(restarts.best) <= 1e-9


@pytest.mark.parametrize("name", ["five sliding", "hard-random-mu8"])
def test_restarts_try_the_first_iterate_too(name: str) -> None:
    """The first iterate leads to a solution even if the best iterate is useless."""
    five = Family(5, dim=2, n_dofs=4, density=0.6, friction=0.5, states=("slip",))
    problem = random_problem(five, 1130) if name == "five sliding" else load(name)
    restarts, driver, newton = restarts_of(problem, np.zeros(problem.n_rows), Stop(1e-8))
    useless = np.full(problem.n_rows, 1e6)
    driver.monitor.check_convergence(0, newton.residual(useless), useless)
    assert restarts.run() == (Status.SOLVED, "")


def test_restarts_repeat_only_after_the_work_has_doubled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(restarts_module, "MIN_WORK", 0.1)
    problem = load("hard-squeezed")
    restarts, _, newton = restarts_of(problem, np.zeros(problem.n_rows), Stop(1e-8, 10**6))
    assert restarts.are_due
    assert restarts.run() is None
    assert not restarts.are_due
    newton.work.seconds *= 2.0
    assert restarts.are_due


@pytest.mark.parametrize(
    ("before", "least", "expected"),
    [(0.0, 0.1, 0.1), pytest.param(0.12, 0.1, 0.12, marks=pytest.mark.slow), (0.12, 100.0, 0.15)],
)
def test_restarts_respect_their_share_of_the_work(
    before: float, least: float, expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock stands still, so the time limit of 0.3 s is not reached; only one Newton step may exceed the share."""
    monkeypatch.setattr("proxbench.solvers.iteration.stopping.time", SimpleNamespace(perf_counter=lambda: 0.0))
    monkeypatch.setattr(restarts_module, "MIN_WORK", least)
    problem = load("hard-squeezed")
    restarts, _, newton = restarts_of(problem, np.zeros(problem.n_rows), Stop(1e-8, 10**6, 0.3))
    newton.work.seconds = before
    assert restarts.run() is None
    assert expected <= newton.work.seconds - before <= expected + 0.01


@pytest.mark.parametrize("name", ["hard-squeezed", "pile-100"])
def test_results_do_not_depend_on_the_speed_of_the_machine(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One clock runs a thousand times as fast as the other; neither reaches the limit."""
    prepared = create("HybridNewton").prepare(load(name))

    def solved(reading: float) -> Solution:
        now = 0.0

        def read() -> float:
            nonlocal now
            now += reading
            return now

        monkeypatch.setattr("proxbench.solvers.iteration.stopping.time", SimpleNamespace(perf_counter=read))
        return prepared.solve(Stop(1e-9, 2300, 2.0))

    fast, slow = solved(1e-8), solved(1e-5)
    assert (fast.status, fast.iterations) == (slow.status, slow.iterations)
    assert fast.status is not Status.TIME_LIMIT
    assert np.array_equal(fast.impulses, slow.impulses)


def test_work_grows_with_sweeps_and_faster_than_the_fill_of_factors() -> None:
    sweeps, more, small, large = (Work(entries) for entries in (10**6, 10**6, 0, 0))
    sweeps.count_sweeps(10)
    more.count_sweeps(30)
    small.count_step(10**4, 10**6)
    large.count_step(10**4, 10**8)
    assert more.seconds == pytest.approx(3.0 * sweeps.seconds)
    assert large.seconds > 1e3 * small.seconds
