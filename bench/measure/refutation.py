"""Refute claims that a problem has no solution, with the solutions of a run."""

from collections.abc import Sequence

from msgspec.structs import replace

from ...problems.contact.model import Model
from ..store.outcome import Outcome
from ..store.records import CaseRecord, Point

SOLUTION_RESIDUAL = 1e-8
"""Largest judged residual of impulses that count as a solution."""


def mark_refuted_claims(cases: Sequence[CaseRecord], is_solvable: bool | None) -> list[CaseRecord]:
    """Return the cases of one problem that falsely claim that it has no solution, with these claims marked as wrong.

    A claim is false if any case contains a judged solution of the same model. For Coulomb's law, ``is_solvable``
    decides unless it is None.

    Args:
        cases: all measured cases.
        is_solvable: whether there is a solution under Coulomb's law; None if unknown.
    """
    solvable = {case.model for case in cases if any(map(_is_solution, case.points))}
    if is_solvable is not None:
        (solvable.add if is_solvable else solvable.discard)(str(Model.COULOMB))
    return [
        replace(case, points=[_marked_wrong(point) for point in case.points])
        for case in cases
        if case.model in solvable and any(point.outcome is Outcome.INFEASIBLE for point in case.points)
    ]


def _is_solution(point: Point) -> bool:
    """Return whether the impulses of a point solve the model of its solver."""
    residual = None if point.measured is None else point.measured.model_residual
    return point.outcome in (Outcome.SOLVED, Outcome.RELAXED) and residual is not None and residual <= SOLUTION_RESIDUAL


def _marked_wrong(point: Point) -> Point:
    """Return a point whose outcome is wrong if it claims that there is no solution."""
    if point.outcome is not Outcome.INFEASIBLE:
        return point
    return replace(point, outcome=Outcome.WRONG, reason="claims that there is no solution, but one is known")
