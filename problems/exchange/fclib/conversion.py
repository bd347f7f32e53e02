"""Conversion between FCLIB problems and contact problems.

Unknowns are the relative velocities u and impulses r of contacts with C*_μ ∋ u + μ‖u_T‖ e_N ⟂ r ∈ C_μ, De Saxcé's
form of −u_N ∈ N_{R₀⁺}(r_N), −u_T ∈ N_{S(μ r_N)}(r_T); with rolling friction the cone is ‖r_T‖ ≤ μ r_N, ‖r_R‖ ≤ μ_r r_N,
and u is lifted by μ_r‖u_R‖ too. Rows of joints have zero on the left side and unbounded impulses λ. So the
signs are those of ``laws``, and our symbols on the left sides are::

    local    ξ = (u, 0),  Λ = (r, λ),  G = [[W, V], [Vᵀ, R]],  c = (q, s)
    global   ξ = (u, 0),  Λ = (r, λ),  W = [H, G],  c = (Hᵀ M⁻¹ f + w, Gᵀ M⁻¹ f + b),
             free motion M⁻¹ f,  velocity after the step v = M⁻¹ (f + H r + G λ)

The terms of the relative velocities before the step, as in Newton's impact law, are included in q or w: u is
γ_E + ε γ_B, as ξ is.
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
from .laws import contacts_of, laws_of, rows_in_order

MOST_COLUMN_ENTRIES = 50_000_000
"""Largest number of entries of M⁻¹ D, 400 MB of doubles."""

GUESSES = "stored_guesses"
"""Entry of the provenance: the number of guesses in a file, if it stores any."""

ATTEMPTS = 10
"""Largest number of roundings of f to try until c is reproduced exactly: one suffices for half of all problems of ten
rows, ten for nearly all."""


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
        repair: how a W, R or M that is not symmetric, or a W with a negative eigenvalue, is read.
        provenance: further entries of the provenance.

    Raises:
        ProblemError: if its laws are not supported, or its numbers do not define a valid problem.
    """
    attributes: dict[str, Any] = {"name": name, "provenance": provenance | _description(contents)}
    if isinstance(contents, LocalContents):
        problem = _local(contents, repair, attributes)
    else:
        problem = _global(contents, repair, attributes)
    return problem if contents.solution is None else with_stored_solution(problem, contents.solution)


def contents_of(problem: ContactProblem) -> LocalContents | GlobalContents:
    """Return the contents of a file of ``problem``: a global problem for factors, a local one for a Delassus matrix.

    They have a digest if reading reproduces the problem exactly, which requires the joints after the contacts. The free
    motion is omitted if c could not be reproduced with it. M is the one that M⁻¹ was computed from, or else is computed
    from M⁻¹.

    Raises:
        ProblemError: if FCLIB has no such laws, or a G that is not symmetric couples contacts and joints.
    """
    laws, order = contacts_of(problem), rows_in_order(problem)
    n = len(order) - int(problem.laws.is_bilateral.sum())  # rows of contacts
    common: dict[str, Any] = {**vars(laws), "about": _about(problem)}
    contents: LocalContents | GlobalContents
    if problem.factors is None:
        matrix, c = problem.delassus()[order][:, order], problem.free_velocity[order]
        _check_coupling(matrix[:n, n:] - matrix[n:, :n].T, problem)
        contents = LocalContents(W=matrix[:n, :n], V=matrix[:n, n:], R=matrix[n:, n:], q=c[:n], s=c[n:], **common)
    else:
        inverse, directions = problem.factors.inverse_mass, problem.factors.force_directions[:, order]
        mass = InverseMass.of_mass(inverse.matrix).matrix if inverse.mass is None else inverse.mass
        f, w = _without_contacts(problem.factors, directions, problem.free_velocity[order], mass)
        parts: dict[str, Any] = {"H": directions[:, :n], "G": directions[:, n:], "w": w[:n], "b": w[n:]}
        contents = GlobalContents(M=mass, f=f, **parts, **common)
    if problem_of(contents, problem.name, _unchanged(contents)).digest == problem.digest:
        contents = replace(contents, digest=problem.digest)
    return contents


def digest_obstacle(contents: LocalContents | GlobalContents, problem: ContactProblem) -> str | None:
    """Return why a file of ``write_fclib`` is damaged, or None if its digest matches or it has none."""
    if contents.digest in ("", problem.digest):
        return None
    if problem.provenance.keys() & {"matrix", "eigenvalues"}:  # repaired; the digest is that of the numbers before
        return digest_obstacle(contents, problem_of(contents, problem.name, _unchanged(contents)))
    return "its numbers do not match its digest"


def _unchanged(contents: LocalContents | GlobalContents) -> Repair:
    """Return the repair that leaves the matrices of a file of ``write_fclib`` unchanged."""
    return Repair("keep" if isinstance(contents, LocalContents) else "refuse")


def _description(contents: LocalContents | GlobalContents) -> dict[str, str | int]:
    """Return the entries of the provenance that are in the file."""
    texts: dict[str, str | int] = {key: text for key, text in contents.about.items() if text}
    return texts | ({GUESSES: contents.guesses} if contents.guesses else {})


def _local(contents: LocalContents, repair: Repair, attributes: dict[str, Any]) -> ContactProblem:
    joints, notes = symmetric(contents.R, "R", repair.symmetry)
    matrix, notes_of_contacts = symmetric(contents.W, "W", repair.symmetry)
    c = contents.q
    if contents.n_joints:
        matrix = sp.block_array([[matrix, contents.V], [contents.V.T, joints]], format="csr")
        c = np.append(c, contents.s)
    matrix, notes, is_asymmetric = repair.semidefinite(matrix, notes | notes_of_contacts)
    attributes["provenance"] |= notes
    return ContactProblem(c, laws_of(contents), matrix=matrix, allow_asymmetric=is_asymmetric, **attributes)


def _global(contents: GlobalContents, repair: Repair, attributes: dict[str, Any]) -> ContactProblem:
    mass, notes = repair.mass(contents.M)
    attributes["provenance"] |= notes
    directions, w = contents.H, contents.w
    if contents.n_joints:
        directions, w = sp.hstack([directions, contents.G], format="csc"), np.append(w, contents.b)
    if (block_sizes(mass) ** 2).sum() > MAX_ENTRIES:
        return _condensed(contents, mass, directions, w, attributes)
    inverse = InverseMass.of_mass(mass)
    motion = inverse.times(contents.f)
    return ContactProblem.from_factors(
        directions,
        inverse,
        directions.T @ motion + w,
        laws=laws_of(contents),
        free_motion=motion if contents.f.any() else None,  # zeros stand for a motion that is not known
        **attributes,
    )


def _condensed(
    contents: GlobalContents,
    mass: sp.csr_array[Any],
    directions: sp.csc_array[Any],
    w: FloatArray,
    attributes: dict[str, Any],
) -> ContactProblem:
    """Return the problem by G = Dᵀ M⁻¹ D and c = Dᵀ M⁻¹ f + w, for an M whose inverse would be too large to store."""
    n_dofs, n_rows = directions.shape
    if n_dofs * n_rows > MOST_COLUMN_ENTRIES:
        raise ProblemError(f"M couples too many of its {n_dofs} degrees of freedom for {n_rows} rows; use W and q.")
    from scipy.sparse.linalg import splu  # import takes 0.1 s

    try:
        factors = splu(sp.csc_array(mass))
    except RuntimeError:
        raise ProblemError("M must be positive definite, but it is singular.") from None
    delassus = directions.T @ factors.solve(directions.toarray())
    attributes["provenance"]["condensed"] = "G = Dᵀ M⁻¹ D replaces M and D = (H, G), because M⁻¹ would be too large"
    c = directions.T @ factors.solve(contents.f) + w
    return ContactProblem(c, laws_of(contents), matrix=sp.csr_array(0.5 * (delassus + delassus.T)), **attributes)


def _check_coupling(difference: sp.csr_array[Any], problem: ContactProblem) -> None:
    """Raise ``ProblemError`` unless G is symmetric between contacts and joints."""
    if problem.allow_asymmetric and difference.count_nonzero():
        raise ProblemError(
            f"G of {problem.name!r} is not symmetric between contacts and joints, and FCLIB stores that part once."
        )


def _without_contacts(
    factors: Factors, directions: sp.csc_array[Any], c: FloatArray, mass: sp.csr_array[Any]
) -> tuple[FloatArray, FloatArray]:
    """Return f and w; f is zero if c could not be reproduced with it.

    The term that a reader adds to w is computed with the same operations.
    """
    motion = factors.free_motion
    nothing = np.zeros(factors.n_dofs), c
    if motion is None:
        return nothing
    inverse, f = InverseMass.of_mass(mass), mass @ motion
    for _ in range(ATTEMPTS):
        moved = directions.T @ inverse.times(f)
        w = c - moved
        if np.array_equal(moved + w, c):
            return f, w
        f += mass @ (motion - inverse.times(f))  # the same up to rounding
    return nothing


def _about(problem: ContactProblem) -> dict[str, str]:
    known = dict(problem.provenance)
    title, described = str(known.pop("title", problem.name)), known.pop("description", None)
    math_info = str(known.pop("math_info", ""))
    described = "; ".join(f"{key}: {value}" for key, value in known.items()) if described is None else str(described)
    return dict(zip(TEXTS, (title, described, math_info), strict=True))
