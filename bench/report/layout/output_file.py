"""Output files of commands: validated before any work, and written as a whole or not at all."""

import tempfile
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from pathlib import Path
from shlex import quote

from ....problems.errors import error_text
from ...errors import BenchError, UnwritableError
from ...store.store import check_links_inside, put_file

OTHER_FORMATS = (".pdf", ".jpg", ".jpeg", ".gif", ".eps", ".html", ".webp", ".tif", ".tiff", ".bmp")
"""Suffixes of formats in which charts are not written."""


def write_file(file: Path, content: bytes) -> Path:
    """Write a file as a whole or not at all, create its folder if necessary, and return the file.

    Raises:
        BenchError: if the file is a link to a file outside its folder.
        UnwritableError: if the file cannot be written.
    """
    check_links_inside(file, file.parent)
    put_file(file, content, "choose a writable place with free space", UnwritableError)
    return file


def output_file(output: Path, stem: str, suffix: str, force: bool) -> Path:
    """Return the path of an output file, and create its folder.

    The path is ``output`` if that is a file, or otherwise a file in the folder ``output``, named by ``stem`` and the
    time.

    Args:
        output: a file if it ends in ``suffix``; a folder if it exists as a folder, or has no suffix.
        stem: beginning of the name of a new file, before date and time.
        suffix: suffix of the file.
        force: whether an existing file may be replaced.

    Raises:
        BenchError: if the file exists and ``force`` is not given, has another suffix, or is a link to a file outside
            its folder, or if its folder cannot be created.
    """
    is_folder = output.is_dir()
    if output.suffix not in ("", suffix) and not is_folder:
        raise BenchError(
            f"`output` {output} ends in {output.suffix}, but this result is a {suffix} file; "
            f"name a file that ends in {suffix}, or a folder (one with a dot in its name must exist)."
        )
    is_file = output.suffix == suffix and not is_folder
    file = output if is_file else output / f"{stem}-{datetime.now(UTC):%Y%m%d-%H%M%S}{suffix}"
    check_links_inside(file, file.parent)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        exists = file.exists()
    except OSError as error:
        raise BenchError(f"cannot write {file}: {error.strerror}; choose another `output`.") from None
    if exists and not force:
        raise BenchError(f"{file} exists already; continue it with `resume`, or replace it with `force=True`.")
    return file


def check_writable(files: Iterable[Path], force: bool) -> None:
    """Check that files can be written later, without changing anything.

    Raises:
        BenchError: if a file exists and ``force`` is not given, is a link to a file outside its folder, or cannot be
            written.
    """
    for file in files:
        check_links_inside(file, file.parent)
        try:
            if file.exists():
                if not force:
                    raise BenchError(f"{file} exists already; choose another name, or replace it with `force=True`.")
                with file.open("ab"):  # appends nothing, but fails if the file is not writable
                    continue
            folder = file.absolute().parent
            while not folder.exists():
                folder = folder.parent
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise BenchError(f"cannot write {file}: {error.strerror}; choose another folder.") from None


def picture_files(path: Path) -> tuple[Path, Path]:
    """Return the .svg and .png files to which a picture at ``path`` is written.

    Raises:
        BenchError: if ``path`` is not a file name, or has another format.
    """
    if path.suffix.lower() in OTHER_FORMATS:
        raise BenchError(
            f"charts are written as .svg and .png, not as {path.suffix}; leave {path.suffix} out of {path}."
        )
    base = path.with_suffix("") if path.suffix.lower() in (".svg", ".png") else path
    if base.name in ("", ".."):
        raise BenchError(f"a chart cannot be written to {str(path)!r}; name a file.")
    return base.with_name(f"{base.name}.svg"), base.with_name(f"{base.name}.png")


def check_pictures_writable(path: Path, force: bool) -> None:
    """Check that a picture can be written at ``path``, without changing anything.

    Raises:
        BenchError: if the picture cannot be written, or exists and ``force`` is not given.
    """
    check_writable(picture_files(path), force)


def draw_pictures(
    draw: Callable[[], list[Path]],
    result: Path,
    what: str = "chart",
    remedy: str = "draw it with: proxbench simulate --resume {} --chart NAME",
) -> list[Path]:
    """Draw pictures of a stored result, and return their files.

    Args:
        draw: function that draws the pictures and returns their files.
        result: file of the result.
        what: name of the pictures in messages.
        remedy: instructions to draw them later, with {} for the result.

    Raises:
        UnwritableError: if the files cannot be written, with these instructions.
        BenchError: if drawing fails for another reason, with these instructions.
    """
    try:
        return draw()
    except Exception as error:
        kind = UnwritableError if isinstance(error, UnwritableError) else BenchError
        raise kind(
            f"{result} is kept, but its {what} is missing: {error_text(error)}; {remedy.format(quote(str(result)))}"
        ) from error
