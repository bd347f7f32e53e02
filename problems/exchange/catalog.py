"""Problems and suites by name.

A name is looked up first among the hard cases, which are built on demand. The frozen library that is shipped with the
package follows, then the problems of plugins, then the user's cache folder, where ``proxbench generate`` stores
problems.
"""

import os
import re
import sys
from contextlib import redirect_stdout
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from shlex import quote

from .. import library
from ..compilation.interpretation import interprets_kernels
from ..contact.problem import UNNAMED, ContactProblem
from ..errors import LIST_PROBLEMS_COMMAND, PluginError, ProblemError, first_line, raised_at, suggestion
from ..hard import HARD_CASES, hard_case
from .fclib.files import is_fclib_name, read_fclib
from .files.problem_file import SUFFIX, SUFFIXES, read_problem
from .plugins.offers import Offer, offers

FUNNEL_SIZES = (30, 100, 300, 1000)
"""Numbers of balls in the problems of the suite ``funnel``."""

PILE_SIZES = (100, 300, 1000)
"""Numbers of balls in the piles of the suite ``funnel``."""

MIXED_PILES = tuple(f"pile-400-mixed-{number}" for number in range(1, 11))
"""Names of the piles whose friction coefficients differ from contact to contact."""

WOODPECKER_SWITCHES = (
    "lower-release",
    "upper-impact",
    "beak-impact",
    "upper-second-impact",
    "upper-release",
    "lower-impact",
    "lower-second-impact",
    "lower-slip-to-stick",
    "lower-stick-to-slip",
)
"""Switching points, after which the problems of the suite ``woodpecker`` are named."""

ARCH_STONES = (7, 9, 13, 27, 51)
"""Numbers of stones in the arches of the suite ``bodies``."""

BODY_GROUPS: dict[str, list[str]] = {
    "box stacks": [
        "stack-10",
        *(f"stack-10-{heavy}-{ratio}" for heavy in ("bottom", "top") for ratio in ("1e2", "1e4", "1e6")),
        "stack-100",
    ],
    "arches": [*(f"arch-{n}-{state}" for n in ARCH_STONES for state in ("thick", "thin")), "arch-13-sliding"],
    "card houses": ["cards-1", "cards-3", "cards-3-slipping", "cards-6"],
    "box piles": ["pile-100-falling", "pile-100", "pile-300", "pile-1000"],
    "tables": ["table-2", "table-4", "table-4-1e4", "table-10", "table-25"],
    "single bodies": [
        *(f"box-{state}" for state in ("sticking", "sliding", "thrown", "tipping")),
        *("sphere-rolling", "cylinder-rolling", "top-on-tip"),
    ],
    "linkages": ["pendulum", "four-bar", "chain-20", "chain-200", "ball-on-chain-1e4"],
    "trains": ["train-10", "train-10-1e4", "train-300"],
    "brick walls": ["wall", "wall-struck"],
    "drums": ["drum-24", "drum-48"],
}
"""The problems of the suite ``bodies`` by group, without the prefix ``bodies-``.

The group names differ from those of hard cases."""

SEQUENCES = (
    "flow-30",
    "flow-300",
    "flow-1000",
    "pile-100",
    "pile-300",
    "hopper-100",
    "dominoes-20",
    "stack-10",
    "arch-13",
    "chain-20",
)
"""Sequences, each of consecutive steps of one motion, without the prefix ``sequence-``."""

SEQUENCES_SUITE = "sequences"
"""The suite of the sequences; each solver is measured on it with cold and with warm starts."""

SEQUENCE_STEPS = 6
"""Number of steps per sequence; all but the first can start from the solution of the previous step."""

_FUNNEL = [
    *(f"funnel-{size}{instant}" for size in FUNNEL_SIZES for instant in ("-early", "", "-late")),
    *(f"funnel-planar-{size}" for size in FUNNEL_SIZES),
    *(f"funnel-frictionless-{size}" for size in FUNNEL_SIZES),
    *(f"pile-{size}" for size in PILE_SIZES),
    "pile-100-rolling",
]

_PILES = [*(name for name in _FUNNEL if name.startswith("pile-")), *MIXED_PILES]

_BODIES = [f"bodies-{name}" for members in BODY_GROUPS.values() for name in members]

SEQUENCE_MEMBERS = {name: [f"sequence-{name}-{step}" for step in range(SEQUENCE_STEPS)] for name in SEQUENCES}
"""The problems of each sequence, in order."""

_SEQUENCES = [step for steps in SEQUENCE_MEMBERS.values() for step in steps]

_WOODPECKER = [f"woodpecker-{switch}" for switch in WOODPECKER_SWITCHES]

SUITES: dict[str, list[str]] = {
    "quick": [
        "hard-counterexample",
        "hard-sticking-box",
        "woodpecker-beak-impact",
        "woodpecker-lower-slip-to-stick",
        "funnel-planar-30",
        "funnel-frictionless-300",
        "funnel-100",
        "funnel-1000",
    ],
    "funnel": _FUNNEL,
    "piles": _PILES,
    "woodpecker": _WOODPECKER,
    "bodies": _BODIES,
    SEQUENCES_SUITE: _SEQUENCES,
    "hard": list(HARD_CASES),
    "all": [*HARD_CASES, *_WOODPECKER, *_FUNNEL, *MIXED_PILES, *_BODIES, *_SEQUENCES],
}
"""Members of each suite, in the order in which they are run."""


def cache_folder() -> Path:
    """Return the folder of generated problems: $PROXBENCH_CACHE, else proxbench in the user's cache folder."""
    override = os.environ.get("PROXBENCH_CACHE")
    if override:
        return Path(override)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "proxbench"


def suite_names() -> list[str]:
    """Return the names of all suites."""
    return list(SUITES)


def suite_members(name: str) -> list[str]:
    """Return the names of the problems of a suite.

    Raises:
        ProblemError: if the suite is unknown; the message suggests the nearest name.
    """
    if not isinstance(name, str) or name not in SUITES:
        raise ProblemError(f"there is no suite {name!r:.60}{suggestion(str(name), SUITES)}")
    return list(SUITES[name])


def problem_names() -> list[str]:
    """Return the names of the standard problems, of plugin problems, and of problems in the cache folder."""
    cached = {path.name.removesuffix(SUFFIX) for path in cache_folder().glob(f"*{SUFFIX}")}
    known = [*SUITES["all"], *(offer.name for offer in plugin_problems() if not offer.rejection)]
    return [*known, *sorted(cached.difference(known))]


def plugin_problems() -> list[Offer]:
    """Return the problems that plugins offer, including rejected ones with the reason."""
    return offers("problem", SUITES["all"])


def is_shipped(name: str) -> bool:
    """Return whether the problem is part of the package, as a hard case or in the frozen library."""
    return name in HARD_CASES or _frozen_file(name) is not None


def is_available(name: str) -> bool:
    """Return whether ``load`` finds the problem without generating it."""
    return (
        is_shipped(name)
        or _cached_file(name).is_file()
        or (name not in SUITES["all"] and _plugin_offer(name) is not None)
    )


def is_path(name: str | Path) -> bool:
    """Return whether ``load`` treats ``name`` as a path: a ``Path``, or text that ends in .npz, .json, .hdf5 or .h5."""
    return isinstance(name, Path) or name.endswith(SUFFIXES) or is_fclib_name(name)


@interprets_kernels
def load(name: str | Path) -> ContactProblem:
    """Return one problem by name or from a file.

    The file may come from ``save_problem`` or ``proxbench generate``, be an FCLIB file, or contain plain arrays, as
    from ``numpy.savez("mine.npz", G=G, c=c, mu=mu)``; see ``problems.exchange.formats``. A problem that was saved
    without a name takes that of its file.

    Args:
        name: a name, or the path of a file: a ``Path``, or text that ends in .npz or .json, or in .hdf5 or .h5 for
            FCLIB.

    Raises:
        ProblemError: if ``name`` is neither text nor a path, no problem has this name (the message suggests the
            nearest one), the problem has not been generated yet, or the file is missing or damaged.
        PluginError: if a plugin offers the name but does not return a problem.
    """
    argument: object = name
    if not isinstance(argument, str | Path):
        raise ProblemError(
            f"load takes the name of a problem or the path of a file, not {type(name).__name__}; for a matrix G, call "
            "ContactProblem.from_delassus(G, c, mu)."
        )
    if is_path(name):
        return read_fclib(name) if is_fclib_name(str(name)) else _named(read_problem(Path(name)), Path(name))
    assert isinstance(name, str)
    if name in HARD_CASES:
        return hard_case(name)
    frozen = _frozen_file(name)
    if frozen is not None:
        with frozen.open("rb") as file:
            return read_problem(file, label=f"frozen problem {name!r}")
    offer = None if name in SUITES["all"] else _plugin_offer(name)
    if offer is not None:
        return _plugin_problem(offer)
    if _cached_file(name).is_file():
        return read_problem(_cached_file(name))
    if name in SUITES["all"]:
        raise ProblemError(f"problem {name!r} has not been generated yet; run: proxbench generate {quote(name)}")
    if os.path.exists(name) or "/" in name:
        raise ProblemError(_path_error(name))
    raise ProblemError(f"there is no problem {name!r}{suggestion(name, problem_names(), LIST_PROBLEMS_COMMAND)}")


def _path_error(path: str) -> str:
    """Return why a path is not that of a problem file, and the remedy."""
    if not os.path.exists(path):
        return f"there is no problem or file {path!r}; name a problem, or a file that exists."
    if os.path.isdir(path):
        return f"{path} is a folder, not a problem file; name a file in it."
    return (
        f"{path} is not a problem file, whose name ends in {', '.join(SUFFIXES)}, .hdf5 or .h5; write one with "
        "numpy.savez('mine.npz', G=G, c=c, mu=mu)."
    )


def _named(problem: ContactProblem, file: Path) -> ContactProblem:
    """Return the problem, named after its file if it was saved without a name."""
    return problem.renamed(file.stem) if problem.name == UNNAMED else problem


def suite(name: str) -> list[ContactProblem]:
    """Return the problems of a suite, in order.

    Raises:
        ProblemError: if the suite is unknown, or a member has not been generated yet.
    """
    return [load(member) for member in suite_members(name)]


def _plugin_offer(name: str) -> Offer | None:
    return next((offer for offer in plugin_problems() if offer.name == name), None)


def _plugin_problem(offer: Offer) -> ContactProblem:
    """Return the problem of a plugin, under the name of the offer."""
    head = f"problem {offer.name!r} of {offer.source}"
    make = offer.load()
    if not callable(make):
        raise PluginError(f"{head} is of type {type(make).__name__}; offer a function that returns a ContactProblem.")
    try:
        with redirect_stdout(sys.stderr):
            problem = make()
    except (Exception, SystemExit) as error:
        raise PluginError(f"{head} cannot be built: {first_line(error)}{raised_at(error)}.") from None
    if not isinstance(problem, ContactProblem):
        raise PluginError(f"{head} returns a value of type {type(problem).__name__}; return a ContactProblem.")
    return problem.renamed(offer.name, plugin=offer.source)


def _is_plain(name: str) -> bool:
    """Return whether a name starts with a letter or digit, followed by letters, digits, dots, underscores or dashes."""
    return re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name) is not None


def _cached_file(name: str) -> Path:
    """Return the path of a generated problem; for a name that is not plain, this file does not exist."""
    return cache_folder() / f"{name if _is_plain(name) else '-'}{SUFFIX}"


def _frozen_file(name: str) -> Traversable | None:
    """Return the library file of a problem; None if there is none."""
    if not _is_plain(name):
        return None
    file = resources.files(library).joinpath(f"{name}{SUFFIX}")
    return file if file.is_file() else None
