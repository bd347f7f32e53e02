"""Problems of ContactBench, as its samples store them: ``numpy.savez(file, G=G, g=g, mus=mus)``.

Its contacts have the rows T1, T2, N, and σ = G λ + g is the relative velocity. So G and g are G and c of Proxbench with
their rows in another order. Source: https://github.com/Simple-Robotics/ContactBench, ``examples/solve_ncp.py`` and
``include/contactbench/friction-constraint.hxx``.
"""

from ...contact.problem import ContactProblem
from ...errors import ProblemError
from ..repair import Repair
from .plain import Arrays, normal_first, problem_of_delassus

ARRAYS = ("G", "g", "mus")
"""Names of the arrays of a file."""


def recognises(arrays: Arrays) -> bool:
    """Return whether the arrays have the names of ContactBench."""
    return "g" in arrays and "mus" in arrays


def problem_of_arrays(arrays: Arrays, repair: Repair) -> ContactProblem:
    """Return the problem of a file of ContactBench.

    Args:
        arrays: G, shape (3n, 3n), g, shape (3n,) or (3n, 1), and mus, shape (n,).
        repair: how an asymmetric or indefinite G is read.

    Raises:
        ProblemError: if an array is missing or does not match the others.
    """
    missing = [name for name in ARRAYS if name not in arrays]
    if missing:
        raise ProblemError(f"there is no array {missing[0]!r}; ContactBench writes {', '.join(ARRAYS)}.")
    c, mu = arrays["g"].ravel(), arrays["mus"].ravel()
    if c.size != 3 * mu.size:
        raise ProblemError(
            f"'g' has {c.size} rows and 'mus' {mu.size} contacts; ContactBench has three rows per contact."
        )
    return problem_of_delassus(arrays["G"], c, mu, normal_first(mu.size), repair, source="ContactBench")
