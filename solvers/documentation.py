"""What the docstring of a built-in solver says: its summary, and the meaning of its options."""

import inspect
import re
from typing import NamedTuple

from . import registry


class Documentation(NamedTuple):
    """The first paragraph of a docstring, and the meaning of each documented option, without line breaks."""

    summary: str
    options: dict[str, str]


def documentation_of(name: str) -> Documentation:
    """Return what the docstring of a built-in solver says.

    Args:
        name: the solver, without options.

    Raises:
        SolverError: if there is no such solver.
    """
    text = (inspect.getdoc(registry.factory(name)) or "").replace("``", "")
    _, _, attributes = text.partition("\nAttributes:\n")
    section = re.split(r"\n(?=\S)", attributes)[0]
    entries = re.findall(r"^ {4}(\w+): (.*(?:\n {5,}.*)*)", section, re.MULTILINE)
    return Documentation(_one_line(text.partition("\n\n")[0]), {key: _one_line(meaning) for key, meaning in entries})


def _one_line(text: str) -> str:
    return " ".join(text.split())
