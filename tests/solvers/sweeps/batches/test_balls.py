"""Sweeps over records of balls equal those over pieces."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws
from proxbench.problems.arrays import FloatArray
from proxbench.problems.contact.matrices.ball_contacts import BallContacts
from proxbench.problems.contact.matrices.factors import Factors, InverseMass
from proxbench.problems.contact.matrices.pieces import Pieces
from proxbench.problems.contact.residual import Residual
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import step_problem
from proxbench.solvers import Stop, create
from proxbench.solvers.iteration import loop
from proxbench.solvers.iteration.loop import Window, WindowedIterates, impulses_and_residual
from proxbench.solvers.prox.parallel.coloured_sweep import ColouredIterates
from proxbench.solvers.sweeps.batches.ball_kernels import write_rows
from proxbench.solvers.sweeps.batches.balls import BallIterates, BallSweep
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes

KINDS = st.sampled_from([("SORprox(form='factors')", BallIterates), ("ColouredSORprox", ColouredIterates)])
"""Solvers that sweep and check in windows, and their iterates."""


def heap(seed: int, n_balls: int = 150, spin_ratio: float = 2.5) -> ContactProblem:
    """Balls of different sizes and masses, with contacts in any directions and different friction."""
    rng = np.random.default_rng(seed)
    n_contacts, radii, masses = 2 * n_balls, rng.uniform(0.5, 2.0, n_balls), rng.uniform(0.5, 2.0, n_balls)
    chunks = np.array([rng.choice(n_balls, 2, replace=False) for _ in range(n_contacts)]).astype(np.int64)
    chunks[rng.random(n_contacts) < 0.2, 1] = n_balls
    normals = rng.normal(size=(n_contacts, 3))
    contacts = BallContacts(chunks.ravel(), normals / np.linalg.norm(normals, axis=1)[:, None], radii)
    linear, angular = 1.0 / masses, spin_ratio / (masses * radii**2)
    inverse = InverseMass.create(np.column_stack([*[linear] * 3, *[angular] * 3]).ravel())
    laws = Laws.contacts(rng.uniform(0.0, 1.0, n_contacts), 3, n_contacts)
    return ContactProblem(rng.normal(size=3 * n_contacts), laws, factors=Factors(contacts, inverse))


def contacts_of(problem: ContactProblem) -> BallContacts:
    assert problem.factors is not None
    contacts = problem.factors.directions
    assert isinstance(contacts, BallContacts)
    return contacts


def with_normals(problem: ContactProblem, normals: FloatArray) -> ContactProblem:
    given = contacts_of(problem)
    assert problem.factors is not None
    factors = replace(problem.factors, directions=BallContacts(given.chunks, normals, given.radii))
    return ContactProblem(problem.free_velocity, problem.laws, factors=factors)


def over_pieces(problem: ContactProblem) -> ContactProblem:
    """The same problem without records."""
    given = contacts_of(problem)
    assert problem.factors is not None
    pieces = Pieces(given.starts, given.chunks, given.values, given.n_chunks)
    return ContactProblem(problem.free_velocity, problem.laws, factors=replace(problem.factors, directions=pieces))


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 2**31), momentum=st.sampled_from([(0.0, 0.0), (0.6, 0.0), (0.9, 4.0)]), warm=st.booleans())
def test_sweeps_over_balls_give_the_iterates_and_velocities_of_sweeps_over_pieces(
    seed: int, momentum: tuple[float, float], warm: bool
) -> None:
    problem, (bound, delay) = heap(seed), momentum
    solver = create("SORprox", relaxation=1.1, form="factors", momentum=bound, momentum_delay=delay)
    start = np.random.default_rng(seed).uniform(size=problem.n_rows) if warm else np.zeros(problem.n_rows)
    first, second = (solver.prepare(one).begin(start) for one in (problem, over_pieces(problem)))
    assert isinstance(first, BallIterates)
    for _ in range(6):
        first.sweep(2)
        second.sweep(2)
        impulses, velocity = second.impulses(), second.relative_velocity()
        assert np.abs(first.impulses() - impulses).max() <= 1e-12 * np.abs(impulses).max()
        assert np.abs(first.relative_velocity() - velocity).max() <= 1e-12 * np.abs(velocity).max()


def test_a_step_of_a_pile_is_swept_from_records() -> None:
    scene = make_scene("funnel(balls=300)")
    state = replace(scene.start, position=0.9 * scene.start.position)
    assembly = scene.system.assemble(state.position, state.velocity, 1e-3)
    assert assembly.contacts is not None
    problem = step_problem(assembly, assembly.contacts, state.velocity)
    sweep = BallSweep.over(problem, diagonal_step_sizes(problem, 1.0))
    assert sweep is not None
    assert sweep.records.nbytes + sweep.bodies.nbytes <= 1.2 * 96 * problem.n_contacts


def test_contacts_with_a_fixed_bound_of_friction_are_not_swept_from_records() -> None:
    """Records hold μ alone."""
    problem = heap(1)
    laws = problem.laws
    bounded = Laws(laws.kind, laws.first_row, laws.friction_coefficient, 0.1 * laws.is_friction, laws.partner)
    assert BallSweep.over(problem, diagonal_step_sizes(problem, 1.0)) is not None
    problem = ContactProblem(problem.free_velocity, bounded, factors=problem.factors)
    assert BallSweep.over(problem, diagonal_step_sizes(problem, 1.0)) is None


@pytest.mark.parametrize("factor", [1.0 + 1e-9, 1.0 - 1e-6, np.nan])
def test_contacts_whose_normals_are_not_of_unit_length_are_not_swept_from_records(factor: float) -> None:
    """Their tangents are not orthogonal to them, so that W is not the product with vectors in space."""
    problem = heap(1)
    normals = contacts_of(problem).normals.copy()
    normals[7] *= factor
    problem = with_normals(problem, normals)
    assert BallSweep.over(problem, np.ones((problem.n_contacts, 2))) is None


@pytest.mark.parametrize("solver", ["SORprox(form='factors')", "ColouredSORprox"])
@pytest.mark.parametrize("friction", [0.0, 1e-14, 0.3])
def test_friction_of_balls_does_not_exceed_its_bound(solver: str, friction: float) -> None:
    """Impulses that are stored as vectors in space have a rounding error in each direction."""
    problem = heap(3)
    laws = Laws.contacts(friction, 3, problem.n_contacts)
    problem = ContactProblem(problem.free_velocity, laws, factors=problem.factors)
    for stop in (Stop(1e-300, 7), Stop(1e-6)):
        normal, *tangential = create(solver).prepare(problem).solve(stop).impulses.reshape(-1, 3).T
        assert (np.hypot(*tangential) <= friction * normal * (1.0 + 1e-15)).all()


@pytest.mark.parametrize("form", ["delassus", "factors"])
def test_balls_of_unlike_inertia_are_swept_over_pieces_to_the_same_solution(form: str) -> None:
    """A hollow ball among solid ones has another κ, which records do not contain."""
    problem = heap(1)
    assert problem.factors is not None
    inverse = problem.factors.inverse_mass.matrix.data.copy()
    inverse[3:6] *= 0.6
    unlike = replace(problem.factors, inverse_mass=InverseMass.create(inverse))
    problem = ContactProblem(problem.free_velocity, problem.laws, factors=unlike)
    assert BallSweep.over(problem, diagonal_step_sizes(problem, 1.0)) is None
    solver = create("SORprox", relaxation=1.1, form=form)
    found = solver.prepare(problem).solve(Stop(1e-300, 20)).impulses
    expected = solver.prepare(over_pieces(problem)).solve(Stop(1e-300, 20)).impulses
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("tilt", [0.0, 1e-300, 1e-17, 1.0])
def test_impulses_survive_the_change_to_vectors_in_space(tilt: float) -> None:
    """Sweeps use P = Λ_N n + Λ_T1 T1 + Λ_T2 T2; the tangents are discontinuous for horizontal normals."""
    problem = heap(6)
    normals = contacts_of(problem).normals.copy()
    normals[::3] = [-1.0, 0.0, 0.0]
    normals[1::3] = [0.0, 0.0, -1.0]
    normals[:, 2] += tilt * (normals[:, 2] == 0.0)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    problem = with_normals(problem, normals)
    start = np.random.default_rng(7).normal(size=problem.n_rows)
    iterates = create("SORprox", form="factors").prepare(problem).begin(start)
    assert isinstance(iterates, BallIterates)
    assert np.array_equal(iterates.impulses(), start)  # without a sweep
    rows = np.full(len(start), np.nan)
    no_bound = np.full(len(normals), np.finfo(float).max)
    start[::3] = np.abs(start[::3])  # otherwise, the bound is zero
    iterates = create("SORprox", form="factors").prepare(problem).begin(start)
    assert isinstance(iterates, BallIterates)
    write_rows(normals, no_bound, iterates._sweep.slots, iterates._impulses, 0, len(normals), rows)
    assert np.abs(rows - start).max() <= 1e-15 * np.abs(start).max()
    velocity = problem.relative_velocity(start)
    assert np.abs(iterates.relative_velocity() - velocity).max() <= 1e-13 * np.abs(velocity).max()


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**31), size=st.sampled_from([1e-120, 1.0, 1e120]), sweeps=st.integers(0, 30))
def test_the_residual_of_one_pass_is_that_of_the_impulses(seed: int, size: float, sweeps: int) -> None:
    """This holds even if velocities are so small or large that they are squared in other units."""
    problem = heap(seed)
    problem = ContactProblem(size * problem.free_velocity, problem.laws, factors=problem.factors)
    iterates = create("SORprox", form="factors").prepare(problem).begin(np.zeros(problem.n_rows))
    residual = Residual(problem)
    iterates.sweep(sweeps)
    impulses, found = impulses_and_residual(iterates, residual)
    assert np.array_equal(impulses, iterates.impulses())
    assert found == pytest.approx(residual(impulses, problem.relative_velocity(impulses)), rel=1e-9, abs=1e-13)


def test_the_residual_of_one_pass_is_not_finite_if_an_impulse_is_nan() -> None:
    problem = heap(2)
    start = np.zeros(problem.n_rows)
    start[7] = np.nan
    iterates = create("SORprox", form="factors").prepare(problem).begin(start)
    assert not impulses_and_residual(iterates, Residual(problem))[1] < np.inf


@settings(deadline=None, max_examples=25)
@given(
    kind=KINDS,
    seed=st.integers(0, 2**31),
    options=st.sampled_from(
        [{}, {"momentum": 0.65}, {"momentum": "measured"}, {"momentum": 0.97, "momentum_delay": 4.0}]
    ),
    relaxation=st.sampled_from([0.9, 1.1, 1.95]),
    tolerance=st.sampled_from([1e-2, 1e-6, 1e-16]),
    max_iterations=st.one_of(st.integers(0, 60), st.sampled_from([700, 2300])),
    laws_swept=st.sampled_from([1, 20_000, 10**9]),
)
def test_windows_of_sweeps_and_checks_give_the_solution_of_single_checks(
    kind: tuple[str, type[WindowedIterates]],
    seed: int,
    options: dict[str, float],
    relaxation: float,
    tolerance: float,
    max_iterations: int,
    laws_swept: int,
) -> None:
    """An observer requires single checks."""
    solver, iterates = kind
    windows: list[int] = []
    run_window = iterates.run_window

    def counted(self: WindowedIterates, counts: Sequence[int], *arguments: Any) -> Window:
        window = run_window(self, counts, *arguments)
        windows.append(len(window.residuals))
        return window

    prepared = create(solver, relaxation=relaxation, **options).prepare(heap(seed))
    stop = Stop(tolerance, max_iterations)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(iterates, "run_window", counted)
        patch.setattr(loop, "MAX_LAWS_SWEPT", laws_swept)
        found = prepared.solve(stop)
        n_windows = len(windows)
        expected = prepared.solve(stop, observe=lambda iteration, impulses: None)
        assert len(windows) == n_windows
    assert np.array_equal(found.impulses, expected.impulses)
    assert (found.status, found.iterations, found.message) == (
        expected.status,
        expected.iterations,
        expected.message,
    )
    if laws_swept == 10**9 and found.iterations >= 4:
        assert max(windows) > 1


@pytest.mark.parametrize("solver", ["SORprox(form='factors')", "ColouredSORprox"])
def test_a_window_ends_at_the_first_residual_beyond_its_limits(solver: str) -> None:
    problem = heap(3)
    residual = Residual(problem)

    def residuals(limits: tuple[float, float]) -> list[float]:
        iterates = create(solver).prepare(problem).begin(np.zeros(problem.n_rows))
        return iterates.run_window([3] * 8, residual, limits).residuals.tolist()

    every = residuals((0.0, np.inf))
    assert len(every) == 8
    first_below = next(number for number, value in enumerate(every, 1) if value <= every[4])
    assert residuals((every[4], np.inf)) == every[:first_below]
    assert residuals((0.0, every[0])) == every[:1]


@pytest.mark.parametrize("solver", ["SORprox(form='factors')", "ColouredSORprox"])
def test_the_best_impulses_of_a_window_have_its_lowest_residual_before_the_last_one(solver: str) -> None:
    """They do not change in the next window."""
    problem = heap(3)
    residual = Residual(problem)
    prepared = create(solver, relaxation=1.9, momentum=0.9).prepare(problem)
    iterates, single = (prepared.begin(np.zeros(problem.n_rows)) for _ in range(2))
    assert isinstance(iterates, WindowedIterates)
    window = iterates.run_window([2] * 12, residual, (0.0, np.inf))
    best = int(np.argmin(window.residuals[:-1]))
    assert best < 10  # otherwise, the best is the last but one
    single.sweep(2 * (best + 1))
    iterates.run_window([3] * 5, residual, (0.0, np.inf))
    assert np.array_equal(window.best_impulses(), single.impulses())
