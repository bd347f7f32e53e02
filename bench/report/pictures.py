"""The pictures of a simulation or study: refused before any work, drawn after everything else is stored and printed."""

from collections.abc import Callable
from pathlib import Path

from ...problems.errors import said
from ..errors import BenchError
from .output_file import refuse_taken

OTHER_FORMATS = (".pdf", ".jpg", ".jpeg", ".gif", ".eps", ".html", ".webp", ".tif", ".tiff", ".bmp")
"""Endings of pictures and pages that nobody means as part of a name."""


def picture_files(path: Path) -> tuple[Path, Path]:
    """Return the files, .svg and .png, that a picture at ``path`` is written to.

    Raises:
        BenchError: if ``path`` names no file, or one of another format.
    """
    if path.suffix.lower() in OTHER_FORMATS:
        raise BenchError(
            f"charts are written as .svg and .png, not as {path.suffix}; leave {path.suffix} out of {path}."
        )
    base = path.with_suffix("") if path.suffix.lower() in (".svg", ".png") else path
    if base.name in ("", ".."):
        raise BenchError(f"a chart cannot be written to {str(path)!r}; name a file.")
    return base.with_name(f"{base.name}.svg"), base.with_name(f"{base.name}.png")


def refuse_pictures(path: Path, force: bool) -> None:
    """Find out whether a picture can be written at ``path``, and leave everything as it is.

    Raises:
        BenchError: if it cannot, or if it exists and ``force`` is not given.
    """
    refuse_taken(picture_files(path), force)


def drawn(
    draw: Callable[[], list[Path]],
    result: Path,
    what: str = "chart",
    again: str = "draw it with: proxbench simulate --resume {} --chart NAME",
) -> list[Path]:
    """Draw pictures of what is stored in ``result``; return their files.

    Args:
        draw: draws them and returns their files.
        result: what they are drawn from.
        what: what they are called.
        again: how they are drawn without simulating again, {} in place of the result.

    Raises:
        BenchError: if that fails, for whatever reason; it says how to draw them later.
    """
    try:
        return draw()
    except Exception as error:
        raise BenchError(
            f"{result} is kept, but its {what} is missing: {said(error)}; {again.format(result)}"
        ) from error
