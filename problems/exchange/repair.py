"""Matrices of files that are not quite symmetric or semidefinite, and the named ways to read them.

Public files store a mass matrix by one triangle alone, or matrices that lost their symmetry or their last eigenvalues
to rounding. Each remedy has a name, is chosen by the reader, and is recorded in the provenance of the problem.
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
"""How a matrix A that is not symmetric is read: as (A + Aᵀ)/2, by its lower or upper triangle, unchanged, or not."""

Indefinite = Literal["refuse", "project"]
"""How a Delassus matrix with a negative eigenvalue is read: not, or as the nearest semidefinite matrix."""

ASYMMETRY = "asymmetry"
"""The entry of the provenance with max |A − Aᵀ| / max |A| of a matrix that was repaired or kept."""

LARGEST_ASYMMETRY = 1e-2
"""max |A − Aᵀ| / max |A| up to which "mean" applies; beyond it, the difference is no rounding."""

LARGEST_NEGATIVE = 1e-6
"""Negative eigenvalue, relative to the largest one, up to which "project" applies."""

MOST_ROWS = 5000
"""Rows up to which a matrix is projected; all its eigenvalues are computed."""


class AsymmetricError(ProblemError):
    """A matrix misses symmetry by more than its remedy admits.

    Attributes:
        reason: what is wrong, a sentence without its period.
        remedy: the ``Symmetry`` that reads the matrix.
    """

    def __init__(self, reason: str, remedy: Symmetry) -> None:
        super().__init__(reason, remedy)
        self.reason, self.remedy = reason, remedy

    def __str__(self) -> str:
        return f"{self.reason}; read it with `symmetry` {self.remedy!r}."


@contextmanager
def named_in_errors(name: str, file_format: str) -> Iterator[None]:
    """Put the name of a file before the text of a ``ProblemError``, and the command that repairs a matrix behind.

    Args:
        name: the path of the file.
        file_format: its format, as ``proxbench import`` calls it.
    """
    command = f"run: proxbench import {file_format} {shlex.quote(name)}"
    try:
        yield
    except IndefiniteError as error:
        raise ProblemError(f"{name}: {str(error).rstrip('.')}; {command} --indefinite project") from None
    except AsymmetricError as error:
        raise ProblemError(f"{name}: {error.reason}; {command} --symmetry {error.remedy}") from None
    except ProblemError as error:
        raise ProblemError(f"{name}: {error}") from None


@dataclass(frozen=True)
class Repair:
    """How matrices of a file are read that are not quite what they must be.

    Attributes:
        symmetry: of a Delassus matrix or a mass matrix that is not symmetric.
        indefinite: of a Delassus matrix with a negative eigenvalue.

    Raises:
        ProblemError: for a word that names no way to read a matrix.
    """

    symmetry: Symmetry = "mean"
    indefinite: Indefinite = "refuse"

    def __post_init__(self) -> None:
        for option, known in (("symmetry", get_args(Symmetry)), ("indefinite", get_args(Indefinite))):
            word = getattr(self, option)
            if word not in known:
                raise ProblemError(f"`{option}` {word!r} is unknown{suggestion(str(word), known)}")

    def delassus(self, matrix: sp.csr_array[Any], name: str = "G") -> tuple[sp.csr_array[Any], dict[str, Any], bool]:
        """Return a Delassus matrix repaired, the entries of the provenance, and whether it is kept unsymmetric.

        Raises:
            ProblemError: if it is further off than the remedy admits.
        """
        matrix, notes = symmetric(matrix, name, self.symmetry)
        return self.semidefinite(matrix, notes)

    def semidefinite(
        self, matrix: sp.csr_array[Any], notes: dict[str, Any]
    ) -> tuple[sp.csr_array[Any], dict[str, Any], bool]:
        """Return the same as ``delassus`` for a matrix that was read as symmetric, with the ``notes`` about that."""
        if notes and self.symmetry == "keep":
            return matrix, notes, True
        if self.indefinite == "project":
            matrix, projected = semidefinite(matrix)
            notes = notes | projected
        return matrix, notes, False

    def mass(self, matrix: sp.csr_array[Any]) -> tuple[sp.csr_array[Any], dict[str, Any]]:
        """Return a mass matrix repaired, and the entries of the provenance.

        Raises:
            ProblemError: if it is further off than the remedy admits, or is to be kept unsymmetric.
        """
        if self.symmetry == "keep":
            raise ProblemError("`symmetry` keep is for W; a mass matrix M must be symmetric.")
        matrix, notes = symmetric(matrix, "M", self.symmetry)
        if self.symmetry == "mean" and asymmetry(matrix):
            matrix = sp.csr_array(0.5 * (matrix + matrix.T))  # rounding beside M may be large in one of its blocks
        return matrix, notes


def asymmetry(matrix: sp.csr_array[Any]) -> float:
    """Return max |A − Aᵀ| / max |A|, 0 for a matrix of zeros."""
    largest = float(np.abs(matrix.data).max(initial=0.0))
    difference = matrix - matrix.T
    return float(np.abs(difference.data).max(initial=0.0)) / largest if largest > 0.0 else 0.0


def symmetric(matrix: sp.csr_array[Any], name: str, how: Symmetry) -> tuple[sp.csr_array[Any], dict[str, Any]]:
    """Return a matrix read as symmetric, and the entries of the provenance that describe its repair.

    Args:
        matrix: A, square.
        name: what messages call it.
        how: the remedy. Asymmetry of rounding, 1e-12 of the largest entry, needs none.

    Raises:
        AsymmetricError: if the asymmetry is larger than the remedy admits.
    """
    off = asymmetry(matrix)
    if off <= SYMMETRY_TOLERANCE or not np.isfinite(matrix.data).all():  # the latter is refused by the problem
        return matrix, {}
    misses = f"{name} misses symmetry by {off:.1e} of its largest entry"
    if how == "refuse" or (how == "mean" and not off <= LARGEST_ASYMMETRY):
        raise _asymmetric(misses, matrix, off)
    repaired, remedy = matrix, "is kept so"
    if how == "mean":
        repaired, remedy = sp.csr_array(0.5 * (matrix + matrix.T)), f"is replaced by ({name} + {name}ᵀ)/2"
    elif how in ("lower", "upper"):
        strict = sp.tril(matrix, -1) if how == "lower" else sp.triu(matrix, 1)
        repaired = sp.csr_array(strict + strict.T + sp.diags_array(matrix.diagonal()))
        remedy = f"is read by its {how} triangle"
    return repaired, {ASYMMETRY: off, "matrix": f"{misses}, and {remedy}"}


def semidefinite(matrix: sp.csr_array[Any]) -> tuple[sp.csr_array[Any], dict[str, Any]]:
    """Return the nearest positive semidefinite matrix in the Frobenius norm, and its entries of the provenance.

    With A = V diag(λ) Vᵀ it is V diag(max(λ, 0)) Vᵀ (Higham 1988, *Linear Algebra Appl.* 103, 103–118). A matrix
    without negative eigenvalues beyond rounding is returned as it is.

    Raises:
        ProblemError: if the matrix is too large, or an eigenvalue is too far below zero to be an error of rounding.
    """
    if matrix.shape[0] > MOST_ROWS:
        raise ProblemError(f"G has {matrix.shape[0]} rows, and `indefinite` project takes up to {MOST_ROWS}.")
    if not matrix.shape[0]:
        return matrix, {}
    values, vectors = np.linalg.eigh(matrix.toarray().astype(np.float64))
    least = float(values[0] / max(values[-1], np.finfo(np.float64).tiny))
    if least >= -NEGATIVE_TOLERANCE:
        return matrix, {}
    if least < -LARGEST_NEGATIVE:
        raise ProblemError(
            f"G has the eigenvalue {values[0]:.3g} beside {values[-1]:.3g}, and `indefinite` project replaces those "
            f"up to {LARGEST_NEGATIVE:g} of the largest one."
        )
    kept = vectors[:, values > 0.0] * np.sqrt(values[values > 0.0])
    remedy = "negative eigenvalues of G are replaced by 0"
    return sp.csr_array(kept @ kept.T), {"least_eigenvalue": least, "eigenvalues": remedy}


def _asymmetric(misses: str, matrix: sp.csr_array[Any], off: float) -> AsymmetricError:
    """Return the error with the remedy that suits the entries of a matrix."""
    if not sp.triu(matrix, 1).count_nonzero():
        return AsymmetricError(f"{misses}, and only its lower triangle has entries", "lower")
    if not sp.tril(matrix, -1).count_nonzero():
        return AsymmetricError(f"{misses}, and only its upper triangle has entries", "upper")
    if off <= LARGEST_ASYMMETRY:
        return AsymmetricError(misses, "mean")
    return AsymmetricError(f"{misses}, and either its lower or its upper triangle is wrong", "lower")
