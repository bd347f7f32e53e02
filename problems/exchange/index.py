"""Sizes and laws of the shipped problems, stored with the frozen library, so that listing does not build problems.

``python -m proxbench.problems.exchange.index`` rewrites ``index.json``; run it after adding or changing a problem.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from pathlib import Path

from .. import library
from ..contact.problem import ContactProblem
from .catalog import SUITES, is_shipped, load

INDEX = "index.json"
"""Name of the file in the folder of the library."""


@dataclass(frozen=True)
class ProblemSummary:
    """The entry of a problem in a table of problems.

    Attributes:
        contacts: number of contacts.
        rows: number of rows.
        laws: the kinds of law that occur, in words.
        form: "factors" or "Delassus", the form in which the problem is stored.
    """

    contacts: int
    rows: int
    laws: tuple[str, ...]
    form: str


def summary_of(problem: ContactProblem) -> ProblemSummary:
    """Return the summary of one problem."""
    form = "factors" if problem.factors is not None else "Delassus"
    return ProblemSummary(problem.n_contacts, problem.n_rows, tuple(problem.laws.counts()), form)


@cache
def stored_summaries() -> Mapping[str, ProblemSummary]:
    """Return the summaries of the hard cases and of the frozen library, by name, as they are stored."""
    stored = json.loads(resources.files(library).joinpath(INDEX).read_text(encoding="utf-8"))
    return {name: ProblemSummary(**{**entry, "laws": tuple(entry["laws"])}) for name, entry in stored.items()}


def current_summaries() -> dict[str, ProblemSummary]:
    """Build the hard cases and the problems of the frozen library, and return their summaries."""
    return {name: summary_of(load(name)) for name in SUITES["all"] if is_shipped(name)}


if __name__ == "__main__":
    lines = [f"{json.dumps(name)}: {json.dumps(asdict(entry))}" for name, entry in current_summaries().items()]
    with resources.as_file(resources.files(library)) as folder:
        (Path(folder) / INDEX).write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
