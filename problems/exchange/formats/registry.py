"""The formats of arrays, found by the names that a file has."""

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
        name: what the command line calls it.
        about: what it is, for a list.
        recognises: whether the names of the arrays are of this format.
        problem_of_arrays: the problem of the arrays.
    """

    name: str
    about: str
    recognises: Callable[[Arrays], bool]
    problem_of_arrays: Callable[[Arrays, Repair], ContactProblem]


ARRAY_FORMATS = {
    found.name: found
    for found in (
        ArrayFormat("contactbench", "samples of ContactBench", contactbench.recognises, contactbench.problem_of_arrays),
        ArrayFormat("kamino", "dumps of Kamino's dual problem", kamino.recognises, kamino.problem_of_arrays),
        ArrayFormat("bodies", "a step of rigid bodies", rigid_bodies.recognises, rigid_bodies.problem_of_arrays),
        ArrayFormat("plain", "plain arrays: G or W and M, c, mu", plain.recognises, plain.problem_of_arrays),
    )
}
"""Formats by name; the first that recognises a file reads it."""


def read_foreign_arrays(arrays: Arrays, name: str, repair: Repair, format_name: str = "") -> ContactProblem | None:
    """Return the problem of arrays that ``save_problem`` did not write; None if no format recognises them.

    Args:
        arrays: by name.
        name: what messages call the file.
        repair: how a matrix that is not symmetric or not semidefinite is read.
        format_name: the format, found by the names of the arrays if empty.

    Raises:
        ProblemError: if an array is missing or does not fit the others.
    """
    known = [ARRAY_FORMATS[format_name]] if format_name else ARRAY_FORMATS.values()
    for one in known:
        if one.recognises(arrays):
            with named_in_errors(name, one.name):
                return one.problem_of_arrays(arrays, repair)
    if format_name:
        held = ", ".join(sorted(arrays)) or "none"
        raise ProblemError(f"{name} is no file of the format {format_name!r}; its arrays are {held}.")
    return None
