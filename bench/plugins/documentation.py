"""Options of solvers with their defaults, and what the docstrings of built-in solvers say."""

import inspect
import re
from typing import NamedTuple

from ...solvers.registry import factory


def option_texts(name: str) -> list[str]:
    """Return the options of a solver with their defaults, as ``"relaxation=1.0"``; import its plugin if necessary."""
    options = inspect.signature(factory(name)).parameters.values()
    return [f"{option.name}={option.default!r}" for option in options if option.default is not option.empty]


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
    text = (inspect.getdoc(factory(name)) or "").replace("``", "")
    _, _, attributes = text.partition("\nAttributes:\n")
    section = re.split(r"\n(?=\S)", attributes)[0]
    entries = re.findall(r"^ {4}(\w+): (.*(?:\n {5,}.*)*)", section, re.MULTILINE)
    return Documentation(_one_line(text.partition("\n\n")[0]), {key: _one_line(meaning) for key, meaning in entries})


def _one_line(text: str) -> str:
    return " ".join(text.split())
