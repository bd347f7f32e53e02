"""Listings of solvers, suites, problems and scenes, as values and as text."""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.errors import ProxbenchError, suggestion
from ...problems.exchange.catalog import SUITES, is_available, load, plugin_problems, problem_names, suite_members
from ...problems.exchange.families import family_of
from ...problems.exchange.index import ProblemSummary, stored_summaries, summary_of
from ...problems.exchange.plugins.offers import Offer
from ...solvers.peers.installed import check_installed
from ...solvers.registry import available, composites, create, natives, on_devices, parts, peers, plugin_solvers
from ..errors import BenchError
from ..plugins.documentation import documentation_of, option_texts
from ..report.layout.text import counted, output_width

if TYPE_CHECKING:
    from ...problems.motion.scenes.scene import SceneKind

KINDS = ("solvers", "suites", "scenes", "problems")
"""Kinds of entries that can be listed."""

MAX_SHOWN_MEMBERS = 4
"""Largest number of members of a suite that a summary names."""

Row = dict[str, Any]
"""The fields of an entry of a listing by name."""

MAX_NAME_WIDTH = 34
"""Largest width of the column of problem names; longer names shift their row."""

NOT_GENERATED = "not generated yet"
"""Entry of a problem whose numbers are neither in the package nor in the cache folder."""


def listing_rows(kind: str = "", suite: str = "", name: str = "", has_sizes: bool = True) -> dict[str, list[Row]]:
    """Return a row for each solver, suite, problem and scene, or for those of one kind.

    The row of an unusable entry contains the reason as "error".

    Args:
        kind: one of ``KINDS``; all kinds if empty.
        suite: suite whose problems to list; all problems if empty.
        name: name, with or without options, of the only solver, suite, problem or scene to list; all if empty.
        has_sizes: add the sizes and laws of problems; this loads generated problems and those of plugins.

    Raises:
        BenchError: for an unknown kind or name (the message suggests the nearest one), or a suite with a kind other
            than problems.
        ProblemError: for an unknown suite.
    """
    if kind and kind not in KINDS:
        raise BenchError(f"there is no kind {kind!r} to list{suggestion(kind, KINDS)}")
    if name:
        entries, bare_name = listing_rows(kind, suite, has_sizes=has_sizes), name.partition("(")[0].strip()
        matches = {key: [row for row in rows if row["name"] == bare_name] for key, rows in entries.items()}
        if not any(matches.values()):
            known = [row["name"] for rows in entries.values() for row in rows]
            kinds, command = kind or f"{', '.join(KINDS[:-1])} and {KINDS[-1]}", f"proxbench list {kind}".strip()
            raise BenchError(f"there is no {name!r} among the {kinds}{suggestion(name, known, command)}")
        return {key: rows for key, rows in matches.items() if rows}
    if suite:
        if kind != "problems":
            raise BenchError(f"--suite applies to problems only; use: proxbench list problems --suite {suite}")
        return {"problems": [_standard_problem(name) for name in suite_members(suite)]}
    rows_of_kind: dict[str, Callable[[], list[Row]]] = {
        "solvers": _solvers,
        "suites": _suites,
        "problems": partial(_problems, has_sizes),
        "scenes": _scenes,
    }
    return {key: rows_of_kind[key]() for key in KINDS if kind in ("", key)}


def print_listing(names: dict[str, list[Row]], with_options: bool = False) -> None:
    """Print a listing, wrapped to the width of the terminal; problems are counted unless they are the only kind.

    Args:
        names: as ``listing_rows`` returns it.
        with_options: print what a single built-in solver does, and each option of a built-in solver or scene with its
            meaning.
    """
    for kind, rows in names.items():
        print(kind)
        if kind == "problems" and len(names) == 1:
            _print_problems(rows)
        elif kind == "problems":
            families = _families(rows)
            _print_rows([(family, counted(len(members), "problem")) for family, members in families.items()])
        else:
            text = {"solvers": _solver_text, "suites": _suite_text, "scenes": _scene_text}[kind]
            internal = parts() if kind == "solvers" else []
            _print_rows([(row["name"], text(row)) for row in rows if row["name"] not in internal])
            if parts_of_robust := [(row["name"], text(row)) for row in rows if row["name"] in internal]:
                print("\nparts of Robust")
                _print_rows(parts_of_robust)
            if with_options:
                _print_details(kind, rows[0])
        print()
    if "suites" in names or len(names) > 1:
        print("members of a suite: proxbench list problems --suite NAME")


def _print_details(kind: str, row: Row) -> None:
    """Print the options of a built-in scene, or the summary and options of a solver that needs no parts or extras."""
    name, options = row["name"], list[tuple[str, str]]()
    if kind == "scenes" and not row["source"]:
        options = _option_rows(name)
    if kind == "solvers" and name in available() and not row["source"]:
        summary, meanings = documentation_of(name)
        defaults = dict(text.split("=", 1) for text in row["options"])
        options = [(f"{key}={defaults[key]}", meaning) for key, meaning in meanings.items() if key in defaults]
        print(f"\n{textwrap.fill(summary, output_width(), break_on_hyphens=False)}")
    if options:
        print("\noptions")
        _print_rows(options)


def _print_rows(rows: Sequence[tuple[str, str]]) -> None:
    """Print names and texts in two aligned columns."""
    columns = output_width()
    width = max((len(name) for name, _ in rows), default=0)
    lines = textwrap.TextWrapper(columns, break_on_hyphens=False, break_long_words=False)
    lines.subsequent_indent = " " * (width + 4)
    for name, text in rows:
        lines.initial_indent = f"  {name:<{width}}  "
        print(lines.fill(text))


def _print_problems(rows: Sequence[Row]) -> None:
    """Print a table of problems, grouped by family."""
    heads = {"contacts": 8, "rows": 5, "friction": 15}
    width = min(max((len(row["name"]) for row in rows), default=0), MAX_NAME_WIDTH)
    print(f"  {'':<{width}}  " + "  ".join(f"{head:>{size}}" for head, size in heads.items()) + "  form")
    for family, members in _families(rows).items():
        print(f"\n{family} ({len(members)})")
        for row in members:
            print(f"  {row['name']:<{width}}  {_problem_text(row, list(heads.values()))}".rstrip())
    if not all(row.get("available", True) for row in rows):
        print("\nrun and matrix generate missing problems; or: proxbench generate NAME")


def _families(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows by family: the plugin, the group of hard cases, or the scene that a problem comes from."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row["source"] or family_of(row["name"]), []).append(row)
    return families


def _solver_text(row: Row) -> str:
    origin = [f"from {row['source']}"] if row["source"] else []
    return row["error"] or ", ".join((f"{row['model']} model", *row["options"], *origin))


def _suite_text(row: Row) -> str:
    """Return the number of members of a suite, and the names of a few evenly spaced ones."""
    members = row["members"]
    shown_members = members[:: -(-len(members) // MAX_SHOWN_MEMBERS)]
    more = ", …" if len(shown_members) < len(members) else ""
    return f"{counted(len(members), 'problem')}: {', '.join(shown_members)}{more}"


def _problem_text(row: Row, widths: Sequence[int]) -> str:
    """Return contacts, rows and kinds of friction in columns of these widths [characters], then the form of G."""
    if row["error"]:
        return str(row["error"])
    if not row["available"]:
        return NOT_GENERATED
    frictions = [law for law in row["laws"] if law not in ("unilateral", "bilateral")]
    kinds = dict.fromkeys("rolling" if "rolling" in law else law.removesuffix(" friction") for law in frictions)
    cells = row["contacts"], row["rows"], ", ".join(kinds) or "none"
    return "  ".join([*(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True)), row["form"]])


def _scene_text(row: Row) -> str:
    return row["error"] or f"{row['summary']}: {', '.join(row['options'])}"


def _option_rows(scene: str) -> list[tuple[str, str]]:
    """Return each option of a built-in scene with its default, and its meaning."""
    from ...problems.motion.scenes.registry import SCENES

    return [
        (f"{key}={option.default!r}", option.meaning + ("; None: off" if option.can_be_off else ""))
        for key, option in SCENES[scene].options.items()
    ]


def _solvers() -> list[Row]:
    offers = plugin_solvers()
    plugin_names = {offer.name for offer in offers if not offer.rejection}
    builtin = [name for name in available() if name not in plugin_names] + peers()
    rows = [_row(name, "", partial(_solver, name)) for name in builtin]
    rows += [_row(name, "", partial(_on_device, name)) for name in on_devices()]
    rows += [_row(name, "", partial(_composite, name, example)) for name, example in composites().items()]
    rows += [_row(name, "", partial(_native, example)) for name, example in natives().items()]
    return rows + [_plugin_row(offer, _plugin_solver) for offer in offers]


def _solver(name: str) -> Row:
    return {"model": str(create(name).model), "options": option_texts(name)}


def _on_device(name: str) -> Row:
    """Return the row of a solver on a device. The device need not exist, but the library must be installed."""
    check_installed(name, "warp", "gpu")
    return {"model": str(Model.COULOMB), "options": option_texts(name)}


def _composite(name: str, example: str) -> Row:
    return {"model": "its parts'", "options": [f"as in {example}", *option_texts(name)]}


def _native(example: str) -> Row:
    return {"model": "its own", "options": [f"as in {example}", "options=''"]}


def _plugin_solver(offer: Offer) -> Row:
    from ..plugins.descriptions import describe_solver  # only plugins need child processes

    solver = describe_solver(offer.name)
    return {key: solver[key] for key in ("name", "model", "source", "options")}


def _suites() -> list[Row]:
    return [{"name": name, "members": suite_members(name)} for name in SUITES]


def _scenes() -> list[Row]:
    from ...problems.exchange.plugins.scenes import plugin_scenes  # other kinds need no module of a scene
    from ...problems.motion.scenes.registry import SCENES

    rows = [_row(name, "", partial(_scene, kind)) for name, kind in SCENES.items()]
    return rows + [_plugin_row(offer, _plugin_scene) for offer in plugin_scenes()]


def _scene(kind: "SceneKind") -> Row:
    options = [f"{key}={option.default!r}" for key, option in kind.options.items()]
    return {"summary": kind.summary, "options": options}


def _plugin_scene(offer: Offer) -> Row:
    from ..plugins.descriptions import describe_scene

    return {"summary": f"from {offer.source}", "options": describe_scene(offer.name)}


def _problems(has_sizes: bool) -> list[Row]:
    offers = plugin_problems()
    plugin_names = {offer.name for offer in offers if not offer.rejection}
    names = [name for name in problem_names() if name not in plugin_names]
    if not has_sizes:
        rows = [{"name": name, "source": "", "error": ""} for name in names]
        return rows + [{"name": offer.name, "source": offer.source, "error": offer.rejection} for offer in offers]
    return [_standard_problem(name) for name in names] + [_plugin_row(offer, _plugin_problem) for offer in offers]


def _plugin_problem(offer: Offer) -> Row:
    from ..plugins.descriptions import plugin_problem

    return _problem(plugin_problem(offer.name))


def _standard_problem(name: str) -> Row:
    """Return the row of a standard problem, or of one in the cache folder."""
    stored = stored_summaries().get(name)
    if stored is not None:
        return _row(name, "", lambda: _sizes(stored))
    return _row(name, "", lambda: _problem(load(name)) if is_available(name) else {"available": False})


def _problem(problem: ContactProblem) -> Row:
    return {"name": problem.name, **_sizes(summary_of(problem))}


def _sizes(summary: ProblemSummary) -> Row:
    return {"available": True, **asdict(summary), "laws": list(summary.laws)}


def _plugin_row(offer: Offer, describe: Callable[[Offer], Row]) -> Row:
    """Return the row of a solver, problem or scene of a plugin."""
    if offer.rejection:
        return {"name": offer.name, "source": offer.source, "error": offer.rejection}
    return _row(offer.name, offer.source, lambda: describe(offer))


def _row(name: str, source: str, describe: Callable[[], Row]) -> Row:
    """Return the row of an entry: name, plugin and further fields; "error" is the reason if it cannot be used."""
    try:
        return {"name": name, "source": source, "error": "", **describe()}
    except ProxbenchError as error:
        return {"name": name, "source": source, "error": str(error)}
