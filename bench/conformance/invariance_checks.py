"""Tests that a solution does not depend on how a problem is stated: units, order, tangents, duplicated contacts."""

from collections.abc import Iterator

import numpy as np

from ...problems.contact.solver import Solver, Status, Stop
from ...problems.contact.transformations import TransformedProblem, duplicated, in_units, permuted, rotated
from ...problems.errors import ProblemError
from ..store.outcome import WRONG_FACTOR
from .checks import Check, NotApplicable, Violation, checks
from .samples import supported
from .trial import Trial, own_residual, run_trial

STOP = Stop(1e-6, max_iterations=5000, max_seconds=1.0)
"""Limits of the solves of a problem and of its transformations."""

UNITS = {
    "micrometres and milligrams": {"mass": 1e-6, "length": 1e-6},
    "kilometres and tonnes": {"mass": 1e3, "length": 1e3},
    "microseconds": {"time": 1e-6},
}
"""Units [kg, m, s] of the transformed problems."""


def ignores_units(solver: Solver) -> None:
    """Solutions do not depend on the units of mass, length and time."""
    for trial in _solved_samples(solver):
        for name, units in UNITS.items():
            transformed = in_units(trial.problem, **units)
            repeated = _solve_transformed(solver, trial, transformed, f"in {name}")
            if repeated is not None and not repeated.is_solved:
                status = repeated.solution.status
                raise Violation(
                    f"it solves {trial.problem.name} in {trial.solution.iterations} iterations, but in {name} its "
                    f"status is {status} at a residual of {repeated.residual:.1e}; scale impulses and velocities."
                )


def ignores_order(solver: Solver) -> None:
    """Reordering the contacts gives the same solution, or one that is equally accurate."""
    for trial in _solved_samples(solver):
        n = trial.problem.n_contacts
        for order in (np.arange(n)[::-1], np.random.default_rng(n).permutation(n)):
            _solve_transformed(solver, trial, permuted(trial.problem, order), "with its contacts in another order")


def ignores_tangents(solver: Solver) -> None:
    """Rotating the tangents gives the same solution, or one that is equally accurate."""
    if solver.model.kind == "pyramid":
        raise NotApplicable("the edges of a pyramid rotate with the tangents")
    for trial in _solved_samples(solver):
        laws = trial.problem.laws
        angles = np.random.default_rng(laws.n_laws).uniform(-np.pi, np.pi, size=laws.n_laws)
        _solve_transformed(solver, trial, rotated(trial.problem, angles), "with rotated tangents")


def ignores_copies(solver: Solver) -> None:
    """Duplicating a contact gives the same solution, summed over both copies, or one that is equally accurate."""
    for trial in _solved_samples(solver):
        for contact in {0, trial.problem.n_contacts - 1}:
            try:
                transformed = duplicated(trial.problem, contact)
            except ProblemError:
                continue
            _solve_transformed(solver, trial, transformed, f"with contact {contact} duplicated")


def _solved_samples(solver: Solver) -> Iterator[Trial]:
    """Yield the small problems that the solver solves, with their solutions.

    Raises:
        NotApplicable: if the solver solves none.
    """
    reason = f"it solves none of the small problems to {STOP.tolerance:g}"
    is_any_solved = False
    for problem in supported(solver, reason=reason):
        trial = run_trial(solver, problem, STOP)
        if trial.is_solved:
            is_any_solved = True
            yield trial
    if not is_any_solved:
        raise NotApplicable(reason)


def _solve_transformed(solver: Solver, trial: Trial, transformed: TransformedProblem, description: str) -> Trial | None:
    """Solve the transformed problem; return None if the solver does not support it or reaches the time limit.

    Raises:
        Violation: if the claimed solution does not solve the original problem.
    """
    if solver.supports(transformed.problem) is not None:
        return None
    try:
        repeated = run_trial(solver, transformed.problem.renamed(f"{trial.problem.name} {description}"), STOP)
    except Violation as violation:
        raise Violation(f"it solves the original {trial.problem.name}, but {violation}") from None
    if repeated.solution.status is Status.TIME_LIMIT:
        return None
    if repeated.is_solved:
        residual = own_residual(solver, trial.problem, transformed.impulses(repeated.solution.impulses))
        if not residual <= WRONG_FACTOR * STOP.tolerance:
            raise Violation(
                f"{description} its solution of {trial.problem.name}, transformed back, has a residual of "
                f"{residual:.1e}; make the method independent of order, tangents and duplicates."
            )
    return repeated


INVARIANCE_CHECKS: tuple[Check[Solver], ...] = checks(
    units=ignores_units, order=ignores_order, tangents=ignores_tangents, copies=ignores_copies
)
"""All tests of invariance."""
