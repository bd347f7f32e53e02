"""What plugins offer: solvers and problems of installed packages, and of files named by the user.

A package offers them as entry points of the groups ``proxbench.solvers`` and ``proxbench.problems``. Nothing of a
plugin runs before it is asked for by name. A name that is not free is refused, and so is one that two plugins share:
which of them a table shows must not depend on the order of installation.
"""

import re
import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib import metadata
from typing import Any, Literal

from ..errors import PluginError
from .plugin_files import PluginFile, make_importable, told

Kind = Literal["solver", "problem"]

_GROUPS: dict[Kind, str] = {"solver": "proxbench.solvers", "problem": "proxbench.problems"}

_NAMES: dict[Kind, tuple[str, str]] = {
    "solver": (r"[A-Za-z_][A-Za-z0-9_]*", "a Python name, as that of a class"),
    "problem": (r"[A-Za-z0-9][A-Za-z0-9._-]*", "made of letters, digits, '.', '_' and '-'"),
}

_files: dict[str, PluginFile] = {}
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
            said = f"{self.source} offers the {self.kind} {self.name!r}, which fails to import: {told(error)}"
            raise PluginError(f"{said}; mend the package or uninstall it.") from None


def offers(kind: Kind, taken: Collection[str]) -> list[Offer]:
    """Return all that plugins offer of one kind, the refused with their reason.

    Args:
        kind: solvers or problems.
        taken: the names of Proxbench itself.
    """
    found = [*_from_files(kind), *_from_packages(kind)]
    counts = Counter(offer.name for offer in found)
    return [_judged(offer, taken, found) if _suspect(offer, taken, counts) else offer for offer in found]


def register(file: PluginFile) -> None:
    """Let this process find what a plugin file offers, without running it yet; one of the same path is replaced."""
    if _files.get(str(file.path)) != file:
        make_importable(file)
        _files[str(file.path)] = file


def forget(file: PluginFile) -> None:
    """Take a plugin file back."""
    _files.pop(str(file.path), None)


def registered() -> list[PluginFile]:
    """Return the plugin files that this process knows."""
    return list(_files.values())


def _from_files(kind: Kind) -> Iterator[Offer]:
    for file in _files.values():
        offered = file.solvers() if kind == "solver" else file.problems()
        for name, value in offered.items():
            yield Offer(kind, name, file.source, lambda value=value: value, file)  # type: ignore[misc]


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
