"""The script that draws charts in a page, which is assembled once and stored in the cache folder."""

import hashlib
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

import vl_convert

from ....problems.exchange.catalog import cache_folder
from ...errors import BenchError
from ..layout.output_file import write_file

PROGRAM = "window.vegaEmbed = vegaEmbed;"
"""The program that is bundled with the libraries that it uses."""

LIBRARY = "vl-convert-python"
"""The distribution that contains these libraries and bundles them."""


@cache
def drawing_script() -> str:
    """Return a script that defines ``vegaEmbed``, which draws Vega specifications in a page without downloads.

    Bundling takes more than a second, so the script is stored in the cache folder of problems, by the version of the
    library that bundles it. A file without the digest of its text in its first line is written again. If the
    folder cannot be written, the script is not stored.
    """
    file = cache_folder() / "scripts" / f"vega-embed-{metadata.version(LIBRARY)}.js"
    script = _stored_script(file)
    if script is None:
        script = str(vl_convert.javascript_bundle(PROGRAM))
        with suppress(BenchError):
            write_file(file, f"// {_digest(script)}\n{script}".encode())
    return script


def _stored_script(file: Path) -> str | None:
    """Return the script in a file; None if the file is missing or its text has changed."""
    try:
        first_line, _, script = file.read_bytes().decode().partition("\n")
    except (OSError, UnicodeDecodeError):
        return None
    return script if first_line == f"// {_digest(script)}" else None


def _digest(script: str) -> str:
    return hashlib.sha256(script.encode()).hexdigest()
