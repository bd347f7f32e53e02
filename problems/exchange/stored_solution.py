"""Impulses that a file stores as the solution: they are judged, and become the known answer if they pass."""

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.judge import judge
from ..contact.problem import ContactProblem

MAX_RESIDUAL = 1e-4
"""Largest judged residual with which stored impulses count as a solution."""

RESIDUAL_KEY = "stored_solution_residual"
"""Key in the provenance: the judged residual of the stored impulses."""


def with_stored_solution(problem: ContactProblem, impulses: FloatArray) -> ContactProblem:
    """Return the problem with the residual of stored impulses in its provenance.

    Args:
        problem: the problem.
        impulses: Λ [N s], shape (n_rows,). They become the known answer if their residual is at most ``MAX_RESIDUAL``.
    """
    residual = judge(problem, impulses).residual
    known = Answer(witness=impulses) if residual <= MAX_RESIDUAL else None
    return problem.answered(known, **{RESIDUAL_KEY: residual})
