"""Text of others in Markdown pages: it stays text, whatever it holds."""

from html import escape


def inline(value: object) -> str:
    """Return ``value`` as text for a line or a table cell, in which nothing is markup of HTML or ends the cell."""
    return escape(str(value), quote=False).replace("|", r"\|")
