"""The file that --output names, and others that are refused before any work."""

import tempfile
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from ..errors import BenchError


def output_file(output: Path, stem: str, suffix: str, force: bool) -> Path:
    """Return the file that ``output`` names, its folder made: the file itself, or a new one in that folder.

    Args:
        output: a file if it ends in ``suffix``; a folder if it is one, or has no suffix.
        stem: what the name of a new file begins with; date and time follow.
        suffix: ending of the file.
        force: whether it may exist.

    Raises:
        BenchError: if it exists and ``force`` is not given, has another suffix, or its folder cannot be made.
    """
    is_folder = output.is_dir()
    if output.suffix not in ("", suffix) and not is_folder:
        raise BenchError(
            f"--output {output} ends in {output.suffix}, and this result is a {suffix} file; name a file that ends in "
            f"{suffix}, or a folder (one with a dot in its name must exist)."
        )
    is_file = output.suffix == suffix and not is_folder
    file = output if is_file else output / f"{stem}-{datetime.now(UTC):%Y%m%d-%H%M%S}{suffix}"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        exists = file.exists()
    except OSError as error:
        raise BenchError(f"cannot write {file}: {error.strerror}; choose another --output.") from None
    if exists and not force:
        raise BenchError(f"{file} exists already; go on with --resume {file}, or replace it with --force.")
    return file


def refuse_taken(files: Iterable[Path], force: bool) -> None:
    """Find out whether files can be written later, and leave everything as it is.

    Raises:
        BenchError: if one exists and ``force`` is not given, or cannot be written.
    """
    for file in files:
        try:
            if file.exists():
                if not force:
                    raise BenchError(f"{file} exists already; choose another name, or replace it with --force.")
                with file.open("ab"):
                    continue
            folder = file.absolute().parent
            while not folder.exists():
                folder = folder.parent
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise BenchError(f"cannot write {file}: {error.strerror}; choose another place.") from None
