"""What there is to run, as plain values and as text."""

import inspect
from typing import Any

from ..problems.catalog import SUITES, is_available, load, problem_names, suite_members
from ..problems.errors import suggestion
from ..solvers.registry import available, factory
from .errors import BenchError

KINDS = ("solvers", "suites", "problems")


def listed(what: str = "") -> dict[str, list[dict[str, Any]]]:
    """Return solvers, suites and problems, or the one kind asked for.

    Raises:
        BenchError: for another kind, with the nearest one.
    """
    if what and what not in KINDS:
        raise BenchError(f"there is nothing called {what!r} to list{suggestion(what, KINDS)}")
    makers = {"solvers": _solvers, "suites": _suites, "problems": _problems}
    return {kind: makers[kind]() for kind in KINDS if what in ("", kind)}


def print_listing(names: dict[str, list[dict[str, Any]]]) -> None:
    """Print the listing in aligned columns."""
    for kind, rows in names.items():
        print(kind)
        width = max((len(str(row["name"])) for row in rows), default=0)
        for row in rows:
            rest = [
                ", ".join(value) if isinstance(value, list) else str(value)
                for key, value in row.items()
                if key != "name"
            ]
            print(f"  {row['name']:<{width}}  {'  '.join(text for text in rest if text)}")
        print()


def _solvers() -> list[dict[str, Any]]:
    rows = []
    for name in available():
        made = factory(name)
        options = [f"{option.name}={option.default!r}" for option in inspect.signature(made).parameters.values()]
        rows.append({"name": name, "model": str(made().model), "options": options})
    return rows


def _suites() -> list[dict[str, Any]]:
    return [{"name": name, "members": suite_members(name)} for name in SUITES]


def _problems() -> list[dict[str, Any]]:
    rows = []
    for name in problem_names():
        if not is_available(name):
            rows.append({"name": name, "size": "not generated yet"})
            continue
        problem = load(name)
        rows.append(
            {
                "name": name,
                "size": f"{problem.n_contacts} contacts, {problem.n_rows} rows",
                "form": "factors" if problem.factors is not None else "Delassus",
            }
        )
    return rows
