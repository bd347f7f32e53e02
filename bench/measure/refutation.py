"""Refute claims that a problem has no solution, with the solutions of a run or a matrix."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

from msgspec.structs import replace

from ...problems.contact.model import Model
from ..store.outcome import Cell, Outcome
from ..store.records import CaseRecord, Point

SOLUTION_RESIDUAL = 1e-8
"""Largest judged residual of impulses that count as a solution."""

REASON = "claims that there is no solution, but one is known"
"""Reason why such a claim is wrong."""


def mark_refuted_claims(cases: Sequence[CaseRecord], is_solvable: bool | None) -> list[CaseRecord]:
    """Return the cases of one problem that falsely claim that it has no solution, with these claims marked as wrong.

    A claim is false if any case contains a judged solution of the same model. For Coulomb's law, ``is_solvable``
    decides unless it is None.

    Args:
        cases: all measured cases.
        is_solvable: whether there is a solution under Coulomb's law; None if unknown.
    """
    solvable = _solvable_models((case.model for case in cases if any(map(_is_solution, case.points))), is_solvable)
    return [
        replace(case, points=[_marked_wrong(point) for point in case.points])
        for case in cases
        if case.model in solvable and any(point.outcome is Outcome.INFEASIBLE for point in case.points)
    ]


def without_refuted_claims(
    cells: Sequence[Cell], models: Mapping[str, Model], is_solvable: Mapping[str, bool | None]
) -> list[Cell]:
    """Return the cells of a matrix, in which false claims that a problem has no solution are marked as wrong.

    Args:
        cells: the cells of all solvers and problems.
        models: model of each solver.
        is_solvable: whether each problem has a solution under Coulomb's law; None if unknown.
    """
    solved: dict[str, set[str]] = {cell.problem: set() for cell in cells}
    for cell in cells:
        if cell.outcome in (Outcome.SOLVED, Outcome.RELAXED) and cell.model_residual <= SOLUTION_RESIDUAL:
            solved[cell.problem].add(str(models[cell.solver]))
    solvable = {name: _solvable_models(found, is_solvable[name]) for name, found in solved.items()}
    return [
        dataclasses.replace(cell, outcome=Outcome.WRONG, reason=REASON)
        if cell.outcome is Outcome.INFEASIBLE and str(models[cell.solver]) in solvable[cell.problem]
        else cell
        for cell in cells
    ]


def _solvable_models(solved: Iterable[str], is_solvable: bool | None) -> set[str]:
    """Return the models under which a problem has a solution.

    Args:
        solved: models of which there is a judged solution.
        is_solvable: whether there is a solution under Coulomb's law; None if unknown.
    """
    solvable = set(solved)
    if is_solvable is not None:
        (solvable.add if is_solvable else solvable.discard)(str(Model.COULOMB))
    return solvable


def _is_solution(point: Point) -> bool:
    """Return whether the impulses of a point solve the model of its solver."""
    residual = None if point.measured is None else point.measured.model_residual
    return point.outcome in (Outcome.SOLVED, Outcome.RELAXED) and residual is not None and residual <= SOLUTION_RESIDUAL


def _marked_wrong(point: Point) -> Point:
    """Return a point whose outcome is wrong if it claims that there is no solution."""
    if point.outcome is not Outcome.INFEASIBLE:
        return point
    return replace(point, outcome=Outcome.WRONG, reason=REASON)
