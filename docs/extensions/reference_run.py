"""The page of the reference run, written beside the pages of the site as ``reference-run.html``."""

from pathlib import Path
from typing import Any

from proxbench.bench import load
from proxbench.bench.report.page.assembly import page
from sphinx.application import Sphinx

RUN = Path(__file__).parents[2] / "results" / "reference.bundle"


def _write(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        (Path(app.outdir) / "reference-run.html").write_text(page(load(RUN)), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the page when the others are written."""
    app.connect("build-finished", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
