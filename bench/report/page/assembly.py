"""One offline HTML page of a run: its document, the script that draws charts, and the page's own script and style.

The page makes no requests: its Content-Security-Policy allows only its own scripts, by their hashes. All text of a run
is in the JSON document, escaped so that it cannot end its element; the page shows it as text nodes.
"""

import base64
import hashlib
import json
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from ...errors import BenchError
from ...store.frames import JUDGED, RunFrames
from ..charts.drawing_script import drawing_script
from ..layout.output_file import write_file
from ..profiles import baseline_of, require_cases
from .document import page_document

FILE = "report.html"
"""Name of the page in the folder of a run."""

SCRIPTS = ("elements.js", "model.js", "address.js", "charts.js", "views.js", "main.js")
"""Parts of the page's own script; each depends only on earlier ones."""


def write_page(frames: RunFrames, baseline: str = "") -> Path:
    """Write the page of a run into its folder, or that of its residual; return the file.

    Args:
        frames: the run.
        baseline: initial reference solver of speed-ups; if empty, the one that solves the most problems.

    Raises:
        BenchError: if the run is a study of simulations or has no case, the baseline is not one of its solvers, or
            the file is a link out of its folder.
        UnwritableError: if the file cannot be written.
    """
    folder = frames.output_folder if frames.residual == JUDGED else frames.output_folder / frames.residual
    return write_file(folder / FILE, page(frames, baseline).encode())


def page(frames: RunFrames, baseline: str = "") -> str:
    """Return the page of a run, as in ``write_page``."""
    if frames.is_study:
        raise BenchError(f"{frames.folder} is a study of simulations, which has no page; draw its charts.")
    require_cases(frames)
    document = page_document(frames, baseline_of(frames, baseline))
    drawing, script = (_in_script(text) for text in (drawing_script(), "\n".join(map(_source, SCRIPTS))))
    return Template(_source("page.html")).substitute(
        policy=_policy(drawing, script),
        style=_source("page.css"),
        document=_embedded(document),
        drawing=drawing,
        script=script,
    )


def _embedded(document: dict[str, Any]) -> str:
    """Return JSON with escapes, so that it can neither end nor comment out its script element."""
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("<", r"\u003c").replace(">", r"\u003e").replace("&", r"\u0026")


def _in_script(text: str) -> str:
    """Return a script with the end tags of script elements and the starts of HTML comments escaped."""
    return text.replace("</script", r"<\/script").replace("<!--", r"<\!--")


def _policy(*scripts: str) -> str:
    """Return the Content-Security-Policy of a page with these scripts."""
    hashes = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    sources = " ".join(f"'sha256-{value}'" for value in hashes)
    allowed = {
        "default-src": "'none'",
        "script-src": sources,
        "style-src": "'unsafe-inline'",
        "img-src": "data:",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{kind} {value}" for kind, value in allowed.items())


def _source(name: str) -> str:
    """Return the text of a file of this package."""
    return (resources.files(__package__) / name).read_text(encoding="utf-8")
