"""Escape docstrings: bars are absolute values, and the summary of a property may contain a colon."""

import re
from typing import Any

from sphinx.application import Sphinx

COLON = "\N{RATIO}"
"""A character that looks like a colon, because napoleon parses text before a real colon as the type of a property."""


def _plain(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Escape bars outside of literals, and the colon in the first line of a property."""
    if what in ("property", "attribute") and lines:
        lines[0] = lines[0].replace(": ", f"{COLON} ")
    for number, line in enumerate(lines):
        parts = re.split(r"(``.*?``)", line)
        lines[number] = "".join(part if part.startswith("``") else part.replace("|", r"\|") for part in parts)


def setup(app: Sphinx) -> dict[str, bool]:
    """Do it before napoleon reads the docstring."""
    app.connect("autodoc-process-docstring", _plain, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
