"""Dumps of the dual problem of Newton's solver Kamino, one world each.

    D, P, v_f, mu, njc, nbc, nl, nc    of ``solver._solver_kamino._problem_fd.data``, each with ``.numpy()``
    bound_lower, bound_upper           of the same, if there are bounded multipliers, shape (nbc,)
    compliance                         of the same, if contacts or limits are compliant; D contains it, see below
    lambdas, v_plus                    of ``solver._solver_kamino._solver_fd.data.solution``; optional, for the judge

D, shape (n, n) or (n·n,), and v_f, shape (n,), are scaled by the diagonal preconditioner P: with G and c in physical
units, D = P G P and v_f = P c. Dump them before the solve, which adds its penalty to the diagonal of D. The rows
belong to joints (njc), bounded multipliers (nbc), limits (nl) and contacts (nc), with T1, T2, N for each contact. A
bounded multiplier is the friction or the limited effort of a joint, |λ| ≤ b; its bounds are b/P.

The compliance R [1/kg], shape (n,), is physical: D = P (G + diag R) P. It lets a contact or limit approach at the
velocity −R λ, so v_plus = (G + diag R) λ + c is not the velocity after the step. The problem has G, and thus hard
contacts; Kamino's own model is G + diag R with Coulomb friction.

Arrays may be longer than their content, as Kamino allocates them; lambdas are physical impulses [N s]. Source: Newton
1.8.0, ``newton/_src/solvers/kamino/_src/dynamics/dual.py``, a private interface.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...arrays import FloatArray
from ...contact.laws import LawKind, Laws
from ...contact.problem import ContactProblem
from ...engine_model import EngineModel, EngineSet
from ...errors import ProblemError
from ..repair import Repair
from ..stored_solution import with_stored_solution
from .plain import Arrays, normal_first, problem_of_delassus, stored_impulses

COUNTS = ("njc", "nbc", "nl", "nc")
"""Names of the arrays that contain numbers of rows and contacts."""

SINGLE_PRECISION = 1e-4
"""Tolerated error of sums in single precision, relative to their terms."""

ARRAYS = ("D", "v_f", "mu", *COUNTS)
"""Names of the arrays of a dump; the counts may be missing, and ``mu`` without contacts."""

_SETS = {
    LawKind.BILATERAL: EngineSet.LINE,
    LawKind.PLANAR_FRICTION: EngineSet.INTERVAL,
    LawKind.SPATIAL_FRICTION: EngineSet.INTERVAL,
    LawKind.UNILATERAL: EngineSet.HALF_LINE,
}
"""Sets of the rows of a law in Kamino's own model; a contact without friction has intervals of length 0."""


def recognises(arrays: Arrays) -> bool:
    """Return whether the arrays have the names of Kamino's dual problem."""
    return "D" in arrays and "v_f" in arrays


def problem_of_arrays(arrays: Arrays, repair: Repair) -> ContactProblem:
    """Return the problem of one world.

    Args:
        arrays: as in the module docstring; the default of P is 1, and that of counts 0.
        repair: how an asymmetric or indefinite D is read.

    Raises:
        ProblemError: if an array is missing or does not match the others, the bounds of a multiplier are not ±b, or a
            compliance is negative or not part of D.
    """
    for name in ("D", "v_f"):
        if name not in arrays:
            raise ProblemError(f"there is no array {name!r}; Kamino's dual problem has {', '.join(ARRAYS)}.")
    joints, bounded, limits, contacts = (_count(arrays, name) for name in COUNTS)
    n = joints + bounded + limits + 3 * contacts
    scale = _read_doubles(arrays, "P", n) if "P" in arrays else np.ones(n)
    if not (scale > 0.0).all():
        raise ProblemError("'P', the preconditioner, must be positive.")
    delassus = _read_doubles(arrays, "D", n * n).reshape(n, n) / scale[:, None] / scale
    mu = _read_doubles(arrays, "mu", contacts) if contacts else np.zeros(0)
    friction = _bounded_laws(arrays, bounded, scale[joints : joints + bounded])
    laws = Laws.concatenate(
        [Laws.joints(joints), friction, Laws.contacts(0.0, 1, limits), Laws.contacts(mu, 3, contacts)]
    )
    order = normal_first(contacts, joints + bounded + limits)
    c = _read_doubles(arrays, "v_f", n) / scale
    notes: dict[str, Any] = {"source": "Kamino"}
    compliance = _compliance(arrays, delassus.diagonal())
    if compliance.any():
        notes["largest_compliance"] = float(compliance.max())
    # D has single precision, which determines the tolerances
    hard = (delassus - np.diag(compliance)).astype(np.float32)
    problem = problem_of_delassus(hard, c, mu, order, repair, laws=laws, **notes)
    if compliance.any():
        problem = replace(problem, engine=_own_model(problem, compliance[order]))
    if "lambdas" not in arrays:
        return problem
    impulses = stored_impulses(arrays["lambdas"].ravel()[:n], n)[order]
    if "v_plus" in arrays:
        _check_velocity(problem, impulses, _read_doubles(arrays, "v_plus", n)[order])
    return with_stored_solution(problem, impulses)


def _bounded_laws(arrays: Arrays, count: int, scale: FloatArray) -> Laws:
    """Return the friction laws with fixed bounds [N s] of bounded multipliers."""
    if not count:
        return Laws.joints(0)
    lower, upper = (_read_doubles(arrays, name, count) for name in ("bound_lower", "bound_upper"))
    if not (np.isfinite(upper) & (upper >= 0.0) & (lower == -upper)).all():
        raise ProblemError(
            "the bounds of multipliers must be finite and equal in both directions; remove other limits of effort."
        )
    kind, none = np.full(count, LawKind.PLANAR_FRICTION), np.full(count, -1)
    return Laws.in_order(kind, np.zeros(count), upper * scale, none)


def _compliance(arrays: Arrays, diagonal: FloatArray) -> FloatArray:
    """Return the compliance of each row [1/kg], zeros if there is none.

    Raises:
        ProblemError: if a compliance is negative, or larger than the diagonal of D in physical units.
    """
    if "compliance" not in arrays:
        return np.zeros(len(diagonal))
    compliance = _read_doubles(arrays, "compliance", len(diagonal))
    if not (compliance >= 0.0).all():
        raise ProblemError("'compliance' must not be negative or NaN.")
    if (compliance > (1.0 + SINGLE_PRECISION) * diagonal).any():
        raise ProblemError("'compliance' exceeds the diagonal of D, which contains it; dump both before one solve.")
    return compliance


def _own_model(problem: ContactProblem, compliance: FloatArray) -> EngineModel:
    """Return Kamino's own model, Coulomb friction on G + diag R, over impulses instead of forces."""
    laws, size = problem.laws, problem.n_rows
    kinds: list[EngineSet] = []
    coefficient, bound, starts = np.ones(size), np.zeros(size), []
    for law in range(len(laws.kind)):
        rows = laws.first_row[law] + np.arange(laws.row_count[law])
        if laws.partner[law] >= 0 and laws.friction_coefficient[law] > 0.0:
            kinds[-1], coefficient[rows] = EngineSet.COULOMB_CONE, laws.friction_coefficient[law]
            continue
        kinds += len(rows) * [_SETS[LawKind(laws.kind[law])]]
        starts += rows.tolist()
        bound[rows] = laws.fixed_bound[law]
    return EngineModel(
        name="Kamino",
        matrix=problem.delassus(),
        regularisation=compliance,
        offset=problem.free_velocity,
        scale=float(np.abs(problem.free_velocity).max(initial=0.0)),
        kind=np.array(kinds, dtype=np.int8),
        first_row=np.array(starts),
        coefficient=coefficient,
        bound=bound,
        combination=sp.csr_array(sp.eye_array(size)),
        time_step=1.0,
    )


def _check_velocity(problem: ContactProblem, impulses: FloatArray, velocity: FloatArray) -> None:
    """Raise ``ProblemError`` if (G + diag R) Λ + c and Kamino's velocity differ beyond single precision."""
    terms = abs(problem.delassus()) @ np.abs(impulses) + np.abs(problem.free_velocity)
    expected = problem.relative_velocity(impulses)
    if problem.engine is not None:
        expected = problem.engine.gradient(impulses)
    difference = float(np.abs(expected - velocity).max(initial=0.0))
    if difference > SINGLE_PRECISION * float(terms.max(initial=0.0)):
        raise ProblemError(
            f"D λ + v_f differs from v_plus by {difference:.1e}; dump D before the solve, which changes its diagonal."
        )


def _count(arrays: Arrays, name: str) -> int:
    """Return a number of rows or contacts; without nc, count the entries of mu."""
    if name not in arrays:
        return arrays["mu"].size if name == "nc" and "mu" in arrays else 0
    value: NDArray[Any] = arrays[name]
    if value.size != 1 or value.dtype.kind not in "iu" or value.item() < 0:
        raise ProblemError(f"{name!r} must be one whole number; dump one world at a time.")
    return int(value.item())


def _read_doubles(arrays: Arrays, name: str, count: int) -> FloatArray:
    """Return the first entries of an array as doubles, shape (count,)."""
    if name not in arrays or arrays[name].size < count or arrays[name].dtype.kind not in "fiu":
        size = arrays[name].size if name in arrays else 0
        raise ProblemError(f"{name!r} must have {count} numbers to match the counts of rows, got {size}.")
    return arrays[name].ravel()[:count].astype(np.float64)
