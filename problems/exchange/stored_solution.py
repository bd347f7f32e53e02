"""Impulses that a file stores as the solution: they are judged, and become the known answer if they are accurate."""

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.judge import judge
from ..contact.problem import ContactProblem
from ..engine_model import own_residual

MAX_RESIDUAL = 1e-4
"""Largest judged residual with which stored impulses count as a solution."""

RESIDUAL_KEY = "stored_solution_residual"
"""Key in the provenance: the judged residual of the stored impulses."""

OWN_RESIDUAL_KEY = "stored_solution_own_residual"
"""Key in the provenance: the residual of the stored impulses in the engine's own model, if the problem has one."""


def with_stored_solution(problem: ContactProblem, impulses: FloatArray) -> ContactProblem:
    """Return the problem with the residuals of stored impulses in its provenance.

    Args:
        problem: the problem.
        impulses: Λ [N s], shape (n_rows,). They become the known answer if their residual is at most ``MAX_RESIDUAL``.
    """
    residual = judge(problem, impulses).residual
    known = Answer(witness=impulses) if residual <= MAX_RESIDUAL else None
    own = {} if problem.engine is None else {OWN_RESIDUAL_KEY: own_residual(problem.engine, impulses)}
    return problem.answered(known, **{RESIDUAL_KEY: residual}, **own)
