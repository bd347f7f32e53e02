"""What there is to run, as plain values and as text."""

import inspect
import shutil
import textwrap
from collections.abc import Callable
from typing import Any

from ...problems.catalog.catalog import SUITES, is_available, load, plugin_problems, problem_names, suite_members
from ...problems.catalog.plugins import Offer
from ...problems.contact.laws import LawKind
from ...problems.contact.problem import ContactProblem
from ...problems.errors import PluginError, ProxbenchError, suggestion
from ...problems.scenes.registry import SCENES
from ...solvers.registry import available, create, factory, plugin_solvers
from ..errors import BenchError
from ..measure.describing import described_solver, plugin_problem
from ..report.text import counted

KINDS = ("solvers", "suites", "problems", "scenes")


def listed(what: str = "") -> dict[str, list[dict[str, Any]]]:
    """Return solvers, suites, problems and scenes, or the one kind asked for; a plugin's fault is its "error".

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
    return row["error"] or ", ".join((f"{row['model']} model", *row["options"], *_origin(row)))


def _origin(row: dict[str, Any]) -> list[str]:
    return [f"from {row['source']}"] if row["source"] else []


def _suite_text(row: dict[str, Any]) -> str:
    return ", ".join(row["members"])


def _problem_text(row: dict[str, Any]) -> str:
    if row["error"]:
        return str(row["error"])
    if not row["available"]:
        return "not generated yet"
    sizes = counted(row["contacts"], "contact"), counted(row["rows"], "row")
    laws = " and ".join(row["laws"]) or "no law"
    return ", ".join((*sizes, laws, row["form"], *_origin(row)))


def _scene_text(row: dict[str, Any]) -> str:
    return f"{row['summary']}: {', '.join(row['options'])}"


def _solvers() -> list[dict[str, Any]]:
    offers = plugin_solvers()
    of_plugins = {offer.name for offer in offers if not offer.refusal}
    rows = [_built_in(name) for name in available() if name not in of_plugins]
    return rows + [_offered(offer, _described_solver) for offer in offers]


def _built_in(name: str) -> dict[str, Any]:
    options = [f"{option.name}={option.default!r}" for option in inspect.signature(factory(name)).parameters.values()]
    return {"name": name, "model": str(create(name).model), "options": options, "source": "", "error": ""}


def _described_solver(offer: Offer) -> dict[str, Any]:
    solver = described_solver(offer.name)
    return {key: solver[key] for key in ("name", "model", "options", "source")} | {"error": ""}


def _offered(offer: Offer, described: Callable[[Offer], dict[str, Any]]) -> dict[str, Any]:
    """Return the row of what a plugin offers; one that cannot be used has its reason in it."""
    try:
        if offer.refusal:
            raise PluginError(offer.refusal)
        return described(offer)
    except ProxbenchError as error:
        return {"name": offer.name, "source": offer.source, "error": str(error)}


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
    offers = plugin_problems()
    of_plugins = {offer.name for offer in offers if not offer.refusal}
    rows = [_standing(name) for name in problem_names() if name not in of_plugins]
    return rows + [
        _offered(offer, lambda offer: _described(plugin_problem(offer.name), offer.source)) for offer in offers
    ]


def _standing(name: str) -> dict[str, Any]:
    """Return the row of a standard problem, or of one in the cache folder."""
    if is_available(name):
        return _described(load(name), "")
    return {"name": name, "available": False, "source": "", "error": ""}


def _described(problem: ContactProblem, source: str) -> dict[str, Any]:
    return {
        "name": problem.name,
        "available": True,
        "contacts": problem.n_contacts,
        "rows": problem.n_rows,
        "laws": [LawKind(kind).name.lower().replace("_", " ") for kind in sorted(set(problem.laws.kind.tolist()))],
        "form": "factors" if problem.factors is not None else "Delassus",
        "source": source,
        "error": "",
    }
