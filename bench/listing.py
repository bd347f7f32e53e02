"""What there is to run, as plain values and as text."""

import inspect
import shutil
import textwrap
from typing import Any

from ..problems.catalog import SUITES, is_available, load, problem_names, suite_members
from ..problems.contact import ContactProblem
from ..problems.errors import suggestion
from ..problems.laws import LawKind
from ..problems.scenes.registry import SCENES
from ..solvers.registry import available, factory
from .errors import BenchError

KINDS = ("solvers", "suites", "problems", "scenes")


def listed(what: str = "") -> dict[str, list[dict[str, Any]]]:
    """Return solvers, suites, problems and scenes, or the one kind asked for.

    Raises:
        BenchError: for another kind, with the nearest one.
    """
    if what and what not in KINDS:
        raise BenchError(f"there is nothing called {what!r} to list{suggestion(what, KINDS)}")
    makers = {"solvers": _solvers, "suites": _suites, "problems": _problems, "scenes": _scenes}
    return {kind: makers[kind]() for kind in KINDS if what in ("", kind)}


def print_listing(names: dict[str, list[dict[str, Any]]]) -> None:
    """Print the listing in aligned columns, wrapped to the width of the terminal."""
    texts = {"solvers": _solver_text, "suites": _suite_text, "problems": _problem_text, "scenes": _scene_text}
    columns = shutil.get_terminal_size((100, 24)).columns
    for kind, rows in names.items():
        print(kind)
        width = max((len(row["name"]) for row in rows), default=0)
        for row in rows:
            start = f"  {row['name']:<{width}}  "
            indent = " " * len(start)
            print(
                textwrap.fill(
                    texts[kind](row), columns, initial_indent=start, subsequent_indent=indent, break_on_hyphens=False
                )
            )
        print()


def _solver_text(row: dict[str, Any]) -> str:
    return ", ".join((f"{row['model']} model", *row["options"]))


def _suite_text(row: dict[str, Any]) -> str:
    return ", ".join(row["members"])


def _problem_text(row: dict[str, Any]) -> str:
    if not row["available"]:
        return "not generated yet"
    contacts = f"{row['contacts']} contact{'' if row['contacts'] == 1 else 's'}"
    return f"{contacts}, {row['rows']} rows, {' and '.join(row['laws'])}, {row['form']}"


def _scene_text(row: dict[str, Any]) -> str:
    return f"{row['summary']}: {', '.join(row['options'])}"


def _solvers() -> list[dict[str, Any]]:
    rows = []
    for name in available():
        made = factory(name)
        options = [f"{option.name}={option.default!r}" for option in inspect.signature(made).parameters.values()]
        rows.append({"name": name, "model": str(made().model), "options": options})
    return rows


def _suites() -> list[dict[str, Any]]:
    return [{"name": name, "members": suite_members(name)} for name in SUITES]


def _scenes() -> list[dict[str, Any]]:
    rows = []
    for name, kind in SCENES.items():
        options = [
            f"{key}={'off' if option.default is None else option.default}" for key, option in kind.options.items()
        ]
        rows.append({"name": name, "summary": kind.summary, "options": options})
    return rows


def _problems() -> list[dict[str, Any]]:
    return [
        _described(load(name)) if is_available(name) else {"name": name, "available": False} for name in problem_names()
    ]


def _described(problem: ContactProblem) -> dict[str, Any]:
    return {
        "name": problem.name,
        "available": True,
        "contacts": problem.n_contacts,
        "rows": problem.n_rows,
        "laws": [LawKind(kind).name.lower().replace("_", " ") for kind in sorted(set(problem.laws.kind.tolist()))],
        "form": "factors" if problem.factors is not None else "Delassus",
    }
