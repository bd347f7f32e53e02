"""Problems as plain arrays, as ``numpy.savez("mine.npz", G=G, c=c, mu=mu)`` writes them.

======================== ==================================================================================
``G``                    Delassus matrix [1/kg], shape (n_rows, n_rows), dense; or instead its CSR form in
``data, indices, indptr`` three arrays
``c``                    free velocity [m/s], shape (n_rows,)
``mu``                   friction coefficient, one number or shape (n_contacts,); may be left out for ``dim`` 1
``dim``                  rows per contact: 1, 2 or 3; found from the lengths of ``c`` and ``mu`` if left out
======================== ==================================================================================
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..contact.problem import ContactProblem
from ..errors import ProblemError, suggestion

CSR_PARTS = ("data", "indices", "indptr")

KNOWN = ("G", *CSR_PARTS, "c", "mu", "dim")

EXAMPLE = "numpy.savez(file, G=G, c=c, mu=mu)"

DEFAULT_DIM = 3
"""Rows per contact where one friction coefficient holds for all contacts."""


def is_plain(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether a file without a description looks like plain arrays of a problem."""
    return "about" not in arrays and not {"G", "c", "mu"}.isdisjoint(arrays)


def problem_of_arrays(arrays: Mapping[str, NDArray[Any]], name: str) -> ContactProblem:
    """Return the problem that plain arrays define.

    Args:
        arrays: the arrays of the file by name, see the module.
        name: what messages call the file.

    Raises:
        ProblemError: if an array is missing, unknown, or does not fit the others.
    """
    for key in arrays:
        if key not in KNOWN:
            raise ProblemError(f"{name} holds an unknown array {key!r}{suggestion(key, KNOWN)}")
    if "c" not in arrays:
        raise ProblemError(f"{name} has no array 'c', the free velocity; write it with {EXAMPLE}.")
    try:
        dim = _dim(arrays)
        if "mu" not in arrays and dim != 1:
            raise ProblemError("there is no array 'mu', the friction coefficients; add it, or dim=1 for no friction.")
        return ContactProblem.from_delassus(_delassus(arrays), arrays["c"], arrays.get("mu", 0.0), dim)
    except ProblemError as error:
        raise ProblemError(f"{name}: {error}") from None


def _dim(arrays: Mapping[str, NDArray[Any]]) -> int:
    """Return the rows per contact, as given or from the lengths of c and μ."""
    if "dim" in arrays:
        if arrays["dim"].size != 1 or arrays["dim"].dtype.kind not in "iu":
            raise ProblemError("'dim' must be one whole number: 1, 2 or 3 rows per contact.")
        return int(arrays["dim"].item())
    if "mu" not in arrays or arrays["mu"].ndim == 0:
        return DEFAULT_DIM
    rows, contacts = arrays["c"].size, arrays["mu"].size
    if contacts == 0 or rows % contacts or rows // contacts not in (1, 2, 3):
        raise ProblemError(f"'c' has {rows} rows and 'mu' {contacts} contacts; there must be 1, 2 or 3 rows a contact.")
    return rows // contacts


def _delassus(arrays: Mapping[str, NDArray[Any]]) -> Any:
    has_parts = [part for part in CSR_PARTS if part in arrays]
    if ("G" in arrays) == bool(has_parts):
        raise ProblemError(f"give the Delassus matrix once, as array 'G' or as CSR arrays {', '.join(CSR_PARTS)}.")
    if "G" in arrays:
        return arrays["G"]
    if len(has_parts) < len(CSR_PARTS):
        missing = next(part for part in CSR_PARTS if part not in arrays)
        raise ProblemError(f"the Delassus matrix has no array {missing!r}; CSR needs {', '.join(CSR_PARTS)}.")
    data, indices, indptr = (arrays[part] for part in CSR_PARTS)
    rows = arrays["c"].size
    try:
        if indices.dtype.kind not in "iu" or indptr.dtype.kind not in "iu":
            raise ValueError("indices must be whole numbers")
        matrix = sp.csr_array((data, indices.astype(np.int64), indptr.astype(np.int64)), shape=(rows, rows))
        matrix.check_format(full_check=True)  # compiled code later relies on the indices
    except (ValueError, TypeError) as error:
        raise ProblemError(f"the CSR arrays are no {rows} x {rows} matrix: {error}.") from None
    return matrix
