"""Linear systems of Newton steps are solved exactly, and only if the deadline permits."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import load
from proxbench.solvers import Status, Stop, create
from proxbench.solvers.iteration.stopping import Clock
from proxbench.solvers.newton import linear_solver
from proxbench.solvers.newton.linear_solver import LinearSolver
from proxbench.solvers.newton.linearised import LinearSystem
from proxbench.solvers.newton.work import Work


class Machine:
    """A machine whose time passes only by reading the clock [s] and by factorising.

    The machine is slow: a part of 50 rows takes as long as 500 rows elsewhere, so small problems replace large ones.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, seconds_per_entry_squared: float) -> None:
        self.now, self.reading, self.factorised = 0.0, 1e-5, linear_solver.factorise
        self.rows: list[int] = []
        self._cost = seconds_per_entry_squared
        monkeypatch.setattr("proxbench.solvers.iteration.stopping.time", SimpleNamespace(perf_counter=self.read))
        monkeypatch.setattr(linear_solver, "factorise", self.factorise)
        monkeypatch.setattr(linear_solver, "FIRST_PART_ROWS", 50)
        monkeypatch.setattr(linear_solver, "SMALL_ENTRIES", 500)

    def read(self) -> float:
        self.now += self.reading
        return self.now

    def factorise(self, matrix: sp.csr_array) -> object:
        self.now += self._cost * matrix.nnz**2
        self.rows.append(matrix.shape[0])
        return self.factorised(matrix)


def grid(side: int) -> LinearSystem:
    """Return the equations of a grid in the plane with all rows active."""
    line = sp.diags_array([-1.0, 4.0, -1.0], offsets=[-1, 0, 1], shape=(side, side))
    along = sp.diags_array([-1.0, -1.0], offsets=[-1, 1], shape=(side, side))
    matrix = sp.csr_array(sp.kron(sp.eye_array(side), line) + sp.kron(along, sp.eye_array(side)))
    rows = side**2
    return LinearSystem(np.zeros(rows), np.arange(rows), matrix, np.linspace(-1.0, 1.0, rows))


def test_a_step_solves_its_scaled_and_damped_system_and_is_counted() -> None:
    system, work = grid(20), Work(entries=0)
    scale, damping = np.logspace(-1, 1, 400), 1e-3
    step = LinearSolver(Clock(math.inf), work).solve(system, scale, damping)
    damped = system.matrix.toarray() + np.diag(damping / scale**2)
    assert step is not None
    assert np.abs(damped @ step - system.right).max() <= 1e-12
    assert work.seconds > 0.0


def test_a_singular_system_has_no_step() -> None:
    system = LinearSystem(np.zeros(2), np.arange(2), sp.csr_array(np.ones((2, 2))), np.ones(2))
    assert LinearSolver(Clock(math.inf), Work(entries=0)).solve(system, np.ones(2), 0.0) is None


def test_without_a_time_limit_no_part_is_factorised(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine(monkeypatch, 1.0)
    LinearSolver(Clock(math.inf), Work(entries=0)).solve(grid(50), np.ones(2500), 0.0)
    assert machine.rows == [2500]


@pytest.mark.parametrize("whole", [1e-2, 1.0, 1e2, 1e3])
@pytest.mark.parametrize("limit", [0.5, 5.0, 50.0])
def test_a_factorisation_that_would_miss_the_deadline_is_not_started(
    limit: float, whole: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Time grows with the square of the entries, more slowly than assumed: no factorisation ends after the limit."""
    system = grid(100)
    machine = Machine(monkeypatch, whole / system.matrix.nnz**2)
    clock = Clock(limit)
    step = LinearSolver(clock, Work(entries=0)).solve(system, np.ones(10_000), 0.0)
    assert not clock.has_expired
    assert (step is not None) == (10_000 in machine.rows)
    if whole <= limit / 20:
        assert step is not None
    if whole > limit:
        assert step is None


def test_parts_do_not_change_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    system = grid(60)
    plain = LinearSolver(Clock(math.inf), Work(entries=0)).solve(system, np.ones(3600), 0.0)
    machine = Machine(monkeypatch, 1.0 / system.matrix.nnz**2)
    after_parts = LinearSolver(Clock(5.0), Work(entries=0)).solve(system, np.ones(3600), 0.0)
    assert len(machine.rows) > 2
    assert machine.rows[-1] == 3600
    assert np.array_equal(plain, after_parts)


@pytest.mark.parametrize("whole", [0.1, 3.0, 100.0])
@pytest.mark.parametrize("limit", [0.5, 1.0])
def test_the_time_limit_holds_for_any_duration_of_a_factorisation(
    limit: float, whole: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step takes ``whole`` seconds and a check some 4 ms, on a pile that is not solved within the limit."""
    problem = load("pile-300")
    prepared = create("HybridNewton").prepare(problem)
    machine = Machine(monkeypatch, whole / problem.delassus().nnz ** 2)
    machine.reading = 2e-3
    solution = prepared.solve(Stop(1e-13, 10**7, limit))
    assert solution.status is Status.TIME_LIMIT
    assert limit <= machine.now <= limit + 0.03
    assert machine.rows
