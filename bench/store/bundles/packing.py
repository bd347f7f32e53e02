"""Runs as single files: pack one, and judge a packed one again."""

import os
from collections.abc import Callable
from pathlib import Path

from ...errors import BenchError
from .bundle import SUFFIX, bundle_of_run, read_bundle, write_bundle
from .rejudge import Rejudged
from .rejudge import rejudge as _rejudge

OnCase = Callable[[int, int], None]
"""Called with the number of cases that are done, and of all."""


def _ignore(*shown: object) -> None:
    """Show nothing."""


def bundle(run_dir: os.PathLike[str] | str, file: os.PathLike[str] | str | None = None, *, force: bool = False) -> Path:
    """Pack a run into one file, as a whole or not at all; return the file.

    It holds plan, machines, cases, the impulses of the finest point of each, and the problems that the package does not
    hold. Equal runs give equal files.

    Args:
        run_dir: the folder of the run, or the run.
        file: where to; the name of the run with ``.bundle``, in the current folder, if None.
        force: replace a file that exists.

    Raises:
        BenchError: if the folder is no run or has a damaged file, nothing is measured, it is a study or of an earlier
            version that kept no impulses, or the file exists or cannot be written.
    """
    packed, folder = bundle_of_run(Path(run_dir)), Path(run_dir).resolve()
    path = Path(f"{folder.name}{SUFFIX}") if file is None else Path(file)
    if path.exists() and not force:
        raise BenchError(f"{path} exists already; name another file, or replace it with `force=True`.")
    write_bundle(packed, path)
    return path


def rejudge(file: os.PathLike[str] | str, on_case: OnCase = _ignore) -> Rejudged:
    """Judge a bundle again, from its problems and impulses; no code of it runs, and nothing is written.

    Args:
        file: the bundle.
        on_case: called with the number of cases that are done, and of all.

    Raises:
        BenchError: if it is no bundle, damaged, of another version, or does not hold together.
    """
    return _rejudge(read_bundle(Path(file)), on_case)
