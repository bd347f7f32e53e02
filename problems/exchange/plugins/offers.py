"""Discovery of plugins: solvers, problems and scenes of installed packages and of files that the user names.

A package offers them as entry points of the groups ``proxbench.solvers``, ``proxbench.problems`` and
``proxbench.scenes``. The code of a package runs only if one of its names is used. Names of Proxbench are rejected, and
so are names that two plugins share, because results must not depend on the order of installation.
"""

import os
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from importlib import metadata
from typing import Any, cast, get_args

from ...errors import PluginError, first_line, raised_at
from .files import Kind, PluginFile, make_importable

KINDS: tuple[Kind, ...] = get_args(Kind)
"""Kinds of names that plugins offer."""

_NAME_PATTERNS: dict[Kind, tuple[str, str]] = {
    "solver": (r"[A-Za-z_][A-Za-z0-9_]*", "a Python name, like that of a class"),
    "scene": (r"[A-Za-z_][A-Za-z0-9_]*", "a Python name, like that of a function"),
    "problem": (r"[A-Za-z0-9][A-Za-z0-9._-]*", "made of letters, digits, '.', '_' and '-'"),
}
"""Regular expression of valid names of each kind, and its description in messages."""

Names = Mapping[Kind, Sequence[str]]
"""Names that a plugin file offers, by kind."""


@dataclass(frozen=True)
class _Registration:
    """A plugin file, its names if known, and whether this process may run it."""

    file: PluginFile
    names: Names | None
    runs_here: bool


_registered: dict[str, _Registration] = {}
"""Registered plugin files by path, for this process."""


@dataclass(frozen=True)
class Offer:
    """One name that a plugin offers.

    Attributes:
        kind: "solver", "problem" or "scene".
        name: the name.
        source: name of the plugin in messages.
        get: imports the plugin and returns the class or function.
        file: the plugin file, None for a package.
        rejection: a sentence that states why the name cannot be used; empty if it can.
    """

    kind: Kind
    name: str
    source: str
    get: Callable[[], Any]
    file: PluginFile | None = None
    rejection: str = ""

    def load(self) -> Any:
        """Import the plugin and return its object of this name; redirect its output to standard error.

        Raises:
            PluginError: if the name is rejected, or the plugin fails to import.
        """
        if self.rejection:
            raise PluginError(self.rejection)
        try:
            with redirect_stdout(sys.stderr):
                return self.get()
        except PluginError:
            raise
        except (Exception, SystemExit) as error:
            description = (
                f"{self.source} offers the {self.kind} {self.name!r}, which fails to import: {first_line(error)}"
            )
            raise PluginError(f"{description}{raised_at(error)}; fix the package or uninstall it.") from None


def offers(kind: Kind, reserved: Collection[str]) -> list[Offer]:
    """Return all offers of plugins of one kind, including rejected ones with the reason.

    Args:
        kind: "solver", "problem" or "scene".
        reserved: names that Proxbench itself uses.
    """
    all_offers = [*_from_files(kind), *_from_packages(kind)]
    return [replace(offer, rejection=_rejection(offer, reserved, all_offers)) for offer in all_offers]


def register(file: PluginFile, names: Names | None = None, runs_here: bool = True) -> None:
    """Register a plugin file in this process without running it, and replace a registered file of the same path.

    Args:
        file: the file.
        names: the names that it offers; if None, the file runs when they are first needed.
        runs_here: whether this process may run the file; if not, its names are listed but cannot be loaded.
    """
    path = str(file.path)
    previous = _registered.get(path)
    if previous is None or previous.file != file:
        make_importable(file)
    elif names is None:
        names = previous.names
    _registered[path] = _Registration(file, names, runs_here)


def forget(file: PluginFile) -> None:
    """Remove a plugin file from the registered ones."""
    _registered.pop(str(file.path), None)


def registered() -> list[tuple[PluginFile, Names | None]]:
    """Return the registered plugin files, each with its names, or None if they are not known."""
    return [(entry.file, entry.names) for entry in _registered.values()]


def _from_files(kind: Kind) -> Iterator[Offer]:
    for entry in _registered.values():
        for name in entry.file.offered(kind) if entry.names is None else entry.names.get(kind, ()):
            yield Offer(kind, name, entry.file.source, partial(_load_from_file, entry.file, kind, name), entry.file)


def _load_from_file(file: PluginFile, kind: Kind, name: str) -> Any:
    entry = _registered.get(str(file.path))
    if entry is not None and not entry.runs_here:
        raise PluginError(f"{name!r} of {file.source} runs only in separate processes, not in this one.")
    return file.offered(kind)[name]


def _from_packages(kind: Kind) -> Iterator[Offer]:
    folders = tuple((folder, _change_time(folder)) for folder in sys.path)
    for point in _entry_points(folders).select(group=f"proxbench.{kind}s"):
        package = f"package {point.dist.name} {point.dist.version}" if point.dist else "a package"
        yield Offer(kind, point.name, package, point.load)


@lru_cache(maxsize=1)
def _entry_points(folders: tuple[tuple[str, int], ...]) -> metadata.EntryPoints:
    """Return the entry points of all installed packages, which are searched again after a folder has changed."""
    return cast("metadata.EntryPoints", metadata.entry_points())  # a selectable group before Python 3.12


def _change_time(folder: str) -> int:
    """Return the time of the last change of a folder [ns], 0 if it cannot be read."""
    try:
        return os.stat(folder or os.curdir).st_mtime_ns
    except OSError:
        return 0


def _rejection(offer: Offer, reserved: Collection[str], all_offers: list[Offer]) -> str:
    """Return why the name of an offer cannot be used, as a sentence; empty if it can."""
    description = f"{offer.source} offers the {offer.kind} {offer.name!r}"
    if offer.name in reserved:
        return f"{description}, a name that Proxbench itself uses; give it another name."
    if others := [other.source for other in all_offers if other.name == offer.name and other is not offer]:
        return f"{description}, and {others[0]} offers the same name; rename or remove one of them."
    pattern, requirement = _NAME_PATTERNS[offer.kind]
    return (
        "" if re.fullmatch(pattern, offer.name) else f"{description}, but a {offer.kind}'s name must be {requirement}."
    )
