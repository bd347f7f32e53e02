"""Formats of named arrays, recognised by the names in a file."""

from collections.abc import Callable
from dataclasses import dataclass

from ...contact.problem import ContactProblem
from ...errors import ProblemError
from ..repair import Repair, named_in_errors
from . import contactbench, kamino, plain, rigid_bodies
from .plain import Arrays


@dataclass(frozen=True)
class ArrayFormat:
    """One way to write a problem as named arrays, in a .npz or .json file.

    Attributes:
        name: name of the format on the command line.
        about: description of the format in a list.
        arrays: names of the arrays by which its files are recognised, in words.
        recognises: returns whether the arrays have the names of this format.
        problem_of_arrays: returns the problem of the arrays.
    """

    name: str
    about: str
    arrays: str
    recognises: Callable[[Arrays], bool]
    problem_of_arrays: Callable[[Arrays, Repair], ContactProblem]


ARRAY_FORMATS = {
    name: ArrayFormat(name, about, arrays, module.recognises, module.problem_of_arrays)
    for name, about, arrays, module in (
        ("contactbench", "samples of ContactBench", "g and mus", contactbench),
        ("kamino", "dumps of Kamino's dual problem", "D and v_f", kamino),
        ("bodies", "a step of rigid bodies", "mass, inertia and body_1", rigid_bodies),
        ("plain", "plain arrays: G or W and M, c, mu", "c, mu, and G or W", plain),
    )
}
"""Formats by name; the first that recognises a file reads it."""


def read_foreign_arrays(arrays: Arrays, name: str, repair: Repair, format_name: str = "") -> ContactProblem | None:
    """Return the problem of arrays that ``save_problem`` did not write; None if no format recognises them.

    Args:
        arrays: arrays of the file by name.
        name: name of the file in messages.
        repair: how an asymmetric or indefinite matrix is read.
        format_name: the format, inferred from the names of the arrays if empty.

    Raises:
        ProblemError: if an array is missing or does not match the others, or there are no contacts.
    """
    inferred = next((candidate for candidate in ARRAY_FORMATS.values() if candidate.recognises(arrays)), None)
    chosen = ARRAY_FORMATS[format_name] if format_name else inferred
    if chosen is None:
        return None
    if chosen.recognises(arrays):
        try:
            with named_in_errors(name, chosen.name, repair):
                problem = chosen.problem_of_arrays(arrays, repair)
                if not problem.n_rows:
                    raise ProblemError("there are no contacts, so there is nothing to solve; leave this file out.")
                return problem
        except ProblemError:
            if chosen is inferred:
                raise
    names = ", ".join(sorted(arrays)) or "none"
    raise ProblemError(
        f"{name} is not a file of the format {chosen.name!r}, which has {chosen.arrays}; its arrays are {names}"
        + (f", as in the format {inferred.name!r}." if inferred else ".")
    )
