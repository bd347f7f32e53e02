"""Sweeps over slabs are Gauss–Seidel sweeps in another order, bitwise equal for any number of threads."""

import time
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.residual import Residual
from proxbench.problems.contact.transformations import permuted
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import step_problem
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.iteration.loop import impulses_and_residual
from proxbench.solvers.prox import coloured_sorprox
from proxbench.solvers.prox.parallel import coloured_sweep, slabs
from proxbench.solvers.prox.parallel.coloured_sweep import ColouredIterates, ColouredSweep
from proxbench.solvers.prox.parallel.team import Team, _Member
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes

PLANAR = pytest.param("funnel-planar-100", marks=pytest.mark.slow)
FRICTIONLESS = pytest.param("funnel-frictionless-100", marks=pytest.mark.slow)
"""Problems with one or two rows a contact, whose kernels take seconds to compile."""


def chains(has_hub: bool) -> ContactProblem:
    """Return random contacts between the bodies of twenty chains; with a hub, every other body touches body 0, too."""
    rng = np.random.default_rng(5)
    pairs = [(k, k + 1) for k in range(1, 200) if k % 10]
    if has_hub:
        pairs += [(0, k) for k in range(1, 200, 2)]
    columns = np.zeros((6 * 201, 3 * len(pairs)))
    for contact, bodies in enumerate(pairs):
        for body in bodies:
            columns[6 * body : 6 * body + 6, 3 * contact : 3 * contact + 3] = rng.normal(size=(6, 3))
    free = rng.normal(size=3 * len(pairs))
    return ContactProblem.from_factors(sp.csc_array(columns), np.ones(len(columns)), free, 0.3)


def problem_of(name: str) -> ContactProblem:
    """Load a problem whose W has pieces, or make the first step of compressed balls, whose W has records."""
    if name in ("hub", "parts"):
        return chains(has_hub=name == "hub")
    if name != "balls":
        return load(name)
    scene = make_scene("funnel(balls=300)")
    velocity = np.random.default_rng(3).normal(size=scene.start.velocity.size)
    assembly = scene.system.assemble(0.8 * scene.start.position, velocity, 1e-3)
    assert assembly.contacts is not None
    problem = step_problem(assembly, assembly.contacts, velocity)
    assert ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.0), 1).ball_batches is not None
    return problem


def use_threads_for_small_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coloured_sweep, "MIN_CONTACTS_PER_THREAD", 1)
    monkeypatch.setattr(coloured_sweep, "MIN_EFFICIENCY", 0.0)
    monkeypatch.setattr(slabs, "MIN_SLAB", 8)


def swept(problem: ContactProblem, threads: int, momentum: float, counts: tuple[int, ...] = (1, 4, 10)) -> list[Any]:
    """Return the bits of Λ and ξ after each window from a nonzero start, and then those of windows with checks."""
    sweep = ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.1), threads)
    start = np.maximum(np.random.default_rng(0).normal(size=problem.n_rows), 0.0)
    iterates = ColouredIterates(sweep, start, momentum)
    bits = []
    for count in counts:
        iterates.sweep(count)
        bits += [iterates.impulses().tobytes(), iterates.relative_velocity().tobytes()]
    residual = Residual(problem)
    for lowest in (0.0, 0.05, np.inf):
        if iterates.has_windows(residual):
            window = iterates.run_window([3, 1, 7, 5], residual, (lowest, np.inf))
            bits += [window.residuals.tobytes(), iterates.impulses().tobytes()]
            if len(window.residuals) > 1:
                bits.append(window.best_impulses().tobytes())
    return bits


@pytest.mark.parametrize("momentum", [0.0, 0.65])
@pytest.mark.parametrize("name", ["funnel-300", PLANAR, FRICTIONLESS, "balls"])
def test_any_number_of_threads_gives_the_same_bits(name: str, momentum: float, monkeypatch: pytest.MonkeyPatch) -> None:
    used = []
    use_threads_for_small_problems(monkeypatch)
    run = Team.run

    def counted(team: Team) -> Any:
        used.append(len(team._states))
        return run(team)

    monkeypatch.setattr(Team, "run", counted)
    problem = problem_of(name)
    alone = swept(problem, 1, momentum)
    for threads in (2, 3, 4):
        used.clear()
        assert swept(problem, threads, momentum) == alone
        assert set(used) == {threads}


@pytest.mark.parametrize("momentum", [0.0, "measured"])
@pytest.mark.parametrize("name", ["funnel-100", "balls"])
def test_any_number_of_threads_gives_the_same_solution(
    name: str, momentum: float | str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The impulses (bitwise), status, iterations and message are equal; measured momentum depends on all of them."""
    use_threads_for_small_problems(monkeypatch)
    monkeypatch.setattr(coloured_sorprox, "check_threads", lambda threads: None)  # more threads than cores, too
    problem, found = problem_of(name), []
    for threads in (1, 2, 4):
        prepared = create("ColouredSORprox", momentum=momentum, threads=threads).prepare(problem)
        solution = prepared.solve(Stop(1e-4, 2000))
        found.append((solution.impulses.tobytes(), solution.status, solution.iterations, solution.message))
    assert found[0][2] > 20
    assert found[1:] == [found[0]] * 2


def test_few_contacts_are_swept_in_one_thread_and_the_message_says_why() -> None:
    problem = load("funnel-300")
    assert ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.0), 2).threads == 1
    messages = [solve(problem, f"ColouredSORprox(threads={threads})", tolerance=1e-2).message for threads in (1, 2)]
    assert messages == ["", "1 of 2 threads used, because more would save little time"]


@pytest.mark.parametrize("name", ["funnel-300", "balls"])
@pytest.mark.parametrize("patience", [None, 0, 2000])
def test_late_or_missing_threads_do_not_change_the_result(
    name: str, patience: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Running threads take over the tasks of threads that never start, or leave after each window."""
    use_threads_for_small_problems(monkeypatch)
    problem, threads = problem_of(name), 3
    alone = swept(problem, 1, 0.65)
    if patience is None:
        monkeypatch.setattr(_Member, "begin", lambda self, function: None)
        assert swept(problem, threads, 0.65) == alone
        return
    run = Team.run

    def late(team: Team) -> Any:
        time.sleep(1e-6 * patience)
        return run(team)

    monkeypatch.setattr(Team, "run", late)
    for _ in range(10):
        assert swept(problem, threads, 0.65) == alone


@pytest.mark.parametrize("name", ["funnel-300", PLANAR, FRICTIONLESS, "hard-sticking-box", "balls", "hub", "parts"])
@pytest.mark.parametrize(("momentum", "delay"), [(0.0, 0.0), (0.5, 0.0), (0.5, 4.0)])
@pytest.mark.parametrize("size", [8, slabs.MIN_SLAB])
def test_a_sweep_is_that_of_sorprox_over_the_contacts_in_the_order_of_slabs(
    name: str, momentum: float, delay: float, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slabs, "MIN_SLAB", size)
    problem = problem_of(name)
    sweep = ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.2), 1)
    order = np.argsort(sweep.slots.reshape(problem.n_contacts, -1)[:, 0])
    plain = permuted(problem, order)
    seen: list[list[np.ndarray]] = []
    for solver, solved in (("ColouredSORprox", problem), ("SORprox", plain.problem)):
        own: list[np.ndarray] = []
        prepared = create(solver, relaxation=1.2, momentum=momentum, momentum_delay=delay).prepare(solved)
        prepared.solve(Stop(1e-300, 40), observe=lambda _, x, own=own: own.append(x.copy()))
        seen.append(own)
    coloured, sequential = np.array(seen[0]), np.array([plain.impulses(x) for x in seen[1]])
    assert coloured.shape == sequential.shape == (40, problem.n_rows)
    assert np.abs(coloured - sequential).max() <= 1e-11 * np.abs(coloured).max()


def test_threads_that_would_wait_for_the_largest_slab_are_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """If one body touches half of the others, half of the contacts must be swept one after another."""
    monkeypatch.setattr(coloured_sweep, "MIN_CONTACTS_PER_THREAD", 1)
    monkeypatch.setattr(slabs, "MIN_SLAB", 8)
    for name, threads in (("parts", 2), ("hub", 1)):
        problem = problem_of(name)
        assert ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.0), 2).threads == threads


@pytest.mark.parametrize("name", ["funnel-300", PLANAR, FRICTIONLESS, "balls"])
def test_the_velocity_is_that_of_the_impulses(name: str) -> None:
    problem = problem_of(name)
    iterates = ColouredIterates(
        ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.0), 1), np.zeros(problem.n_rows), 0.6
    )
    assert iterates.relative_velocity() == pytest.approx(problem.free_velocity)
    for count in (1, 20):
        iterates.sweep(count)
        expected = problem.relative_velocity(iterates.impulses())
        assert np.abs(iterates.relative_velocity() - expected).max() <= 1e-12 * np.abs(problem.free_velocity).max()


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("name", ["funnel-300", PLANAR, "balls"])
def test_the_residual_of_a_window_is_that_of_its_impulses(
    name: str, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second ``Residual`` object gives the same value after the window, and ξ is available then."""
    use_threads_for_small_problems(monkeypatch)
    problem = problem_of(name)
    sweep = ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.0), threads)
    iterates, residual = ColouredIterates(sweep, np.zeros(problem.n_rows), 0.6), Residual(problem)
    for count in (0, 1, 10):
        if count:
            iterates.sweep(count)
        impulses, found = impulses_and_residual(iterates, residual)
        expected = residual(impulses, problem.relative_velocity(impulses))
        assert np.array_equal(impulses, iterates.impulses())
        assert found == pytest.approx(expected, rel=1e-10)
        assert impulses_and_residual(iterates, Residual(problem))[1] == found
        velocity = problem.relative_velocity(impulses)
        assert np.abs(iterates.relative_velocity() - velocity).max() <= 1e-12 * np.abs(problem.free_velocity).max()
    assert found > 0.0


@pytest.mark.parametrize("name", ["funnel-300", "balls"])
@pytest.mark.parametrize("solver", ["SORprox(form='factors')", "ColouredSORprox"])
def test_a_start_that_solves_the_problem_is_returned_unchanged(solver: str, name: str) -> None:
    problem = problem_of(name)
    solved = create("Robust").prepare(problem).solve(Stop(1e-8))
    again = create(solver).prepare(problem).solve(Stop(1e-6), solved.impulses)
    assert again.iterations == 0
    assert np.array_equal(again.impulses, solved.impulses)


def test_an_impulse_that_is_not_a_number_has_no_finite_residual() -> None:
    problem = problem_of("balls")
    sweep = ColouredSweep.over(problem, diagonal_step_sizes(problem, 1.0), 1)
    start = np.zeros(problem.n_rows)
    start[problem.n_rows // 2] = np.nan
    assert not impulses_and_residual(ColouredIterates(sweep, start, 0.0), Residual(problem))[1] < np.inf


@pytest.mark.slow
def test_the_solution_without_friction_is_that_of_newton_steps() -> None:
    """Without friction ξ is unique, whatever the order of the contacts."""
    problem = load("funnel-frictionless-100")
    rng = np.random.default_rng(2)
    oracle = solve(problem, "SemismoothNewton", tolerance=1e-10, max_seconds=np.inf)
    assert oracle.status is Status.SOLVED
    expected = problem.relative_velocity(oracle.impulses)
    for order in (np.arange(problem.n_contacts), rng.permutation(problem.n_contacts)):
        reordered = permuted(problem, order)
        found = solve(
            reordered.problem,
            "ColouredSORprox(relaxation=1.3)",
            tolerance=1e-10,
            max_iterations=100_000,
            max_seconds=np.inf,
        )
        assert found.status is Status.SOLVED
        velocity = problem.relative_velocity(reordered.impulses(found.impulses))
        assert np.abs(velocity - expected).max() <= 1e-7 * np.abs(problem.free_velocity).max()


@pytest.mark.parametrize("name", ["funnel-300", PLANAR, "bodies-stack-10", "hard-sticking-box", "balls"])
def test_the_judge_confirms_what_is_solved(name: str) -> None:
    problem = problem_of(name)
    solution = solve(
        problem, "ColouredSORprox(relaxation=1.2)", tolerance=1e-6, max_iterations=100_000, max_seconds=np.inf
    )
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-6


def test_unsupported_problems_are_declined_with_the_reason() -> None:
    solver, rng = create("ColouredSORprox"), np.random.default_rng(1)
    assembled = ContactProblem.from_delassus(np.eye(3), -np.ones(3), 0.3)
    assert "need the factors" in str(solver.supports(assembled))
    assert "joints" in str(solver.supports(load("bodies-four-bar")))
    three = sp.csc_array(np.vstack([rng.normal(size=(6, 3)) for _ in range(3)]))
    problem = ContactProblem.from_factors(sp.hstack([three, three], format="csc"), np.ones(18), rng.normal(size=6), 0.3)
    assert "more than two bodies" in str(solver.supports(problem))
