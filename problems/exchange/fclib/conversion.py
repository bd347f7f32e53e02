"""FCLIB's problems as contact problems, and back.

FCLIB asks for the relative velocities u and impulses r of contacts with C*_μ ∋ u + μ‖u_T‖ e_N ⟂ r ∈ C_μ, De Saxcé's
form of −u_N ∈ N_{R₀⁺}(r_N), −u_T ∈ N_{S(μ r_N)}(r_T); with rolling friction the cone is ‖r_T‖ ≤ μ r_N, ‖r_R‖ ≤ μ_r r_N,
and u is lifted by μ_r‖u_R‖ too. Joints have zero on the left side of their rows and impulses λ without bounds. So the
signs are those of ``laws``, and with our letters on the left sides::

    local    ξ = (u, 0),  Λ = (r, λ),  G = [[W, V], [Vᵀ, R]],  c = (q, s)
    global   ξ = (u, 0),  Λ = (r, λ),  W = [H, G],  c = (Hᵀ M⁻¹ f + w, Gᵀ M⁻¹ f + b),
             free motion M⁻¹ f,  velocity after the step v = M⁻¹ (f + H r + G λ)

Whatever the contacts' own velocities before the step add, as by Newton's impact law, is in q or w already: u is
γ_E + ε γ_B, as ξ is.
"""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from ...arrays import FloatArray
from ...contact.answer import Answer
from ...contact.judge import judge
from ...contact.matrices.factors import Factors, InverseMass
from ...contact.matrices.symmetric import SYMMETRY_TOLERANCE
from ...contact.problem import ContactProblem
from ...errors import ProblemError
from .contents import TEXTS, GlobalContents, LocalContents
from .laws import contacts_of, laws_of, rows_in_order
from .matrices import asymmetry

Asymmetry = Literal["symmetrise", "keep", "refuse"]
"""What is done with a W that is not symmetric: it is replaced by (W + Wᵀ)/2, kept as it is, or refused."""

LARGEST_ASYMMETRY = 1e-2
"""max |W − Wᵀ| / max |W| up to which W is made symmetric; beyond that it is no Delassus matrix with errors."""

CONFIRMED = 1e-4
"""Judged residual up to which a stored solution is taken for one."""

ATTEMPTS = 10
"""Roundings of f that are tried so that c is found again with every bit: one is enough for half of all problems of ten
rows, ten for nearly all."""


def problem_of(
    contents: LocalContents | GlobalContents, name: str, treatment: Asymmetry = "symmetrise", **provenance: Any
) -> ContactProblem:
    """Return the contact problem of an FCLIB file.

    Args:
        contents: what the file holds.
        name: name of the problem.
        treatment: of a W that is not symmetric.
        provenance: where it comes from, as far as the file does not say it.

    Raises:
        ProblemError: if it has laws that are not treated, or numbers that make no problem.
    """
    provenance |= {key: text for key, text in contents.about.items() if text}
    problem: ContactProblem
    if isinstance(contents, LocalContents):
        problem = _local(contents, treatment, {"name": name, "provenance": provenance})
    else:
        inverse, directions, w = InverseMass.of_mass(contents.M), contents.H, contents.w
        if contents.n_joints:
            directions, w = sp.hstack([directions, contents.G], format="csc"), np.append(w, contents.b)
        motion = inverse.times(contents.f)
        problem = ContactProblem.from_factors(
            directions,
            inverse,
            directions.T @ motion + w,
            laws=laws_of(contents),
            free_motion=motion if contents.f.any() else None,  # zeros stand for a motion that is not known
            name=name,
            provenance=provenance,
        )
    return problem if contents.solution is None else _with_solution(problem, contents.solution)


def contents_of(problem: ContactProblem) -> LocalContents | GlobalContents:
    """Return what a file of ``problem`` holds: of factors a global problem, of a Delassus matrix a local one.

    It has a digest where the same numbers are found from it bit by bit, which needs the joints behind the contacts. A
    free motion is left out where c could not be found again with it. M is the one that M⁻¹ was computed from, or else
    computed from M⁻¹.

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
    if problem_of(contents, problem.name, "keep").digest == problem.digest:
        contents = replace(contents, digest=problem.digest)
    return contents


def digest_obstacle(
    contents: LocalContents | GlobalContents, problem: ContactProblem, treatment: Asymmetry
) -> str | None:
    """Say why the numbers of a file cannot be those that were written, or None; only files written here say it."""
    if contents.digest in ("", problem.digest):
        return None
    if isinstance(contents, LocalContents) and treatment == "symmetrise":
        return digest_obstacle(contents, problem_of(contents, problem.name, "keep"), "keep")
    return "its numbers are not those of the digest that was written with them"


def _local(contents: LocalContents, treatment: Asymmetry, attributes: dict[str, Any]) -> ContactProblem:
    off, name = max((asymmetry(contents.W), "W"), (asymmetry(contents.R), "R"))
    matrix, c = contents.W, contents.q
    if contents.n_joints:
        matrix = sp.block_array([[matrix, contents.V], [contents.V.T, contents.R]], format="csr")
        c = np.append(c, contents.s)
    if off > SYMMETRY_TOLERANCE:
        misses = f"{name} misses symmetry by {off:.1e} of its largest entry"
        if treatment == "refuse" or (treatment == "symmetrise" and not off <= LARGEST_ASYMMETRY):
            raise ProblemError(f"{misses}; correct it, or keep it with `asymmetry` keep.")
        attributes["provenance"]["asymmetry"] = off
        if treatment == "keep":
            attributes["allow_asymmetric"] = True
            attributes["provenance"]["matrix"] = f"{misses}, and is kept so"
        else:
            matrix = sp.csr_array(0.5 * (matrix + matrix.T))
            attributes["provenance"]["matrix"] = f"{misses}, and is replaced by ({name} + {name}ᵀ)/2"
    return ContactProblem(c, laws_of(contents), matrix=matrix, **attributes)


def _check_coupling(difference: sp.csr_array[Any], problem: ContactProblem) -> None:
    """Refuse a G whose part between contacts and joints is not that between joints and contacts, transposed."""
    if problem.allow_asymmetric and difference.count_nonzero():
        raise ProblemError(
            f"G of {problem.name!r} is not symmetric between contacts and joints, and FCLIB stores that part once."
        )


def _with_solution(problem: ContactProblem, impulses: FloatArray) -> ContactProblem:
    """Return the problem with stored impulses judged; they are its known solution where the judge agrees."""
    residual = judge(problem, impulses).residual
    known = Answer(witness=impulses) if residual <= CONFIRMED else None
    return replace(problem, answer=known, provenance={**problem.provenance, "stored_solution_residual": residual})


def _without_contacts(
    factors: Factors, directions: sp.csc_array[Any], c: FloatArray, mass: sp.csr_array[Any]
) -> tuple[FloatArray, FloatArray]:
    """Return f and w, f zero where c could not be found again with it.

    What a reader adds to w is computed here as it will be there.
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
        f += mass @ (motion - inverse.times(f))  # other roundings of the same
    return nothing


def _about(problem: ContactProblem) -> dict[str, str]:
    known = dict(problem.provenance)
    title, described = str(known.pop("title", problem.name)), known.pop("description", None)
    math_info = str(known.pop("math_info", ""))
    described = "; ".join(f"{key}: {value}" for key, value in known.items()) if described is None else str(described)
    return dict(zip(TEXTS, (title, described, math_info), strict=True))
