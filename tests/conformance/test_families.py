"""Every solver passes its checks on random families of problems with a known solution, under any transformation.

With PROXBENCH_PROFILE=full, each property is tested on five hundred problems; with ``hunt``, on five thousand.
"""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from proxbench.bench.conformance.trial import Trial, own_residual, require_known_answer, run_trial
from proxbench.problems import ContactProblem, judge
from proxbench.problems.arrays import FloatArray
from proxbench.problems.contact.residual import Residual
from proxbench.problems.contact.transformations import TransformedProblem, duplicated, in_units, permuted, rotated
from proxbench.problems.hard.families import (
    STATES,
    Family,
    LinkedFamily,
    random_braced_problem,
    random_linked_problem,
    random_problem,
    random_spectrum_problem,
)
from proxbench.solvers import Solver, Status, Stop, available, create

TOLERANCE = 1e-6
STOP = Stop(TOLERANCE, max_iterations=3000, max_seconds=10.0)

PATIENT = ("APGD", "SAP")
"""Solvers of the convex model, which take seconds where it has no solution."""

FRICTION = [0.0, 0.125, 0.5, 1.0, 8.0]


@st.composite
def families(draw: Any) -> Family:
    states = draw(st.lists(st.sampled_from(STATES), min_size=1, unique=True))
    return Family(
        n_contacts=draw(st.integers(1, 6)),
        dim=draw(st.integers(1, 3)),
        n_dofs=draw(st.integers(1, 20)),
        mass_exponent=draw(st.integers(0, 6)),
        density=draw(st.sampled_from([0.2, 0.6, 1.0])),
        friction=draw(st.sampled_from(FRICTION)),
        states=tuple(states),
    )


@st.composite
def linked_families(draw: Any) -> LinkedFamily:
    return LinkedFamily(
        **vars(draw(families())),
        n_joints=draw(st.integers(0, 4)),
        rolling_rows=draw(st.integers(0, 3)),
        rolling_friction=draw(st.sampled_from([0.0, 0.125, 1.0])),
    )


@st.composite
def spectral_problems(draw: Any) -> ContactProblem:
    dim, n_contacts = draw(st.integers(1, 3)), draw(st.integers(1, 5))
    exponents = draw(st.lists(st.integers(-6, 3), min_size=dim * n_contacts, max_size=dim * n_contacts))
    rank = draw(st.integers(1, dim * n_contacts))
    eigenvalues = np.where(np.arange(dim * n_contacts) < rank, 10.0 ** np.array(exponents), 0.0)
    return random_spectrum_problem(eigenvalues, dim, draw(st.sampled_from(FRICTION)), draw(st.integers(0, 2**16)))


seeds = st.integers(0, 2**32 - 1)
problems = st.one_of(
    st.builds(random_problem, families(), seeds),
    st.builds(random_braced_problem, families(), seeds),
    spectral_problems(),
    st.builds(random_linked_problem, linked_families(), seeds),
)
solvers = st.sampled_from([create(name) for name in available()])


def trial_of(solver: Solver, problem: ContactProblem) -> Trial | None:
    return None if solver.supports(problem) is not None else run_trial(solver, problem, STOP)


@given(problem=problems, solver=solvers)
def test_status_of_a_solver_is_true_and_its_answer_is_a_known_one(problem: ContactProblem, solver: Solver) -> None:
    digest = problem.digest
    trial = trial_of(solver, problem)
    assert problem.fresh().digest == digest
    if trial is not None and judge(problem, trial.solution.impulses).residual <= TOLERANCE:
        require_known_answer(problem, trial.solution.impulses)


@pytest.mark.slow
@given(problem=problems, solver=solvers)
def test_a_solve_is_reproducible_and_accepts_its_own_solution_as_a_start(
    problem: ContactProblem, solver: Solver
) -> None:
    trial = trial_of(solver, problem)
    if trial is None or trial.solution.status is Status.TIME_LIMIT:
        return
    again = run_trial(solver, problem.fresh(), STOP)
    if again.solution.status is not Status.TIME_LIMIT:
        assert again.solution.impulses.tobytes() == trial.solution.impulses.tobytes()
    if trial.is_solved and solver.has_iterates:
        warm = run_trial(solver, problem, STOP, start=trial.solution.impulses)
        assert warm.is_solved
        assert warm.solution.iterations <= 1


@pytest.mark.slow
@given(problem=problems, solver=solvers, tolerances=st.lists(st.sampled_from([1e-1, 1e-3, 1e-5, 1e-7]), min_size=2))
def test_tighter_tolerance_does_not_increase_the_residual(
    problem: ContactProblem, solver: Solver, tolerances: list[float]
) -> None:
    end_no_worse(problem, solver, tolerances, STOP.max_seconds)


def end_no_worse(problem: ContactProblem, solver: Solver, tolerances: list[float], max_seconds: float) -> None:
    if solver.supports(problem) is not None:
        return
    before = np.inf
    for tolerance in sorted(set(tolerances), reverse=True):
        trial = run_trial(solver, problem, Stop(tolerance, STOP.max_iterations, max_seconds))
        if trial.solution.status is Status.TIME_LIMIT:
            return
        assert trial.residual <= max(before, tolerance) + 1e-13
        before = trial.residual


@given(problem=problems, solver=solvers, seed=seeds, size=st.integers(-6, 3), outside=st.booleans())
def test_from_any_start_the_status_is_true_and_the_residual_does_not_increase(
    problem: ContactProblem, solver: Solver, seed: int, size: int, outside: bool
) -> None:
    if solver.supports(problem) is not None:
        return
    start = 10.0**size * np.random.default_rng(seed).normal(size=problem.n_rows)
    if not outside:
        start = np.abs(start)
    trial = run_trial(solver, problem, STOP, start=start)
    if solver.has_iterates:
        assert trial.residual <= (1.0 + 1e-9) * own_residual(solver, problem, start) + 1e-13


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.weekly if name in PATIENT else []) for name in available()]
)
def test_tighter_tolerance_is_no_worse_if_the_convex_model_has_no_solution(
    name: str,
) -> None:
    family = Family(n_contacts=5, dim=2, n_dofs=4, mass_exponent=0, density=0.6, friction=0.5, states=("slip",))
    end_no_worse(random_problem(family, 1130), create(name), [1e-1, 1e-3, 1e-5, 1e-7], max_seconds=20.0)


@st.composite
def transformed_problems(draw: Any) -> tuple[ContactProblem, TransformedProblem, str]:
    problem = draw(problems)
    how = draw(st.sampled_from(["units", "order", "tangents", "copies", "form"]))
    random = np.random.default_rng(draw(seeds))
    if how == "units":
        units = {name: 10.0 ** draw(st.integers(-6, 6)) for name in ("mass", "length", "time")}
        return problem, in_units(problem, **units), how
    if how == "order":
        return problem, permuted(problem, random.permutation(problem.n_contacts)), how
    if how == "tangents":
        return problem, rotated(problem, random.uniform(-4.0, 4.0, size=problem.laws.n_laws)), how
    if how == "form":
        return problem, without_factors(problem), how
    return problem, duplicated(problem, int(random.integers(problem.n_contacts))), how


def without_factors(problem: ContactProblem) -> TransformedProblem:
    """Return the problem with its Delassus matrix, but without factors."""
    bare = ContactProblem.from_delassus(problem.delassus(), problem.free_velocity, laws=problem.laws)
    return TransformedProblem(bare, sp.csr_array(sp.eye_array(problem.n_rows)))


@pytest.mark.slow
@given(case=transformed_problems(), solver=solvers)
def test_a_solution_of_a_transformed_problem_solves_the_original(
    case: tuple[ContactProblem, TransformedProblem, str], solver: Solver
) -> None:
    problem, other, how = case
    trial = trial_of(solver, other.problem)
    if trial is None or not trial.is_solved or (how == "tangents" and solver.model.kind == "pyramid"):
        return
    impulses = other.impulses(trial.solution.impulses)
    allowed = TOLERANCE if how != "copies" else max(TOLERANCE, left_by_copies(problem, impulses))
    assert own_residual(solver, problem, impulses) <= 10.0 * allowed


def left_by_copies(problem: ContactProblem, impulses: FloatArray) -> float:
    """Return the largest residual ε^⅔ (L/2)^⅓ of the sum of two copies that have the residual ε = ``TOLERANCE`` each.

    Two copies that hardly slide, at ξ, may hold at angles of ±φ to −ξ as long as φ‖ξ‖ ≤ ε. The sum of both is then
    inside its disc of radius L = αμΛ_N by Lφ²/2, relative to c like ξ, and violates Coulomb's law by the lesser of this
    and ‖ξ‖ = ε/φ. L is at most the largest G_hh |Λ_h|.
    """
    residual = Residual(problem)
    held = residual.largest_diagonal_term(impulses) / residual.scale if residual.scale > 0.0 else 0.0
    return float(TOLERANCE ** (2.0 / 3.0) * (0.5 * held) ** (1.0 / 3.0))


@pytest.mark.parametrize("friction", [0.125, 0.5, 1.0])
def test_sum_of_two_copies_sliding_at_an_angle_nearly_reaches_the_allowed_residual(friction: float) -> None:
    angle = (2.0 * TOLERANCE / friction) ** (1.0 / 3.0)
    sum_of_copies = np.array([1.0, friction * np.cos(angle), 0.0])
    free_velocity = np.array([0.0, -TOLERANCE / angle, 0.0]) - sum_of_copies
    contact = ContactProblem.from_delassus(sp.csr_array(np.eye(3)), free_velocity, friction=friction, dim=3)
    tilt = np.array([0.0, 0.0, 0.5 * friction * np.sin(angle)])
    copies = np.concatenate([0.5 * sum_of_copies + tilt, 0.5 * sum_of_copies - tilt])
    assert judge(duplicated(contact, 0).problem, copies).residual <= 1.01 * TOLERANCE
    allowed = left_by_copies(contact, sum_of_copies)
    assert 0.4 * allowed <= judge(contact, sum_of_copies).residual <= allowed
