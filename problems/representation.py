"""Representations for users: a line of text in a console, a small table in a notebook."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape

MAX_LISTED = 4
"""Largest number of names that a line of text lists; if there are more, it states their number."""


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return ``"1 contact"`` or ``"59 contacts"``; the plural ends in s unless it is given."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def names_or_number(names: Iterable[str], noun: str) -> str:
    """Return the names, comma-separated, or ``"12 solvers"`` if there are more than ``MAX_LISTED``."""
    known = list(names)
    return ", ".join(known) if 0 < len(known) <= MAX_LISTED else counted(len(known), noun)


def first_names(names: Sequence[str], max_names: int) -> str:
    """Return the names, comma-separated; after the first ``max_names``, only the number of the other names."""
    more = f" and {len(names) - max_names} more" if len(names) > max_names else ""
    return ", ".join(names[:max_names]) + more


def html_table(title: str, facts: Mapping[str, object]) -> str:
    """Return facts by name as an HTML table under a title; all texts are escaped.

    Floats are shown with four digits.
    """
    rows = "".join(
        f'<tr><th style="text-align: left">{escape(name)}</th>'
        f'<td style="text-align: left">{escape(_text(value))}</td></tr>'
        for name, value in facts.items()
    )
    return f"<table><caption>{escape(title)}</caption><tbody>{rows}</tbody></table>"


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
