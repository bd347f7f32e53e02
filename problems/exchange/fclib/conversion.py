"""Conversion between FCLIB problems and contact problems.

The unknowns of FCLIB are the relative velocities u and the impulses r of contacts. They satisfy
C*_μ ∋ u + μ‖u_T‖ e_N ⟂ r ∈ C_μ, De Saxcé's form of −u_N ∈ N_{R₀⁺}(r_N), −u_T ∈ N_{S(μ r_N)}(r_T), where C_μ is the
friction cone and C*_μ its dual cone. With rolling friction the cone is ‖r_T‖ ≤ μ r_N, ‖r_R‖ ≤ μ_r r_N, and
(μ‖u_T‖ + μ_r‖u_R‖) e_N is added to u. Joints have the relative velocity 0 and unbounded impulses λ. The signs are
those of ``laws``. The symbols of Proxbench, on the left sides, correspond to those of FCLIB as follows::

    local    ξ = (u, 0),  Λ = (r, λ),  G = [[W, V], [Vᵀ, R]],  c = (q, s)
    global   ξ = (u, 0),  Λ = (r, λ),  W = [H, G],  c = (Hᵀ M⁻¹ f + w, Gᵀ M⁻¹ f + b),
             free motion M⁻¹ f,  velocity after the step v = M⁻¹ (f + H r + G λ)

Like ξ, u is γ_E + ε γ_B in Newton's impact law, with the relative velocities γ_B before and γ_E after the step. The
terms with γ_B are included in q or w.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...arrays import FloatArray
from ...contact.matrices.block_diagonal import MAX_ENTRIES, block_sizes
from ...contact.matrices.factors import Factors, InverseMass
from ...contact.problem import ContactProblem
from ...errors import ProblemError
from ..repair import Repair, symmetric
from ..stored_solution import with_stored_solution
from .contents import TEXTS, GlobalContents, LocalContents
from .laws import contact_laws_of, fclib_row_order, laws_of

MAX_COLUMN_ENTRIES = 50_000_000
"""Largest number of entries of M⁻¹ D with D = (H, G), which take 400 MB."""

GUESSES = "stored_guesses"
"""Entry of the provenance: the number of initial guesses in the file."""

MAX_ROUNDING_ATTEMPTS = 10
"""Largest number of attempts to find an f with which c is reproduced exactly.

For problems with ten rows, one attempt suffices for half of them, and ten attempts for nearly all.
"""


def problem_of(
    contents: LocalContents | GlobalContents,
    name: str,
    repair: Repair = Repair(),  # noqa: B008  frozen
    **provenance: Any,
) -> ContactProblem:
    """Return the contact problem of an FCLIB file.

    Args:
        contents: the contents of the file.
        name: name of the problem.
        repair: remedies for W, R or M that are not symmetric, and for W with a negative eigenvalue.
        provenance: further entries of the provenance.

    Raises:
        ProblemError: if the laws of the file are not supported, or its numbers do not define a valid problem.
    """
    attributes: dict[str, Any] = {"name": name, "provenance": provenance | _file_provenance(contents)}
    if isinstance(contents, LocalContents):
        problem = _local_problem(contents, repair, attributes)
    else:
        problem = _global_problem(contents, repair, attributes)
    return problem if contents.solution is None else with_stored_solution(problem, contents.solution)


def contents_of(problem: ContactProblem) -> LocalContents | GlobalContents:
    """Return the contents of an FCLIB file that describes ``problem``.

    A problem with factors becomes a global problem, and one with a Delassus matrix a local problem. The contents have a
    digest if reading them reproduces the problem exactly, which requires that joints follow the contacts. The free
    motion is omitted if it prevents an exact c. M is the matrix from which M⁻¹ was computed, if known, otherwise
    the inverse of M⁻¹.

    Raises:
        ProblemError: if FCLIB cannot represent the laws, or G is not symmetric between contacts and joints.
    """
    laws, order = contact_laws_of(problem), fclib_row_order(problem)
    n = len(order) - problem.laws.n_joint_rows  # number of contact rows, which come before joints
    common: dict[str, Any] = {**vars(laws), "about": _texts(problem)}
    contents: LocalContents | GlobalContents
    if problem.factors is None:
        matrix, c = problem.delassus()[order][:, order], problem.free_velocity[order]
        _check_coupling(matrix[:n, n:] - matrix[n:, :n].T, problem)
        contents = LocalContents(W=matrix[:n, :n], V=matrix[:n, n:], R=matrix[n:, n:], q=c[:n], s=c[n:], **common)
    else:
        inverse, directions = problem.factors.inverse_mass, problem.factors.force_directions[:, order]
        mass = InverseMass.of_mass(inverse.matrix).matrix if inverse.mass is None else inverse.mass
        f, w = _free_impulse(problem.factors, directions, problem.free_velocity[order], mass)
        parts: dict[str, Any] = {"H": directions[:, :n], "G": directions[:, n:], "w": w[:n], "b": w[n:]}
        contents = GlobalContents(M=mass, f=f, **parts, **common)
    if problem_of(contents, problem.name, _lossless_repair(contents)).digest == problem.digest:
        contents = replace(contents, digest=problem.digest)
    return contents


def digest_mismatch(contents: LocalContents | GlobalContents, problem: ContactProblem) -> str | None:
    """Return why a file of ``write_fclib`` is damaged, or None if its digest matches or is missing."""
    if contents.digest in ("", problem.digest):
        return None
    if problem.provenance.keys() & {"matrix", "eigenvalues"}:  # the digest is that of the unrepaired matrices
        return digest_mismatch(contents, problem_of(contents, problem.name, _lossless_repair(contents)))
    return "its numbers do not match its digest"


def _lossless_repair(contents: LocalContents | GlobalContents) -> Repair:
    """Return the repair options with which the matrices of a file of ``write_fclib`` remain unchanged."""
    return Repair("keep" if isinstance(contents, LocalContents) else "refuse")


def _file_provenance(contents: LocalContents | GlobalContents) -> dict[str, str | int]:
    """Return the entries of the provenance that the file contains."""
    texts: dict[str, str | int] = {key: text for key, text in contents.about.items() if text}
    return texts | ({GUESSES: contents.guesses} if contents.guesses else {})


def _local_problem(contents: LocalContents, repair: Repair, attributes: dict[str, Any]) -> ContactProblem:
    joints, notes = symmetric(contents.R, "R", repair.symmetry)
    matrix, notes_of_contacts = symmetric(contents.W, "W", repair.symmetry)
    c = contents.q
    if contents.n_joints:
        matrix = sp.block_array([[matrix, contents.V], [contents.V.T, joints]], format="csr")
        c = np.append(c, contents.s)
    matrix, notes, is_asymmetric = repair.semidefinite(matrix, notes | notes_of_contacts)
    attributes["provenance"] |= notes
    return ContactProblem(c, laws_of(contents), matrix=matrix, allow_asymmetric=is_asymmetric, **attributes)


def _global_problem(contents: GlobalContents, repair: Repair, attributes: dict[str, Any]) -> ContactProblem:
    mass, notes = repair.mass(contents.M)
    attributes["provenance"] |= notes
    directions, w = contents.H, contents.w
    if contents.n_joints:
        directions, w = sp.hstack([directions, contents.G], format="csc"), np.append(w, contents.b)
    if (block_sizes(mass) ** 2).sum() > MAX_ENTRIES:
        return _condensed_problem(contents, mass, directions, w, repair, attributes)
    inverse = InverseMass.of_mass(mass)
    motion = inverse.times(contents.f)
    return ContactProblem.from_factors(
        directions,
        inverse,
        directions.T @ motion + w,
        laws=laws_of(contents),
        free_motion=motion if contents.f.any() else None,  # f = 0 means that the motion is unknown
        **attributes,
    )


def _condensed_problem(
    contents: GlobalContents,
    mass: sp.csr_array[Any],
    directions: sp.csc_array[Any],
    w: FloatArray,
    repair: Repair,
    attributes: dict[str, Any],
) -> ContactProblem:
    """Return the problem with G = Dᵀ M⁻¹ D and c = Dᵀ M⁻¹ f + w, for an M⁻¹ that is too large to store."""
    n_dofs, n_rows = directions.shape
    if n_dofs * n_rows > MAX_COLUMN_ENTRIES:
        raise ProblemError(f"M couples too many of its {n_dofs} degrees of freedom for {n_rows} rows; use W and q.")
    from scipy.sparse.linalg import splu  # import takes 0.1 s

    try:
        factors = splu(sp.csc_array(mass))
    except RuntimeError:
        raise ProblemError("M must be positive definite, but it is singular.") from None
    delassus = directions.T @ factors.solve(directions.toarray())
    attributes["provenance"]["condensed"] = "G = Dᵀ M⁻¹ D replaces M and D = (H, G), because M⁻¹ would be too large"
    c = directions.T @ factors.solve(contents.f) + w
    matrix, notes, _ = repair.semidefinite(sp.csr_array(0.5 * (delassus + delassus.T)), {})
    attributes["provenance"] |= notes
    return ContactProblem(c, laws_of(contents), matrix=matrix, **attributes)


def _check_coupling(difference: sp.csr_array[Any], problem: ContactProblem) -> None:
    """Raise ``ProblemError`` if a block of G between contacts and joints has an asymmetric part ``difference``."""
    if problem.allow_asymmetric and difference.count_nonzero():
        raise ProblemError(
            f"G of {problem.name!r} is not symmetric between contacts and joints, and FCLIB stores one such block."
        )


def _free_impulse(
    factors: Factors, directions: sp.csc_array[Any], c: FloatArray, mass: sp.csr_array[Any]
) -> tuple[FloatArray, FloatArray]:
    """Return the impulse f of forces other than contacts, and w, such that c = Dᵀ M⁻¹ f + w holds exactly.

    f is zero if the free motion is unknown, or no f reproduces c. Dᵀ M⁻¹ f is computed with the same operations as in
    reading, because another order of operations could round differently.
    """
    motion = factors.free_motion
    without_motion = np.zeros(factors.n_dofs), c
    if motion is None:
        return without_motion
    inverse, f = InverseMass.of_mass(mass), mass @ motion
    for _ in range(MAX_ROUNDING_ATTEMPTS):
        recomputed = directions.T @ inverse.times(f)
        w = c - recomputed
        if np.array_equal(recomputed + w, c):
            return f, w
        f += mass @ (motion - inverse.times(f))  # iterative refinement changes the rounding of f only
    return without_motion


def _texts(problem: ContactProblem) -> dict[str, str]:
    """Return title, description and mathematical information from the provenance, by the names of FCLIB."""
    remaining = dict(problem.provenance)
    title, description = str(remaining.pop("title", problem.name)), remaining.pop("description", None)
    math_info = str(remaining.pop("math_info", ""))
    if description is None:
        description = "; ".join(f"{key}: {value}" for key, value in remaining.items())
    return dict(zip(TEXTS, (title, str(description), math_info), strict=True))
