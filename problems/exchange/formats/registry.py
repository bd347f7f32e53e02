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
        name: its name on the command line.
        about: its description in a list.
        arrays: the names by which its files are recognised, in words.
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
        arrays: by name.
        name: name of the file in messages.
        repair: how an asymmetric or indefinite matrix is read.
        format_name: the format, inferred from the names of the arrays if empty.

    Raises:
        ProblemError: if an array is missing or does not match the others.
    """
    known = [ARRAY_FORMATS[format_name]] if format_name else list(ARRAY_FORMATS.values())
    for one in known:
        if one.recognises(arrays):
            with named_in_errors(name, one.name, repair):
                return one.problem_of_arrays(arrays, repair)
    if format_name:
        held = ", ".join(sorted(arrays)) or "none"
        other = next((one.name for one in ARRAY_FORMATS.values() if one.recognises(arrays)), "")
        raise ProblemError(
            f"{name} is not a file of the format {format_name!r}, which has {known[0].arrays}; its arrays are {held}"
            + (f", as in the format {other!r}." if other else ".")
        )
    return None
