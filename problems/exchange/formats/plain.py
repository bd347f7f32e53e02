"""Problems as plain arrays, from ``numpy.savez("mine.npz", G=G, c=c, mu=mu)`` or a JSON object with the same names.

================================= ===============================================================================
``c``                             free velocity [m/s], shape (n_rows,)
``mu``                            friction coefficient, one number or shape (n_contacts,); optional if ``dim`` is 1
``G``                             Delassus matrix [1/kg], shape (n_rows, n_rows), dense; or its CSR form in
``data``, ``indices``, ``indptr`` three arrays
``W`` with ``Minv`` or ``M``      instead of G, its factors: force directions, shape (n_dofs, n_rows), and the
                                  inverse mass or mass matrix: its diagonal, shape (n_dofs,), its diagonal
                                  blocks, shape (n_blocks, k, k), or the whole matrix
``dim``                           rows per contact: 1, 2 or 3; by default, inferred from the lengths of ``c`` and ``mu``
``normal``                        "first" (default) or "last": position of the normal row among the rows of a contact
``impulses``                      Λ [N s] of the program that wrote the file, shape (n_rows,); optional, for the judge
``version``                       1; optional
================================= ===============================================================================
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...arrays import FloatArray, IntArray
from ...contact.laws import Laws
from ...contact.matrices.factors import InverseMass
from ...contact.problem import ContactProblem
from ...errors import ProblemError, suggestion
from ..repair import Repair
from ..stored_solution import with_stored_solution

Arrays = Mapping[str, NDArray[Any]]

VERSION = 1
"""Newest version of the names in the module docstring."""

CSR_PARTS = ("data", "indices", "indptr")
"""Names of the three arrays of G in CSR."""

FACTORS = ("W", "Minv", "M")
"""Names of the factors of G."""

KNOWN = ("G", *CSR_PARTS, *FACTORS, "c", "mu", "dim", "normal", "impulses", "version")
"""Names of all arrays that a file may have."""

EXAMPLE = "numpy.savez(file, G=G, c=c, mu=mu)"
"""Example of writing a file, for error messages."""

DEFAULT_DIM = 3
"""Rows per contact if one friction coefficient applies to all contacts."""


def recognises(arrays: Arrays) -> bool:
    """Return whether an array has the name G, c, mu or W."""
    return not {"G", "c", "mu", "W"}.isdisjoint(arrays)


def problem_of_arrays(arrays: Arrays, repair: Repair) -> ContactProblem:
    """Return the problem that plain arrays define.

    Args:
        arrays: the arrays of the file by name, as in the module docstring.
        repair: how an asymmetric or indefinite matrix is read.

    Raises:
        ProblemError: if an array is missing, unknown, or does not match the others.
    """
    for key in arrays:
        if key not in KNOWN:
            raise ProblemError(f"there is an unknown array {key!r}{suggestion(key, KNOWN)}")
    check_version(arrays, VERSION)
    if "c" not in arrays:
        raise ProblemError(f"there is no array 'c', the free velocity; write it with {EXAMPLE}.")
    dim = _dim(arrays)
    if "mu" not in arrays and dim != 1:
        raise ProblemError("there is no array 'mu', the friction coefficients; add it, or dim=1 for no friction.")
    c, mu = arrays["c"], arrays.get("mu", np.array(0.0))
    order = _order(arrays, dim, c.size)
    if not {"W", "Minv", "M"}.isdisjoint(arrays):
        directions, inverse, notes = _factors(arrays, repair)
        if directions.ndim == 2 and directions.shape[1] == c.size:
            directions = directions[:, order]
        arguments = directions, inverse, _in_order(c, order), mu, dim
        problem = ContactProblem.from_factors(*arguments, provenance=notes)
    else:
        problem = problem_of_delassus(_delassus(arrays), c, mu, order, repair, dim=dim)
    if "impulses" not in arrays:
        return problem
    return with_stored_solution(problem, _in_order(stored_impulses(arrays["impulses"], c.size), order))


def problem_of_delassus(
    matrix: Any,
    c: NDArray[Any],
    mu: NDArray[Any],
    order: IntArray,
    repair: Repair,
    *,
    dim: int = 3,
    laws: Laws | None = None,
    **provenance: Any,
) -> ContactProblem:
    """Return the problem of G and c with reordered rows and a repaired G.

    Args:
        matrix: G [1/kg], dense or sparse, shape (n_rows, n_rows).
        c: free velocity [m/s], shape (n_rows,).
        mu: friction coefficient, one number or one for each contact.
        order: the old index of each row, shape (n_rows,).
        repair: how an asymmetric or indefinite G is read.
        dim: rows per contact.
        laws: any mixture of laws, instead of ``mu`` and ``dim``.
        provenance: entries of the provenance.

    Raises:
        ProblemError: as ``ContactProblem.from_delassus``.
    """
    rows = len(order)
    if np.shape(matrix) == (rows, rows) and np.issubdtype(matrix.dtype, np.number):
        matrix, notes, is_asymmetric = repair.delassus(sp.csr_array(sp.csr_array(matrix)[order][:, order]))
        attributes: dict[str, Any] = {"provenance": provenance | notes, "allow_asymmetric": is_asymmetric}
    else:
        attributes = {"provenance": provenance}  # ``from_delassus`` rejects the matrix
    contact_arguments = (mu, dim) if laws is None else ()
    return ContactProblem.from_delassus(matrix, _in_order(c, order), *contact_arguments, laws=laws, **attributes)


def check_version(arrays: Arrays, newest: int) -> None:
    """Raise ``ProblemError`` if a file has a version that is not supported."""
    version = arrays.get("version", np.array(newest))
    if version.size != 1 or version.dtype.kind not in "iu" or not 1 <= version.item() <= newest:
        raise ProblemError(f"'version' must be a whole number up to {newest}; write the file in version {newest}.")


def normal_first(n_contacts: int, first_row: int = 0) -> IntArray:
    """Return indices of rows T1, T2, N of contacts in the order N, T1, T2; rows before ``first_row`` stay in place."""
    contacts = first_row + np.arange(3 * n_contacts).reshape(-1, 3)[:, [2, 0, 1]].ravel()
    return np.append(np.arange(first_row), contacts).astype(np.int64)


def stored_impulses(impulses: NDArray[Any], n_rows: int) -> FloatArray:
    """Return the impulses of a file as numbers, shape (n_rows,).

    Raises:
        ProblemError: if the impulses are not finite numbers, one per row.
    """
    if impulses.size != n_rows or impulses.dtype.kind not in "fiu" or not np.isfinite(impulses).all():
        raise ProblemError(f"'impulses' must be {n_rows} finite numbers, one per row; got shape {impulses.shape}.")
    return impulses.astype(np.float64).ravel()


def _dim(arrays: Arrays) -> int:
    """Return the rows per contact, as given or from the lengths of c and μ."""
    if "dim" in arrays:
        if arrays["dim"].size != 1 or arrays["dim"].dtype.kind not in "iu":
            raise ProblemError("'dim' must be one whole number: 1, 2 or 3 rows per contact.")
        return int(arrays["dim"].item())
    if "mu" not in arrays or arrays["mu"].ndim == 0:
        return DEFAULT_DIM
    rows, contacts = arrays["c"].size, arrays["mu"].size
    if contacts == 0 or rows % contacts or rows // contacts not in (1, 2, 3):
        raise ProblemError(f"'c' has {rows} rows and 'mu' {contacts} contacts; give 1, 2 or 3 rows per contact.")
    return rows // contacts


def _order(arrays: Arrays, dim: int, rows: int) -> IntArray:
    """Return the indices of the rows in the order N, T1, T2."""
    position = str(arrays.get("normal", np.array("first")))
    if position not in ("first", "last"):
        raise ProblemError(f"'normal' must be 'first' or 'last', got {position!r}.")
    order = np.arange(rows)
    if position == "last" and dim in (2, 3) and rows % dim == 0:
        order = np.roll(order.reshape(-1, dim), 1, axis=1).ravel()
    return order


def _in_order(values: NDArray[Any], order: IntArray) -> NDArray[Any]:
    return values[order] if values.ndim == 1 else values


def _delassus(arrays: Arrays) -> Any:
    parts = [part for part in CSR_PARTS if part in arrays]
    if ("G" in arrays) == bool(parts):
        raise ProblemError(f"give the Delassus matrix once, as array 'G' or as CSR arrays {', '.join(CSR_PARTS)}.")
    if "G" in arrays:
        return arrays["G"]
    if len(parts) < len(CSR_PARTS):
        missing = next(part for part in CSR_PARTS if part not in arrays)
        raise ProblemError(f"the Delassus matrix has no array {missing!r}; CSR needs {', '.join(CSR_PARTS)}.")
    data, indices, indptr = (arrays[part] for part in CSR_PARTS)
    rows = arrays["c"].size
    try:
        if indices.dtype.kind not in "iu" or indptr.dtype.kind not in "iu":
            raise ValueError("indices must be whole numbers")
        matrix = sp.csr_array((data, indices.astype(np.int64), indptr.astype(np.int64)), shape=(rows, rows))
        matrix.check_format(full_check=True)  # compiled code relies on the indices
    except (ValueError, TypeError) as error:
        raise ProblemError(f"the CSR arrays are not a {rows} x {rows} matrix: {error}.") from None
    return matrix


def _factors(arrays: Arrays, repair: Repair) -> tuple[NDArray[Any], Any, dict[str, Any]]:
    """Return W, M⁻¹ and the entries of the provenance about a repaired M."""
    if "W" not in arrays or ("Minv" in arrays) == ("M" in arrays) or "G" in arrays or "data" in arrays:
        raise ProblemError("give either 'G', or 'W' with one of 'Minv' and 'M'.")
    if "Minv" in arrays:
        return arrays["W"], _assembled(arrays["Minv"]), {}
    mass = _assembled(arrays["M"])
    mass, notes = repair.mass(sp.csr_array(sp.diags_array(mass) if mass.ndim == 1 else mass))
    return arrays["W"], InverseMass.of_mass(mass), notes


def _assembled(matrix: NDArray[Any]) -> Any:
    """Return a matrix of diagonal blocks, shape (n, k, k), as one sparse matrix, and other matrices unchanged."""
    return sp.block_diag(list(matrix), format="csr") if matrix.ndim == 3 else matrix
