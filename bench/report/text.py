"""Words and text in reports: numbers of things, and text of others that stays text in Markdown, whatever it holds."""

from html import escape


def inline(value: object) -> str:
    """Return ``value`` as text for a line or a table cell, in which nothing is markup of HTML or ends the cell."""
    return escape(str(value), quote=False).replace("|", r"\|")


def counted(number: int, noun: str, many: str = "") -> str:
    """Return a number with its noun: ``"1 row"``, ``"2 rows"``; ``many`` is the plural where it is no mere s."""
    return f"{number} {noun if number == 1 else many or f'{noun}s'}"


def unsolved_words(number: int, steps: int, tolerance: float) -> str:
    """Say how many of all steps are not solved: ``"1 of 20 steps is not solved to 1e-04"``."""
    return f"{number} of {counted(steps, 'step')} {'is' if number == 1 else 'are'} not solved to {tolerance:.0e}"
