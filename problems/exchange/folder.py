"""Folders of problem files as suites, with names, order and families from ``suite.toml`` or the file names.

A ``suite.toml`` may have::

    name = "boxes"                          # default: the name of the folder
    order = ["easy-*", "Boxes/*"]           # by the first pattern that matches, then by name
    exclude = ["*-huge*"]
    [groups]                                # families; default: subfolder, or name up to its first dash
    "box stacks" = ["Boxes/*", "Box_Stacks-*"]

Patterns are shell patterns for paths relative to the folder, with ``/`` between folders. A pattern without a match is
an error. Listing a folder opens no file but ``suite.toml``.
"""

import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import chain
from pathlib import Path
from typing import Any

from ..errors import ProblemError, suggestion
from .catalog import is_path
from .families import family_of

DESCRIPTION = "suite.toml"
"""The file that describes the suite of a folder."""

MAX_DESCRIPTION_BYTES = 1_000_000
"""Largest size of ``suite.toml`` [bytes]."""

KEYS = ("name", "order", "exclude", "groups")
"""Keys that ``suite.toml`` may have."""


@dataclass(frozen=True)
class Member:
    """One problem of a folder.

    Attributes:
        name: stem of the file name, preceded by its folders if several files share it.
        path: the file, as ``load`` accepts it.
        family: family of the problem.
    """

    name: str
    path: Path
    family: str


@dataclass(frozen=True)
class FolderSuite:
    """The problems of a folder.

    Attributes:
        name: name of the suite.
        members: the problems, in order.
        broken: files that cannot be members, each with a sentence that gives the reason.
    """

    name: str
    members: tuple[Member, ...]
    broken: tuple[tuple[Path, str], ...] = ()


@dataclass(frozen=True)
class _Description:
    """The entries of ``suite.toml``; ``groups`` is None without the file."""

    name: str
    order: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    groups: Mapping[str, tuple[str, ...]] | None = None


def list_folder(folder: Path | str) -> FolderSuite:
    """Return the suite of a folder: all problem files in it and its subfolders, except hidden ones.

    Raises:
        ProblemError: if there is no such folder or no problem in it, or ``suite.toml`` is invalid.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ProblemError(f"there is no folder {folder}.")
    description = _read_description(folder)
    files = {
        file.relative_to(folder).as_posix(): file
        for file in sorted(_files_below(folder))
        if is_path(file.name) and file.is_file() and not _is_hidden(file.relative_to(folder))
    }
    groups = description.groups or {}
    for pattern in chain(description.order, description.exclude, *groups.values()):
        if not any(fnmatchcase(relative_path, pattern) for relative_path in files):
            raise ProblemError(f"{folder / DESCRIPTION}: the pattern {pattern!r} matches no problem file; correct it.")
    included = [relative_path for relative_path in files if not _matches(relative_path, description.exclude)]
    if not included:
        raise ProblemError(f"there is no problem in {folder}; problem files end in .npz, .json, .hdf5 or .h5.")
    included.sort(key=lambda relative_path: (_first_match(relative_path, description.order), relative_path))
    names = _names(included)
    members, broken, path_of_name = [], [], dict[str, str]()
    for relative_path in included:
        name = names[relative_path]
        if name in path_of_name:
            reason = f"{files[relative_path]} has the name of {files[path_of_name[name]]}; rename or exclude it."
            broken.append((files[relative_path], reason))
            continue
        path_of_name[name] = relative_path
        members.append(Member(name, files[relative_path], _family(relative_path, groups)))
    return FolderSuite(description.name, tuple(members), tuple(broken))


def _files_below(folder: Path) -> list[Path]:
    """Return the files below a folder, except in folders that vanish or cannot be read."""
    return [Path(subfolder, name) for subfolder, _, names in os.walk(folder) for name in names]


def _read_description(folder: Path) -> _Description:
    file = folder / DESCRIPTION
    if not file.is_file():
        return _Description(folder.resolve().name)
    if file.stat().st_size > MAX_DESCRIPTION_BYTES:
        raise ProblemError(f"{file} has more than {MAX_DESCRIPTION_BYTES} bytes; shorten it.")
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ProblemError(f"{file} is not valid TOML: {' '.join(str(error).split())}.") from None
    except OSError as error:
        raise ProblemError(f"cannot read {file}: {error.strerror}.") from None
    for key in content:
        if key not in KEYS:
            raise ProblemError(f"{file} has an unknown key {key!r}{suggestion(key, KEYS)}")
    name = content.get("name", folder.resolve().name)
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise ProblemError(f"{file}: name must be a string without line breaks.")
    groups = content.get("groups", {})
    if not isinstance(groups, dict):
        raise ProblemError(f"{file}: groups must be a table of patterns by family.")
    return _Description(
        name,
        _patterns(content.get("order", []), file, "order"),
        _patterns(content.get("exclude", []), file, "exclude"),
        {family: _patterns(patterns, file, f"groups.{family}") for family, patterns in groups.items()},
    )


def _patterns(value: Any, file: Path, key: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(pattern, str) for pattern in value):
        raise ProblemError(f"{file}: {key} must be a list of patterns, each a string.")
    return tuple(value)


def _names(paths: Sequence[str]) -> dict[str, str]:
    """Return the stem of each file, preceded by its folders if several files share it."""
    stems = [Path(path).stem for path in paths]
    shared = {stem for stem in stems if stems.count(stem) > 1} if len(set(stems)) < len(stems) else set()
    return {
        path: "-".join((*Path(path).parts[:-1], stem)) if stem in shared else stem
        for path, stem in zip(paths, stems, strict=True)
    }


def _family(relative_path: str, groups: Mapping[str, Sequence[str]]) -> str:
    for family, patterns in groups.items():
        if _matches(relative_path, patterns):
            return family
    path = Path(relative_path)
    return path.parent.as_posix() if len(path.parts) > 1 else family_of(path.stem)


def _matches(relative_path: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(relative_path, pattern) for pattern in patterns)


def _first_match(relative_path: str, patterns: Sequence[str]) -> int:
    """Return the index of the first pattern that matches, or the number of patterns if none does."""
    return next((index for index, pattern in enumerate(patterns) if fnmatchcase(relative_path, pattern)), len(patterns))


def _is_hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)
