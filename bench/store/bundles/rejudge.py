"""Rejudging: recompute every residual that follows from the problem and the stored impulses.

Judges on two machines differ by rounding, because sums are evaluated in different orders. The impulses are therefore
judged again with ``N_CHANGES`` relative changes of ``ROUNDING``. Numbers agree if they differ by at most ``MARGIN``
times the effect of these changes plus ``RELATIVE`` times their size. On one machine, the numbers are bitwise identical.

Times, iterations, and the residuals of all but the finest point of a case cannot be recomputed. These residuals must be
consistent with the outcomes of their points.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.judge import Verdict
from ....problems.contact.model import Model
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Status
from ....problems.errors import ProxbenchError
from ..impulses import number_of, worst
from ..outcome import ON_COPY, Outcome, claim_outcome, verdicts
from ..records import CaseRecord, Measured, Point
from .bundle import Bundle, read_bundle

ROUNDING = 2.0**-44
"""Relative change of impulses as large as the rounding of sums over a row."""

N_CHANGES = 3
"""Number of changes of the impulses whose effects are compared."""

MARGIN = 8.0
"""Largest multiple of the effect of ``ROUNDING`` that is not a disagreement."""

RELATIVE = 1e-6
"""Largest relative difference that is not a disagreement."""

MAX_SIDES = 10**6
"""Largest number of sides of a pyramid; with more, it is a cone up to rounding."""

OnCase = Callable[[int, int], None]
"""Called with the number of finished cases and of all cases."""


@dataclass
class RejudgeResult:
    """Result of rejudging a bundle.

    Attributes:
        n_cases: number of cases in the bundle.
        n_judged: number of cases whose finest point was judged again.
        n_residuals: number of recomputed residuals, under Coulomb's law and the solvers' own models.
        n_identical: number of bitwise identical residuals.
        disagreements: a sentence for each case that disagrees with the bundle.
    """

    n_cases: int = 0
    n_judged: int = 0
    n_residuals: int = 0
    n_identical: int = 0
    disagreements: list[str] = field(default_factory=list)

    @property
    def sentence(self) -> str:
        """Summary in one line."""
        share = "all" if self.n_identical == self.n_residuals else str(self.n_identical)
        judged = (
            f"{self.n_judged} of {self.n_cases} cases judged again: {self.n_residuals} residuals, {share} bit-identical"
        )
        wrong = len(self.disagreements)
        return f"{judged}; {f'{wrong} cases disagree' if wrong else 'no case disagrees'}"


class _Disagreement(Exception):  # noqa: N818 - a finding, not an error of the program
    """A case that disagrees with the bundle; the text gives the reason."""


def rejudge(file: os.PathLike[str] | str, on_case: OnCase = lambda done, total: None) -> RejudgeResult:
    """Recompute the residuals of a bundle from its problems and impulses. None of its content is executed.

    Args:
        file: the bundle.
        on_case: called with the number of finished cases and of all cases.

    Raises:
        BenchError: if the file is not a bundle, damaged, of another version, or inconsistent.
    """
    return rejudge_bundle(read_bundle(Path(file)), on_case)


def rejudge_bundle(bundle: Bundle, on_case: OnCase = lambda done, total: None) -> RejudgeResult:
    """Recompute the residuals of a bundle that has been read; see ``rejudge``."""
    result, problems = RejudgeResult(n_cases=len(bundle.cases)), dict[str, ContactProblem]()
    for done, case in enumerate(sorted(bundle.cases, key=lambda case: case.problem), 1):
        try:
            if case.problem not in problems:
                problems = {case.problem: bundle.problem(case.problem)}
            _judge_again(case, problems[case.problem], result)
        except (_Disagreement, ProxbenchError) as disagreement:
            result.disagreements.append(f"{case.solver} on {case.problem}: {disagreement}")
        on_case(done, len(bundle.cases))
    return result


def _judge_again(case: CaseRecord, problem: ContactProblem, result: RejudgeResult) -> None:
    """Judge the finest point of a case again, and compare the other points with their outcomes.

    Raises:
        _Disagreement: if a number or an outcome disagrees.
    """
    identity = problem.digest, problem.n_rows, problem.n_contacts
    if (case.digest, case.n_rows, case.n_contacts) != identity:
        raise _Disagreement("it was measured on a problem with other numbers")
    try:
        model = Model.from_text(case.model)
    except (ProxbenchError, ValueError):
        raise _Disagreement(f"there is no model {case.model!r:.60}") from None
    if model.sides > MAX_SIDES:
        raise _Disagreement(f"the model {case.model!r:.60} has too many sides")
    for point in case.points:
        fault = _claim_fault(point, model)
        if fault:
            raise _Disagreement(f"at {point.tolerance:g}, {fault}")
    finest = next((point.measured for point in reversed(case.points) if point.measured is not None), None)
    if finest is not None:
        _judge_point(finest, problem, model, result)
        result.n_judged += 1


def _claim_fault(point: Point, model: Model) -> str:
    """Return why the residuals of a point contradict its outcome; empty if they do not."""
    measured, tolerance = point.measured, point.tolerance
    if measured is None:
        return "" if point.outcome is Outcome.NOT_ATTEMPTED else f"it is {point.outcome.value} without a measurement"
    own, coulomb = number_of(measured.model_residual), number_of(measured.residual)
    if model == Model.COULOMB and own != coulomb:
        return "its two residuals differ, but must be equal under Coulomb's law"
    counts = f"it counts as {point.outcome.value}"
    if point.status != Status.SOLVED:
        claims_solution = point.outcome in (Outcome.SOLVED, Outcome.RELAXED)
        return f"{counts}, and the status of its solver is {point.status!r}" if claims_solution else ""
    possible = {claim_outcome(tolerance, model, own, coulomb), Outcome.TIME_LIMIT}
    if Outcome.SOLVED in possible:
        possible.add(Outcome.RELAXED)  # the two residuals may be those of different solves
    if point.reason.startswith(ON_COPY):
        possible.add(Outcome.WRONG)
    relaxed = "" if model == Model.COULOMB else f", {coulomb:.1e} under Coulomb's law"
    return "" if point.outcome in possible else f"{counts} with the residual {own:.1e}{relaxed}"


def _judge_point(measured: Measured, problem: ContactProblem, model: Model, result: RejudgeResult) -> None:
    """Recompute residuals and verdict of a point.

    Raises:
        _Disagreement: if they differ.
    """
    if worst(measured.impulses) != measured.impulses:
        raise _Disagreement("its impulses are not the worst ones")
    for index, stored in enumerate(measured.impulses):
        try:
            impulses = stored.unpacked(problem.n_rows)
        except ValueError as error:
            raise _Disagreement(f"its impulses cannot be read: {error}") from None
        recomputed = verdicts(problem, impulses, model)
        perturbed = [verdicts(problem, changed, model) for changed in _perturbed(impulses)]
        for name, stated, law in (("residual", stored.residual, 1), ("model_residual", stored.model_residual, 0)):
            number = recomputed[law].residual
            change = max(abs(number - verdict_pair[law].residual) for verdict_pair in perturbed)
            _compare(name, number_of(stated), number, change)
            result.n_residuals += 1
            result.n_identical += number_of(stated) == number
        if index == 0:
            _compare_verdict(measured, recomputed[1], [coulomb for _, coulomb in perturbed])
            _compare_answer(measured, problem, impulses)
    for name in ("residual", "model_residual"):
        if number_of(getattr(measured, name)) != max(number_of(getattr(stored, name)) for stored in measured.impulses):
            raise _Disagreement(f"its {name.replace('_', ' ')} is not that of its impulses")


def _compare_verdict(measured: Measured, recomputed: Verdict, perturbed: Sequence[Verdict]) -> None:
    """Raise ``_Disagreement`` if a number of the stored verdict differs from the recomputed one."""
    recomputed_values = recomputed.numeric_fields()
    perturbed_values = [verdict.numeric_fields() for verdict in perturbed]
    if set(measured.verdict) != set(recomputed_values):
        raise _Disagreement("its verdict does not have the entries of that of the judge")
    for name, number in recomputed_values.items():
        stated = measured.verdict[name]
        if isinstance(number, bool) or number is None or isinstance(stated, bool):
            if stated is not number:
                raise _Disagreement(f"{_claim_text(name)} {stated}, but the judge finds {number}")
        else:
            changes = [abs(number - number_of(values[name])) for values in perturbed_values if values[name] is not None]
            change = max(changes, default=0.0)
            _compare(name, number_of(stated), number_of(number), change)


def _compare_answer(measured: Measured, problem: ContactProblem, impulses: FloatArray) -> None:
    """Require that the error of the point, the largest of all its solves, is at least that of these impulses."""
    error = None if problem.answer is None else problem.answer.impulse_error(impulses)
    if error is not None and np.isfinite(error):
        stated = -np.inf if measured.impulse_error is None else measured.impulse_error
        if stated < (1.0 - RELATIVE) * error - MARGIN * ROUNDING:
            raise _Disagreement(f"its impulses are {error:.1e} from the known ones, not {measured.impulse_error}")


def _compare(name: str, stated: float, number: float, change: float) -> None:
    """Raise ``_Disagreement`` if two numbers differ by more than the effect ``change`` of rounding explains."""
    if stated == number:
        return
    allowed = RELATIVE * max(abs(stated), abs(number)) + MARGIN * change
    if not (np.isfinite(stated) and np.isfinite(number) and abs(stated - number) <= allowed):
        raise _Disagreement(f"{_claim_text(name)} {stated:.6e}, but the judge finds {number:.6e}")


def _claim_text(name: str) -> str:
    """Return the beginning of a sentence about a number of the bundle."""
    return f"the bundle reports {name.replace('_', ' ')}"


def _perturbed(impulses: FloatArray) -> list[FloatArray]:
    """Return ``N_CHANGES`` copies of Λ [N s], shape (n_rows,), with random relative changes of ± ``ROUNDING``.

    The changes are the same in each call.

    Several copies are needed, because one may leave a median over few contacts unchanged.
    """
    signs = np.random.default_rng(0).choice((-1.0, 1.0), size=(N_CHANGES, *impulses.shape))
    return list(impulses * (1.0 + ROUNDING * signs))
