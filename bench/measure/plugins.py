"""Plugin files of a command: taken into use before it starts, stored with a run, and found again when it is resumed."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ...problems.catalog.catalog import plugin_problems
from ...problems.catalog.plugin_files import PluginFile
from ...problems.catalog.plugins import Offer, forget, register, registered
from ...problems.errors import PluginError
from ...solvers import registry
from ..errors import BenchError
from ..isolation.plugin_trial import try_import


def use_plugin_files(paths: Sequence[Path | str]) -> None:
    """Let names of solvers and problems lead into plugin files, in this process and in those of its cases.

    Raises:
        PluginError: if a file is missing, fails to import, offers nothing, a name that is not free, or a solver that
            breaks the contract; it is then not in use.
    """
    for path in paths:
        file = PluginFile.read(path)
        if file not in registered():
            try_import(file)
        use(file)


def use(file: PluginFile) -> None:
    """Take one plugin file into use; see ``use_plugin_files``."""
    before = next((known for known in registered() if known.path == file.path), None)
    register(file)
    try:
        file.check_offers()
        _check(file)
    except PluginError:
        forget(file)
        if before is not None:
            register(before)
        raise


def offers_of(file: PluginFile) -> list[Offer]:
    """Return what a registered plugin file offers, solvers first."""
    return [offer for offer in (*registry.plugin_solvers(), *plugin_problems()) if offer.file == file]


def sources(solvers: Iterable[str], problems: Iterable[str]) -> list[dict[str, Any]]:
    """Return what of plugins a run uses, for its record: each name, and the file with its SHA-256 or the package.

    Args:
        solvers: names of solvers, with or without options.
        problems: names of problems.
    """
    plain = {name.partition("(")[0] for name in solvers}
    used = [offer for offer in registry.plugin_solvers() if offer.name in plain]
    chosen = set(problems)
    used += [offer for offer in plugin_problems() if offer.name in chosen]
    return [
        {"kind": offer.kind, "name": offer.name, "source": offer.source}
        | ({"file": str(offer.file.path), "sha256": offer.file.sha256} if offer.file else {})
        for offer in used
        if not offer.refusal
    ]


def check_again(recorded: Iterable[dict[str, Any]]) -> None:
    """See that the plugin files of a stored run are in use, as they were.

    They are not taken into use because a file says so: who resumes a run that comes from elsewhere would run its code.

    Raises:
        BenchError: if one is not in use, is gone, or has changed since: results of two versions would stand under one
            name.
    """
    used = {str(file.path): file for file in registered()}
    for path, sha256 in sorted({(entry["file"], entry.get("sha256")) for entry in recorded if "file" in entry}):
        if path not in used and not Path(path).is_file():
            raise BenchError(f"the run was measured with plugin file {path}, which is gone; put it back to resume.")
        if path not in used:
            raise BenchError(f"the run was measured with plugin file {path}; to run it again, add --plugin {path}.")
        if used[path].sha256 != sha256:
            raise BenchError(
                f"plugin file {path} has changed since the run began; put the old version back to resume, or begin a "
                "new run."
            )


def _check(file: PluginFile) -> None:
    """Raise ``PluginError`` for the first thing wrong with what ``file`` offers."""
    for offer in offers_of(file):
        if offer.refusal:
            raise PluginError(offer.refusal)
        if offer.kind == "solver":
            registry.create(offer.name)
