"""Plugin files of a command: taken into use before it starts, stored with a run, and found again when it is resumed."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from ...problems.contact.solver import SolverError
from ...problems.errors import PluginError
from ...problems.exchange.plugin_files import PluginFile
from ...problems.exchange.plugins import forget, register, registered
from ...solvers import registry
from ..errors import BenchError
from ..isolation.worker import REQUEST_SECONDS
from ..store.records import PluginUse
from .describing import all_offers, offered
from .native_files import allow_native_file, is_native, is_native_use, native_uses, sha256_in_use


def use_plugin_files(paths: Sequence[Path | str], seconds: float = REQUEST_SECONDS) -> None:
    """Let names of solvers and problems lead into plugin files, which run in processes of their own only.

    Args:
        paths: the files; of shared libraries and compiled programs the content is noted, so that a stored run may use
            them.
        seconds: wall time that the import of each may take, with the making of its solvers [s].

    Raises:
        PluginError: if a file is missing, fails to import, offers nothing, a name that is not free, or a solver that
            breaks the contract; it is then not in use.
    """
    for path in map(Path, paths):
        if is_native(path):
            allow_native_file(path)
        else:
            _use(PluginFile.read(path), seconds)


def _use(file: PluginFile, seconds: float) -> None:
    before = next(((known, names) for known, names in registered() if known.path == file.path), None)
    if before is not None and before[0] == file and before[1] is not None:
        return
    register(file, {}, runs_here=False)
    try:
        register(file, offered(file, seconds), runs_here=False)
        for offer in all_offers():
            if offer.file == file and offer.refusal:
                raise PluginError(offer.refusal)
    except PluginError:
        forget(file)
        if before is not None:
            register(*before, runs_here=False)
        raise


def sources(solvers: Iterable[str], problems: Iterable[str], scenes: Iterable[str] = ()) -> list[PluginUse]:
    """Return what of plugins a run uses, for its record: each name, and the file with its SHA-256 or the package.

    Args:
        solvers: names of solvers, with or without options.
        problems: names of problems.
        scenes: names of scenes, without options.
    """
    solvers = list(solvers)
    plain = {plain for name in solvers for plain in _plain_names(name)}
    used = {"solver": plain, "problem": set(problems), "scene": set(scenes)}
    of_offers = [
        PluginUse(
            kind=offer.kind,
            name=offer.name,
            source=offer.source,
            file=str(offer.file.path) if offer.file else "",
            sha256=offer.file.sha256 if offer.file else "",
        )
        for offer in all_offers()
        if offer.name in used[offer.kind] and not offer.refusal
    ]
    return of_offers + native_uses(solvers)


def check_again(recorded: Iterable[PluginUse]) -> None:
    """See that the plugin files and the files in other languages of a stored run are in use, as they were.

    They are not taken into use because a file says so: who resumes a run that comes from elsewhere would run its code.

    Raises:
        BenchError: if one is not in use, is gone, or has changed since: results of two versions would stand under one
            name.
    """
    used = {str(file.path): file.sha256 for file, _ in registered()}
    files = {(use.file, use.sha256, "file" if is_native_use(use) else "plugin file") for use in recorded if use.file}
    for path, sha256, kind in sorted(files):
        in_use = used.get(path) or sha256_in_use(path)
        if not in_use and not Path(path).is_file():
            raise BenchError(f"the results need the {kind} {path}, which is gone; put it back.")
        if not in_use:
            raise BenchError(f"the results need the {kind} {path}; name it with `plugins`.")
        if in_use != sha256:
            raise BenchError(
                f"{kind} {path} has changed since the run began; put the old version back to resume, or begin a "
                "new run."
            )


def _plain_names(solver: str) -> list[str]:
    """Return the plain names of a solver and its parts, none where an object of the caller's has a name of its own."""
    try:
        return registry.plain_names(solver)
    except SolverError:
        return []
