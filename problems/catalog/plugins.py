"""What plugins offer: solvers, problems and scenes of installed packages, and of files named by the user.

A package offers them as entry points of the groups ``proxbench.solvers``, ``proxbench.problems`` and
``proxbench.scenes``. Nothing of a plugin runs before it is named. A name that is not free is refused, and so is one
that two plugins share: which of them a table shows must not depend on the order of installation.
"""

import re
import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from typing import Any, Literal

from ..errors import PluginError, first_line
from .plugin_files import PluginFile, make_importable

Kind = Literal["solver", "problem", "scene"]

KINDS: tuple[Kind, ...] = ("solver", "problem", "scene")

_GROUPS: dict[Kind, str] = {kind: f"proxbench.{kind}s" for kind in KINDS}

_NAMES: dict[Kind, tuple[str, str]] = {
    "solver": (r"[A-Za-z_][A-Za-z0-9_]*", "a Python name, as that of a class"),
    "scene": (r"[A-Za-z_][A-Za-z0-9_]*", "a Python name, as that of a function"),
    "problem": (r"[A-Za-z0-9][A-Za-z0-9._-]*", "made of letters, digits, '.', '_' and '-'"),
}

_files: dict[str, PluginFile] = {}
"""Registered plugin files by path, for this process."""

Names = Mapping[Kind, Sequence[str]]
"""What a plugin file offers, by kind."""

_names: dict[str, Names] = {}
"""What registered files offer, by path, where it is known without running them."""

_elsewhere: set[str] = set()
"""Paths of the files that this process never runs."""


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
    counts = Counter(offer.name for offer in found)
    return [_judged(offer, taken, found) if _suspect(offer, taken, counts) else offer for offer in found]


def register(file: PluginFile, names: Names | None = None, runs_here: bool = True) -> None:
    """Let this process find what a plugin file offers, without running it yet; one of the same path is replaced.

    Args:
        file: the file.
        names: what it offers; found by running it, when first needed, if None.
        runs_here: whether this process may run it. If not, its names are known, and nothing can be made of them.
    """
    path = str(file.path)
    if _files.get(path) != file:
        make_importable(file)
        _files[path] = file
        _names.pop(path, None)
    if names is not None:
        _names[path] = names
    (_elsewhere.discard if runs_here else _elsewhere.add)(path)


def forget(file: PluginFile) -> None:
    """Take a plugin file back."""
    path = str(file.path)
    _files.pop(path, None)
    _names.pop(path, None)
    _elsewhere.discard(path)


def registered() -> list[tuple[PluginFile, Names | None]]:
    """Return the plugin files that this process knows, each with what it offers, None where that is not known."""
    return [(file, _names.get(path)) for path, file in _files.items()]


def _from_files(kind: Kind) -> Iterator[Offer]:
    for path, file in _files.items():
        names = _names.get(path)
        for name in _offered(file, kind) if names is None else names.get(kind, ()):
            yield Offer(kind, name, file.source, partial(_get, file, kind, name), file)


def _get(file: PluginFile, kind: Kind, name: str) -> Any:
    if str(file.path) in _elsewhere:
        raise PluginError(f"{name!r} of {file.source} is made in processes of its own, not in this one.")
    return _offered(file, kind)[name]


def _offered(file: PluginFile, kind: Kind) -> dict[str, Callable[..., Any]]:
    return {"solver": file.solvers, "problem": file.problems, "scene": file.scenes}[kind]()


def _from_packages(kind: Kind) -> Iterator[Offer]:
    for point in metadata.entry_points(group=_GROUPS[kind]):
        package = f"package {point.dist.name} {point.dist.version}" if point.dist else "a package"
        yield Offer(kind, point.name, package, point.load)


def _suspect(offer: Offer, taken: Collection[str], counts: Counter[str]) -> bool:
    return offer.name in taken or counts[offer.name] > 1 or not re.fullmatch(_NAMES[offer.kind][0], offer.name)


def _judged(offer: Offer, taken: Collection[str], found: list[Offer]) -> Offer:
    """Return an offer with the reason for its refusal."""
    said = f"{offer.source} offers the {offer.kind} {offer.name!r}"
    if offer.name in taken:
        reason = f"{said}, a name that Proxbench itself uses; give it another name."
    elif others := [other.source for other in found if other.name == offer.name and other is not offer]:
        reason = f"{said}, and {others[0]} offers the same name; rename or remove one of them."
    else:
        reason = f"{said}, but a {offer.kind}'s name must be {_NAMES[offer.kind][1]}."
    return Offer(offer.kind, offer.name, offer.source, offer.get, offer.file, reason)
