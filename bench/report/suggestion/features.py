"""What a problem is like, in numbers: problems that are close in them want the same solver."""

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.judge import judge
from ....problems.contact.problem import ContactProblem
from ....solvers.interface import Stop
from ....solvers.registry import create

FEATURES = ("contacts", "rows", "redundancy", "friction", "sliding", "rolling", "joints", "masses", "sweeps")
"""What ``features`` gives, in its order."""

PROBE, PROBE_SWEEPS, FINEST = "NSGS", 20, 1e-10
"""The solver whose residual after that many sweeps is a feature, no finer than the last number."""


def features(problem: ContactProblem) -> FloatArray:
    """Return the features of a problem, shape (len(FEATURES),).

    contacts: log10 of 1 + their number; rows: per contact; redundancy: log10 of rows over degrees of freedom, NaN
    where the problem is given by G alone, or nothing moves; friction: median coefficient of the friction laws;
    sliding, rolling and joints: shares of the laws that are friction, rolling friction and bilateral; masses: log10
    of the largest over the least positive diagonal entry of G; sweeps: log10 of the judged residual after 20 sweeps
    of ``NSGS``, NaN where it does not support the problem.
    """
    laws, n_rows = problem.laws, max(problem.n_rows, 1)
    is_sliding = laws.is_friction & ~laws.is_rolling
    friction = laws.friction_coefficient[is_sliding]
    diagonal = problem.delassus_diagonal
    positive = diagonal[diagonal > 0.0]
    n_dofs = np.nan if problem.factors is None else problem.factors.n_dofs or np.nan
    return np.array(
        [
            np.log10(1.0 + problem.n_contacts),
            problem.n_rows / max(problem.n_contacts, 1),
            np.log10(n_rows / n_dofs),
            np.median(friction) if len(friction) else 0.0,
            is_sliding.sum() / max(laws.n_laws, 1),
            laws.is_rolling.sum() / max(laws.n_laws, 1),
            laws.is_bilateral.sum() / max(laws.n_laws, 1),
            np.log10(positive.max() / positive.min()) if len(positive) else 0.0,
            np.log10(_residual_after_sweeps(problem)),
        ]
    )


def _residual_after_sweeps(problem: ContactProblem) -> float:
    solver = create(PROBE)
    if solver.supports(problem) is not None:
        return float("nan")
    stop = Stop(tolerance=FINEST, max_iterations=PROBE_SWEEPS)
    residual = judge(problem, solver.prepare(problem).solve(stop).impulses).residual
    return min(max(residual, FINEST), 1.0) if np.isfinite(residual) else 1.0


def distances(given: FloatArray, known: FloatArray) -> FloatArray:
    """Return the distance of features, shape (len(FEATURES),), to those of known problems, shape (n, len(FEATURES)).

    Root mean square over the features that both have, each in standard deviations of the known problems, one that
    does not vary there in units of its own.
    """
    spread = np.array([column[np.isfinite(column)].std() if np.isfinite(column).any() else 1.0 for column in known.T])
    parts = ((known - given) / np.where(spread > 0.0, spread, 1.0)) ** 2
    is_there = np.isfinite(parts)
    squares: FloatArray = np.where(is_there, parts, 0.0).sum(axis=1) / is_there.sum(axis=1)
    return np.sqrt(squares)
