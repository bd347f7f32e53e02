"""Repair of matrices that were read from files and are not quite symmetric or semidefinite.

Public files contain mass matrices with a single triangle, and matrices that lost their symmetry or their smallest
eigenvalues to rounding. The user chooses a remedy by name, and the provenance of the problem records it.
"""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import scipy.sparse as sp

from ..contact.matrices.symmetric import NEGATIVE_TOLERANCE, SYMMETRY_TOLERANCE
from ..errors import IndefiniteError, ProblemError, suggestion

Symmetry = Literal["mean", "lower", "upper", "keep", "refuse"]
"""Remedies for an asymmetric matrix A: (A + Aᵀ)/2, its lower or upper triangle, A unchanged, or an error."""

Indefinite = Literal["refuse", "project"]
"""Remedies for a Delassus matrix with a negative eigenvalue: an error, or the nearest semidefinite matrix."""

ASYMMETRY = "asymmetry"
"""Entry of the provenance: max |A − Aᵀ| / max |A| of a matrix that was repaired or kept."""

MAX_ASYMMETRY = 1e-2
"""max |A − Aᵀ| / max |A| up to which "mean" applies; beyond it, the difference is not rounding."""

MAX_NEGATIVE = 1e-6
"""Largest magnitude of a negative eigenvalue, relative to the largest one, that "project" replaces by 0."""

MAX_ROWS = 5000
"""Largest number of rows of a matrix to project, for which all eigenvalues are computed."""


class AsymmetricError(ProblemError):
    """A matrix is more asymmetric than its remedy allows.

    Attributes:
        reason: what is wrong, a sentence without a full stop.
        remedy: the ``Symmetry`` that reads the matrix.
    """

    def __init__(self, reason: str, remedy: Symmetry) -> None:
        super().__init__(reason, remedy)
        self.reason, self.remedy = reason, remedy

    def __str__(self) -> str:
        return f"{self.reason}; read it with `symmetry` {self.remedy!r}."


@dataclass(frozen=True)
class Repair:
    """Remedies for the matrices of a file.

    Attributes:
        symmetry: remedy for an asymmetric Delassus or mass matrix.
        indefinite: remedy for a Delassus matrix with a negative eigenvalue.

    Raises:
        ProblemError: if a remedy is unknown.
    """

    symmetry: Symmetry = "mean"
    indefinite: Indefinite = "refuse"

    def __post_init__(self) -> None:
        for option, known in (("symmetry", get_args(Symmetry)), ("indefinite", get_args(Indefinite))):
            remedy = getattr(self, option)
            if remedy not in known:
                raise ProblemError(f"`{option}` {remedy!r} is unknown{suggestion(str(remedy), known)}")

    def delassus(self, matrix: sp.csr_array[Any], name: str = "G") -> tuple[sp.csr_array[Any], dict[str, Any], bool]:
        """Return a repaired Delassus matrix, the entries of the provenance, and whether it remains asymmetric.

        Raises:
            ProblemError: if the remedy does not apply to the matrix.
        """
        matrix, notes = symmetric(matrix, name, self.symmetry)
        return self.semidefinite(matrix, notes)

    def semidefinite(
        self, matrix: sp.csr_array[Any], notes: dict[str, Any]
    ) -> tuple[sp.csr_array[Any], dict[str, Any], bool]:
        """Repair a matrix that ``symmetric`` has returned with its ``notes``; see ``delassus``."""
        if notes and self.symmetry == "keep":
            return matrix, notes, True
        if self.indefinite == "project":
            matrix, projected = semidefinite(matrix)
            notes = notes | projected
        return matrix, notes, False

    def mass(self, matrix: sp.csr_array[Any]) -> tuple[sp.csr_array[Any], dict[str, Any]]:
        """Return a repaired mass matrix, and the entries of the provenance.

        Raises:
            ProblemError: if the remedy does not apply to the matrix, or is "keep".
        """
        if self.symmetry == "keep":
            raise ProblemError("`symmetry` keep applies only to a Delassus matrix; a mass matrix M must be symmetric.")
        matrix, notes = symmetric(matrix, "M", self.symmetry)
        if self.symmetry == "mean" and asymmetry(matrix):
            # an asymmetry within the rounding of M may exceed the rounding of one of its blocks
            matrix = sp.csr_array(0.5 * (matrix + matrix.T))
        return matrix, notes


@contextmanager
def named_in_errors(name: str, file_format: str, repair: Repair) -> Iterator[None]:
    """Add the name of a file to a ``ProblemError``, and the command that repairs its matrix.

    Args:
        name: the path of the file.
        file_format: format of the file, as ``proxbench import`` calls it.
        repair: the remedies that did not suffice; the command keeps those that differ from the defaults.
    """
    command = f"run: proxbench import {file_format} {shlex.quote(name)}"
    try:
        yield
    except IndefiniteError as error:
        option = "" if repair.symmetry == Repair.symmetry else f" --symmetry {repair.symmetry}"
        raise ProblemError(
            f"{name}: {str(error).rstrip('.')}; correct the matrix, or, if the negative eigenvalue is a rounding "
            f"error of at most {MAX_NEGATIVE:g} of the largest, {command}{option} --indefinite project --output NEW.npz"
        ) from None
    except AsymmetricError as error:
        option = "" if repair.indefinite == Repair.indefinite else f" --indefinite {repair.indefinite}"
        raise ProblemError(f"{name}: {error.reason}; {command} --symmetry {error.remedy}{option}") from None
    except ProblemError as error:
        raise ProblemError(f"{name}: {error}") from None


def asymmetry(matrix: sp.csr_array[Any]) -> float:
    """Return max |A − Aᵀ| / max |A|, 0 for a matrix of zeros."""
    largest = float(np.abs(matrix.data).max(initial=0.0))
    difference = matrix - matrix.T
    return float(np.abs(difference.data).max(initial=0.0)) / largest if largest > 0.0 else 0.0


def symmetric(matrix: sp.csr_array[Any], name: str, how: Symmetry) -> tuple[sp.csr_array[Any], dict[str, Any]]:
    """Return a symmetric matrix, or ``matrix`` with "keep", and the entries of the provenance that describe the repair.

    Args:
        matrix: A, square.
        name: name of the matrix in messages.
        how: the remedy; asymmetry within rounding, 1e-12 of the largest entry, is ignored.

    Raises:
        AsymmetricError: if the asymmetry is larger than the remedy allows.
    """
    relative_asymmetry = asymmetry(matrix)
    if relative_asymmetry <= SYMMETRY_TOLERANCE or not np.isfinite(matrix.data).all():
        # ContactProblem rejects NaN and inf
        return matrix, {}
    fault = f"{name} is asymmetric by {relative_asymmetry:.1e} of its largest entry"
    if how == "refuse" or (how == "mean" and not relative_asymmetry <= MAX_ASYMMETRY):
        raise _asymmetric_error(fault, matrix, relative_asymmetry)
    repaired, remedy = matrix, "is kept unchanged"
    if how == "mean":
        repaired, remedy = sp.csr_array(0.5 * (matrix + matrix.T)), f"is replaced by ({name} + {name}ᵀ)/2"
    elif how in ("lower", "upper"):
        strict = sp.tril(matrix, -1) if how == "lower" else sp.triu(matrix, 1)
        repaired = sp.csr_array(strict + strict.T + sp.diags_array(matrix.diagonal()))
        remedy = f"only its {how} triangle is read"
    return repaired, {ASYMMETRY: relative_asymmetry, "matrix": f"{fault}, and {remedy}"}


def semidefinite(matrix: sp.csr_array[Any]) -> tuple[sp.csr_array[Any], dict[str, Any]]:
    """Return the nearest positive semidefinite matrix in the Frobenius norm, and the entries of the provenance.

    With A = V diag(λ) Vᵀ it is V diag(max(λ, 0)) Vᵀ (Higham 1988, *Linear Algebra Appl.* 103, 103–118). A matrix
    without negative eigenvalues beyond rounding is returned unchanged.

    Raises:
        ProblemError: if the matrix is too large, or an eigenvalue is too far below zero to be a rounding error.
    """
    if matrix.shape[0] > MAX_ROWS:
        raise ProblemError(f"G has {matrix.shape[0]} rows, but `indefinite` project supports at most {MAX_ROWS}.")
    if not matrix.shape[0] or not np.isfinite(matrix.data).all():  # ContactProblem rejects NaN and inf
        return matrix, {}
    values, vectors = np.linalg.eigh(matrix.toarray().astype(np.float64))
    lowest = float(values[0] / max(values[-1], np.finfo(np.float64).tiny))
    if lowest >= -NEGATIVE_TOLERANCE:
        return matrix, {}
    if lowest < -MAX_NEGATIVE:
        raise ProblemError(
            f"G has the negative eigenvalue {values[0]:.3g} and the largest eigenvalue {values[-1]:.3g}; `indefinite` "
            f"project replaces only negative eigenvalues up to {MAX_NEGATIVE:g} of the largest one."
        )
    root = vectors[:, values > 0.0] * np.sqrt(values[values > 0.0])
    remedy = "negative eigenvalues of G are replaced by 0"
    return sp.csr_array(root @ root.T), {"least_eigenvalue": lowest, "eigenvalues": remedy}


def _asymmetric_error(fault: str, matrix: sp.csr_array[Any], relative_asymmetry: float) -> AsymmetricError:
    """Return the error with the remedy that suits the entries of a matrix."""
    if not sp.triu(matrix, 1).count_nonzero():
        return AsymmetricError(f"{fault}, and only its lower triangle has entries", "lower")
    if not sp.tril(matrix, -1).count_nonzero():
        return AsymmetricError(f"{fault}, and only its upper triangle has entries", "upper")
    if relative_asymmetry <= MAX_ASYMMETRY:
        return AsymmetricError(fault, "mean")
    return AsymmetricError(f"{fault}, and either its lower or its upper triangle is wrong", "lower")
