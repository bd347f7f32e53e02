"""Transformations of contact problems: order, tangents, units, duplicated contacts, and problems side by side.

Each is a linear map Λ = T Λ' with G' = Tᵀ G T and c' = Tᵀ c, up to units, so that a solution Λ' of the new problem
gives the solution T Λ' of the old one. The transformations show whether a solver depends on such choices.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..arrays import FloatArray, IntArray
from ..errors import ProblemError
from .answer import Answer
from .laws import Laws
from .matrices.factors import Factors
from .problem import FREE_FALL, ContactProblem


@dataclass(frozen=True, eq=False)
class TransformedProblem:
    """A transformed problem.

    Attributes:
        problem: the new problem, with the parts of the old answer that remain valid.
        back: T, so that Λ = T Λ' [N s], sparse, shape (old rows, new rows).
    """

    problem: ContactProblem
    back: sp.csr_array

    def impulses(self, transformed: ArrayLike) -> FloatArray:
        """Return Λ of the old problem, shape (old rows,), from Λ' of the new one."""
        original: FloatArray = self.back @ np.asarray(transformed, dtype=np.float64)
        return original


def permuted(problem: ContactProblem, order: ArrayLike) -> TransformedProblem:
    """Return the problem with its contacts in another order; ``order`` contains the old index at each new position.

    Raises:
        ProblemError: if ``order`` is not a permutation of the contacts.
    """
    contacts = np.asarray(order, dtype=np.int64)
    if not np.array_equal(np.sort(contacts), np.arange(problem.n_contacts)):
        raise ProblemError(f"order must be a permutation of 0 to {problem.n_contacts - 1}.")
    members = _laws_of_contacts(problem)
    laws = np.concatenate([np.zeros(0, dtype=np.int64), *(members[contact] for contact in contacts)])
    new_index = np.empty(len(laws) + 1, dtype=np.int64)
    new_index[laws] = np.arange(len(laws))
    new_index[-1] = -1  # partner −1 selects this entry
    old = problem.laws
    new_laws = old.subset(laws, new_index[old.partner[laws]])
    return _congruent(problem, _selection(problem, _rows_of_laws(old, laws)), new_laws, "permuted")


def rotated(problem: ContactProblem, angles: ArrayLike) -> TransformedProblem:
    """Return the problem with the first two axes of each friction law rotated.

    These are the tangents of spatial friction, and the first two axes of rolling about two or three axes.

    Args:
        problem: the problem.
        angles: angle of each law [rad], shape (n_laws,), or one angle for all; ignored for laws of one row.
    """
    angle_of_law = np.broadcast_to(np.asarray(angles, dtype=np.float64), (problem.laws.n_laws,))
    back = sp.lil_array(sp.eye_array(problem.n_rows))
    for law in np.flatnonzero(problem.laws.row_count > 1):
        row, cos, sin = int(problem.laws.first_row[law]), np.cos(angle_of_law[law]), np.sin(angle_of_law[law])
        back[row, row], back[row, row + 1] = cos, -sin
        back[row + 1, row], back[row + 1, row + 1] = sin, cos
    return _congruent(problem, sp.csr_array(back), problem.laws, "rotated")


def duplicated(problem: ContactProblem, contact: int) -> TransformedProblem:
    """Return the problem with a copy of one contact at the end; the impulses of both add up to the old one.

    A fixed bound is split between the copies.

    Raises:
        ProblemError: if the friction of one contact is bounded by the impulse of another, which a copy would change.
    """
    layout, old = problem.layout, problem.laws
    if not layout.bounds_are_own:
        raise ProblemError(f"{problem.name!r} has friction bounded by another contact, so none can be duplicated.")
    laws = _laws_of_contacts(problem)[contact]
    fixed_bound = old.fixed_bound.copy()
    fixed_bound[laws] *= 0.5
    partner = np.where(old.partner[laws] >= 0, old.n_laws, -1)  # the copy of the contact's normal law is the first
    both, partners = np.append(np.arange(old.n_laws), laws), np.append(old.partner, partner)
    new_laws = replace(old, fixed_bound=fixed_bound).subset(both, partners)
    rows = np.append(np.arange(problem.n_rows), _rows_of_laws(old, laws))
    return _congruent(problem, _selection(problem, rows), new_laws, "duplicated")


def in_units(problem: ContactProblem, mass: float = 1.0, length: float = 1.0, time: float = 1.0) -> TransformedProblem:
    """Return the problem in units of ``mass`` [kg], ``length`` [m] and ``time`` [s], including its answer.

    G → G · mass, c → c · time/length, Λ → Λ · time/(mass · length), and fixed bounds like Λ. Rows of rolling friction
    have angular velocities and moments: c → c · time, Λ → Λ · time/(mass · length²) and μ_r → μ_r/length.
    """
    if problem.laws.is_rolling.any():
        return _in_units_with_rolling(problem, mass, length, time)
    return _in_units_without_rolling(problem, mass, length, time)


def _in_units_without_rolling(problem: ContactProblem, mass: float, length: float, time: float) -> TransformedProblem:
    """Return a problem without rolling friction in other units."""
    speed, impulse = time / length, time / (mass * length)
    back = sp.csr_array(sp.eye_array(problem.n_rows) / impulse)
    answer, factors, matrix = problem.answer, problem.factors, problem.matrix
    if answer is not None:
        answer = replace(
            answer,
            impulses=tuple(impulse * known for known in answer.impulses),
            velocity=None if answer.velocity is None else speed * answer.velocity,
            values=None if answer.values is None else impulse * answer.values,
            witness=None if answer.witness is None else impulse * answer.witness,
        )
    if factors is not None:
        motion = None if factors.free_motion is None else speed * factors.free_motion
        factors = Factors.create(factors.force_directions, factors.inverse_mass.matrix * mass, motion)
    transformed = replace(
        problem,
        free_velocity=speed * problem.free_velocity,
        laws=replace(problem.laws, fixed_bound=problem.laws.fixed_bound * impulse),
        matrix=None if matrix is None else matrix * mass,
        factors=factors,
        name=f"{problem.name} in other units",
        provenance={FREE_FALL: speed * problem.free_fall} if problem.free_fall else {},
        answer=answer,
        engine=None if problem.engine is None else problem.engine.transformed(back),
    )
    return TransformedProblem(transformed, back)


def _in_units_with_rolling(problem: ContactProblem, mass: float, length: float, time: float) -> TransformedProblem:
    """Return a problem with rolling friction in other units: scale its rows by ``length``, then change units."""
    laws = problem.laws
    is_rolling_row = np.repeat(laws.is_rolling, laws.row_count)
    scale = np.where(is_rolling_row, length, 1.0)
    law_scale = np.where(laws.is_rolling, 1.0 / length, 1.0)
    coefficient, fixed_bound = law_scale * laws.friction_coefficient, law_scale * laws.fixed_bound
    scaled = _congruent(
        problem,
        sp.csr_array(sp.diags_array(scale)),
        replace(laws, friction_coefficient=coefficient, fixed_bound=fixed_bound),
        "in other units",
    )
    answer, new_answer = problem.answer, scaled.problem.answer
    if answer is not None and new_answer is not None:
        new_answer = replace(
            new_answer,
            impulses=tuple(vector / scale for vector in answer.impulses),
            witness=None if answer.witness is None else answer.witness / scale,
        )
    converted = _in_units_without_rolling(replace(scaled.problem, answer=new_answer), mass, length, time)
    return TransformedProblem(
        replace(converted.problem, name=f"{problem.name} in other units"), scaled.back @ converted.back
    )


def united(problems: Sequence[ContactProblem]) -> ContactProblem:
    """Return uncoupled problems as one problem in Delassus form, with their answers.

    Velocities are known if they are known for all parts, impulses if each part has exactly one solution. Sums that are
    known for a part remain known.
    """
    matrix = sp.block_diag([problem.delassus() for problem in problems], format="csr")
    c = np.concatenate([problem.free_velocity for problem in problems])
    laws = Laws.concatenate([problem.laws for problem in problems])
    return ContactProblem.from_delassus(matrix, c, laws=laws, answer=_united_answer(problems))


def _united_answer(problems: Sequence[ContactProblem]) -> Answer:
    answers = [problem.answer or Answer() for problem in problems]
    if not all(answer.solvable for answer in answers):
        return Answer(solvable=False)
    is_unique = all(len(answer.impulses) == 1 for answer in answers)
    velocities = [answer.velocity for answer in answers if answer.velocity is not None]
    parts = [
        np.zeros((0, problem.n_rows)) if answer.functionals is None else answer.functionals
        for problem, answer in zip(problems, answers, strict=True)
    ]
    values = [answer.values for answer in answers if answer.values is not None]
    has_sums = any(len(part) for part in parts)
    return Answer(
        impulses=(np.concatenate([answer.impulses[0] for answer in answers]),) if is_unique else (),
        velocity=np.concatenate(velocities) if len(velocities) == len(answers) else None,
        functionals=sp.block_diag(parts).toarray() if has_sums else None,
        values=np.concatenate(values) if has_sums else None,
        sensitivity=max(answer.sensitivity for answer in answers),
    )


def _congruent(problem: ContactProblem, back: sp.csr_array, laws: Laws, suffix: str) -> TransformedProblem:
    """Return the problem with G' = Tᵀ G T, c' = Tᵀ c; its answer keeps only velocity and sums."""
    answer, transposed = problem.answer, sp.csr_array(back.T)
    if answer is not None:
        answer = Answer(
            velocity=None if answer.velocity is None else transposed @ answer.velocity,
            functionals=None if answer.functionals is None else answer.functionals @ back,
            values=answer.values,
            solvable=answer.solvable,
            sensitivity=answer.sensitivity,
        )
    factors, matrix = problem.factors, problem.matrix
    if factors is not None:
        directions = sp.csc_array(factors.force_directions @ back)
        factors = Factors.create(directions, factors.inverse_mass, factors.free_motion)
    if matrix is not None:
        matrix = sp.csr_array(transposed @ matrix @ back)
        matrix = matrix if problem.allow_asymmetric else 0.5 * (matrix + matrix.T)
    transformed = replace(
        problem,
        free_velocity=transposed @ problem.free_velocity,
        laws=laws,
        matrix=matrix,
        factors=factors,
        name=f"{problem.name}, {suffix}",
        provenance={},
        answer=answer,
        engine=None if problem.engine is None else problem.engine.transformed(back),
    )
    return TransformedProblem(transformed, back)


def _selection(problem: ContactProblem, rows: IntArray) -> sp.csr_array:
    """Return T whose columns select ``rows`` of the old problem, one each."""
    return sp.csr_array((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(problem.n_rows, len(rows)))


def _laws_of_contacts(problem: ContactProblem) -> list[IntArray]:
    """Return the laws of each contact, its unilateral one first."""
    layout = problem.layout
    owners = np.column_stack([layout.normal_law, layout.friction_law, layout.rolling_law])
    return [owner[owner >= 0] for owner in owners]


def _rows_of_laws(laws: Laws, chosen: IntArray) -> IntArray:
    rows = [np.arange(laws.first_row[law], laws.first_row[law] + laws.row_count[law]) for law in chosen]
    return np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
