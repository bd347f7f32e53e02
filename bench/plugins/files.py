"""Plugin files of a command: register them before it starts, store them with a run, and check them on resumption."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from ...problems.contact.solver import SolverError
from ...problems.errors import PluginError
from ...problems.exchange.plugins.files import PluginFile
from ...problems.exchange.plugins.offers import forget, register, registered
from ...solvers import registry
from ..errors import BenchError
from ..isolation.worker import REQUEST_SECONDS
from ..store.records import PluginUse
from .descriptions import all_offers, offers_of_file
from .native_files import allow_native_file, is_native, is_native_use, native_uses, sha256_in_use


def use_plugin_files(paths: Sequence[Path | str], seconds: float = REQUEST_SECONDS) -> None:
    """Make the solvers, problems and scenes of plugin files available by name; the files run in child processes only.

    Args:
        paths: the files. Shared libraries and compiled programs are registered with their SHA-256, so that a stored
            run may use them.
        seconds: wall time limit to import a file and create its solvers [s].

    Raises:
        PluginError: if a file is missing or cannot be imported, or provides nothing, a name already taken, or a solver
            that violates the interface; the file is then not registered.
    """
    for path in map(Path, paths):
        if is_native(path):
            allow_native_file(path)
        else:
            _register_file(PluginFile.read(path), seconds)


def _register_file(file: PluginFile, seconds: float) -> None:
    """Register a plugin file with its names; on an error, restore the earlier registration of its path."""
    earlier = next(((known, names) for known, names in registered() if known.path == file.path), None)
    if earlier is not None and earlier[0] == file and earlier[1] is not None:
        return
    register(file, {}, runs_here=False)
    try:
        register(file, offers_of_file(file, seconds), runs_here=False)
        for offer in all_offers():
            if offer.file == file and offer.rejection:
                raise PluginError(offer.rejection)
    except PluginError:
        forget(file)
        if earlier is not None:
            register(*earlier, runs_here=False)
        raise


def plugin_uses(solvers: Iterable[str], problems: Iterable[str], scenes: Iterable[str] = ()) -> list[PluginUse]:
    """Return the plugins that a run uses, each with its package, or its file and SHA-256.

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
        if offer.name in used[offer.kind] and not offer.rejection
    ]
    return of_offers + native_uses(solvers)


def check_plugins_unchanged(recorded: Iterable[PluginUse]) -> None:
    """Check that the plugin files and the native files of a stored run are in use and unchanged.

    The files are not registered automatically, because resuming someone else's run would execute its code.

    Raises:
        BenchError: if a file is not registered, is missing, or has changed, so that two versions would share a name.
    """
    used = {str(file.path): file.sha256 for file, _ in registered()}
    files = {(use.file, use.sha256, "file" if is_native_use(use) else "plugin file") for use in recorded if use.file}
    for path, sha256, kind in sorted(files):
        in_use = used.get(path) or sha256_in_use(path)
        if not in_use and not Path(path).is_file():
            raise BenchError(f"the results need the {kind} {path}, which is missing; restore it.")
        if not in_use:
            raise BenchError(f"the results need the {kind} {path}; name it with `plugins`.")
        if in_use != sha256:
            raise BenchError(
                f"{kind} {path} has changed since the run began; restore the old version to resume, or start a new run."
            )


def _plain_names(solver: str) -> list[str]:
    """Return the plain names of a solver and its parts; none for an object with an arbitrary name."""
    try:
        return registry.plain_names(solver)
    except SolverError:
        return []
