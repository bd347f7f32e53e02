"""How solvers look in every chart and recording: colours that colour-blind readers can distinguish, shapes, dashes."""

from collections.abc import Iterable
from dataclasses import dataclass

PALETTE = ("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#8a14ff", "#34192f", "#702500", "#1b1b7e")
"""Okabe & Ito's colours, and those that stay farthest from them where one kind of cones is missing."""

SHAPES = ("circle", "square", "triangle-up", "diamond", "cross", "triangle-down")
"""Shapes of marks."""

DASHES = ((1, 0), (6, 3), (2, 2), (8, 3, 2, 3))
"""Strokes and gaps of lines [pixels]."""

DARK = 90
"""Brightness (0 to 255) below which a colour is hard to see on a dark background."""


@dataclass(frozen=True)
class Look:
    """How one solver is drawn.

    Attributes:
        colour: ``"#rrggbb"``.
        shape: of its marks, one of ``SHAPES``.
        dash: of its lines, one of ``DASHES``.
    """

    colour: str
    shape: str
    dash: tuple[int, ...]


def looks(names: Iterable[str]) -> dict[str, Look]:
    """Return the look of each name; forty names share neither colour and dash nor colour and shape."""
    return {name: look(index) for index, name in enumerate(names)}


def look(index: int) -> Look:
    """Return the look of the solver number ``index`` of a run.

    Neighbours differ in all three. Colours come back after ten; the shifts by one keep dashes and shapes, whose numbers
    have a divisor in common with ten, from coming back with them.
    """
    colours, shapes, dashes = len(PALETTE), len(SHAPES), len(DASHES)
    return Look(
        PALETTE[index % colours],
        SHAPES[(index + index // (3 * colours)) % shapes],
        DASHES[(index + index // (2 * colours)) % dashes],
    )


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue (0 to 255) of a colour written ``"#rrggbb"``."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def on_dark(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue (0 to 255) of a colour on a dark background: dark ones go halfway to white."""
    red, green, blue = rgb(colour)
    if 0.299 * red + 0.587 * green + 0.114 * blue >= DARK:
        return red, green, blue
    return (red + 255) // 2, (green + 255) // 2, (blue + 255) // 2
