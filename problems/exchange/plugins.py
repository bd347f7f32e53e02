"""What plugins offer: solvers, problems and scenes of installed packages, and of files named by the user.

A package offers them as entry points of the groups ``proxbench.solvers``, ``proxbench.problems`` and
``proxbench.scenes``. Nothing of a plugin runs before it is named. A name that is not free is refused, and so is one
that two plugins share: which of them a table shows must not depend on the order of installation.
"""

import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from functools import partial
from importlib import metadata
from typing import Any, get_args

from ..errors import PluginError, first_line
from .plugin_files import Kind, PluginFile, make_importable

KINDS: tuple[Kind, ...] = get_args(Kind)

_NAMES: dict[Kind, tuple[str, str]] = {
    "solver": (r"[A-Za-z_][A-Za-z0-9_]*", "a Python name, as that of a class"),
    "scene": (r"[A-Za-z_][A-Za-z0-9_]*", "a Python name, as that of a function"),
    "problem": (r"[A-Za-z0-9][A-Za-z0-9._-]*", "made of letters, digits, '.', '_' and '-'"),
}

Names = Mapping[Kind, Sequence[str]]
"""What a plugin file offers, by kind."""


@dataclass(frozen=True)
class _Registered:
    """A plugin file, what it offers as far as that is known without running it, and whether this process may run it."""

    file: PluginFile
    names: Names | None
    runs_here: bool


_registered: dict[str, _Registered] = {}
"""Registered plugin files by path, for this process."""


@dataclass(frozen=True)
class Offer:
    """One name that a plugin offers.

    Attributes:
        kind: what it offers.
        name: the name.
        source: the plugin, as messages call it.
        get: imports the plugin and returns the class or function.
        file: the plugin file, None for a package.
        refusal: why the name cannot be used, a sentence; empty if it can.
    """

    kind: Kind
    name: str
    source: str
    get: Callable[[], Any]
    file: PluginFile | None = None
    refusal: str = ""

    def load(self) -> Any:
        """Import the plugin; return what stands behind the name. What it prints goes to standard error.

        Raises:
            PluginError: if the name is refused, or the plugin fails to import.
        """
        if self.refusal:
            raise PluginError(self.refusal)
        try:
            with redirect_stdout(sys.stderr):
                return self.get()
        except PluginError:
            raise
        except (Exception, SystemExit) as error:
            said = f"{self.source} offers the {self.kind} {self.name!r}, which fails to import: {first_line(error)}"
            raise PluginError(f"{said}; mend the package or uninstall it.") from None


def offers(kind: Kind, taken: Collection[str]) -> list[Offer]:
    """Return all that plugins offer of one kind, the refused with their reason.

    Args:
        kind: solvers, problems or scenes.
        taken: the names of Proxbench itself.
    """
    found = [*_from_files(kind), *_from_packages(kind)]
    return [replace(offer, refusal=_refusal(offer, taken, found)) for offer in found]


def register(file: PluginFile, names: Names | None = None, runs_here: bool = True) -> None:
    """Let this process find what a plugin file offers, without running it yet; one of the same path is replaced.

    Args:
        file: the file.
        names: what it offers; found by running it, when first needed, if None.
        runs_here: whether this process may run it. If not, its names are known, and nothing can be made of them.
    """
    path = str(file.path)
    before = _registered.get(path)
    if before is None or before.file != file:
        make_importable(file)
    elif names is None:
        names = before.names
    _registered[path] = _Registered(file, names, runs_here)


def forget(file: PluginFile) -> None:
    """Take a plugin file back."""
    _registered.pop(str(file.path), None)


def registered() -> list[tuple[PluginFile, Names | None]]:
    """Return the plugin files that this process knows, each with what it offers, None where that is not known."""
    return [(one.file, one.names) for one in _registered.values()]


def _from_files(kind: Kind) -> Iterator[Offer]:
    for one in _registered.values():
        for name in one.file.offered(kind) if one.names is None else one.names.get(kind, ()):
            yield Offer(kind, name, one.file.source, partial(_get, one.file, kind, name), one.file)


def _get(file: PluginFile, kind: Kind, name: str) -> Any:
    known = _registered.get(str(file.path))
    if known is not None and not known.runs_here:
        raise PluginError(f"{name!r} of {file.source} is made in processes of its own, not in this one.")
    return file.offered(kind)[name]


def _from_packages(kind: Kind) -> Iterator[Offer]:
    for point in metadata.entry_points(group=f"proxbench.{kind}s"):
        package = f"package {point.dist.name} {point.dist.version}" if point.dist else "a package"
        yield Offer(kind, point.name, package, point.load)


def _refusal(offer: Offer, taken: Collection[str], found: list[Offer]) -> str:
    said = f"{offer.source} offers the {offer.kind} {offer.name!r}"
    if offer.name in taken:
        return f"{said}, a name that Proxbench itself uses; give it another name."
    if others := [other.source for other in found if other.name == offer.name and other is not offer]:
        return f"{said}, and {others[0]} offers the same name; rename or remove one of them."
    pattern, meaning = _NAMES[offer.kind]
    return "" if re.fullmatch(pattern, offer.name) else f"{said}, but a {offer.kind}'s name must be {meaning}."
