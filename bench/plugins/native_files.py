"""Files of solvers in other languages, identified by the SHA-256 of their content.

The SHA-256 is computed when a command names a file. Only child processes load or start the file. A stored run cannot
make this process use a file: a user who resumes someone else's run must name its files.
"""

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

from msgspec.structs import replace

from ...problems.contact.solver import SolverError
from ...problems.errors import PluginError
from ...solvers import registry
from ..store.records import PluginUse

_MAGIC_NUMBERS = (b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"MZ", b"#!")
"""First bytes of shared libraries and programs on Linux, macOS and Windows, and of scripts."""

_allowed: dict[str, PluginUse] = {}
"""Records of the files that this process may use, with their SHA-256, by path."""


def is_native(path: Path) -> bool:
    """Return whether a file is a shared library or a program, and not a plugin file; False if it cannot be read."""
    try:
        with path.open("rb") as file:
            return path.suffix != ".py" and file.read(4).startswith(_MAGIC_NUMBERS)
    except OSError:
        return False


def allow_native_file(path: Path) -> None:
    """Allow stored runs to use a file with its current content.

    Raises:
        PluginError: if the file cannot be read.
    """
    absolute = path.expanduser().absolute()
    use = PluginUse(kind="solver", name="", source="", file=str(absolute), sha256=_sha256(absolute))
    _allowed[str(absolute)] = use


def use_native_files(name: str, sources: Sequence[str]) -> tuple[PluginUse, ...]:
    """Register the files of a solver and its parts, and return their records.

    Args:
        name: name of the solver.
        sources: the ``source`` of each native part, in the order of the parts; missing ones are empty.

    Raises:
        PluginError: if a file cannot be read.
    """
    uses = []
    for number, part in enumerate(_native_parts(name)):
        path, source = _path_of_part(part), str(sources[number]) if number < len(sources) else ""
        uses.append(PluginUse(kind="solver", name=part, source=source, file=str(path), sha256=_sha256(path)))
        _allowed[str(path)] = uses[-1]
    return tuple(uses)


def native_uses(solvers: Iterable[str]) -> list[PluginUse]:
    """Return one record for each native part of the named solvers; parts whose file is not allowed are omitted."""
    parts = dict.fromkeys(part for name in solvers for part in _native_parts(name))
    known = ((part, _allowed.get(str(_path_of_part(part)))) for part in parts)
    return [replace(use, name=part) for part, use in known if use is not None]


def is_native_use(use: PluginUse) -> bool:
    """Return whether a stored record is that of a file in another language."""
    return use.kind == "solver" and bool(_native_parts(use.name))


def sha256_in_use(path: str) -> str:
    """Return the SHA-256 of a file that this process may use; empty if it may not."""
    return _allowed[path].sha256 if path in _allowed else ""


def check_unchanged(uses: Iterable[PluginUse]) -> None:
    """Check that no file has changed, because results of two versions would share one name.

    Raises:
        SolverError: if a file has changed.
        PluginError: if a file cannot be read.
    """
    for use in uses:
        if _sha256(Path(use.file)) != use.sha256:
            raise SolverError(f"{use.file} has changed since the command began; run the command again.")


def _path_of_part(part: str) -> Path:
    """Return the absolute path of the file of a native part."""
    return Path(registry.parse(part).options.get("path", "")).expanduser().absolute()


def _native_parts(name: str) -> list[str]:
    """Return the native parts of a registered solver; none for a solver object of the caller."""
    try:
        return registry.native_parts(name)
    except SolverError:
        return []


def _sha256(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise PluginError(f"cannot read {path}: {error.strerror}; restore the file or its permissions.") from None
