"""Numbers of things in words."""


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, singular or plural: ``"1 row"``, ``"2 rows"``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
