"""The style of solvers in charts and recordings: colours for colour-blind readers, shapes and dashes."""

from collections.abc import Iterable
from dataclasses import dataclass

PALETTE = ("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#8a14ff", "#34192f", "#702500", "#1b1b7e")
"""Okabe & Ito's colours, and those that differ most from them for readers who lack one kind of cone."""

SHAPES = ("circle", "square", "triangle-up", "diamond", "cross", "triangle-down")
"""Shapes of marks."""

DASHES = ((1, 0), (6, 3), (2, 2), (8, 3, 2, 3))
"""Strokes and gaps of lines [pixels]."""

DARK = 90
"""Brightness (0 to 255) below which a colour is hard to see on a dark background."""


@dataclass(frozen=True)
class SolverStyle:
    """The style of one solver.

    Attributes:
        colour: ``"#rrggbb"``.
        shape: shape of its marks, one of ``SHAPES``.
        dash: dash pattern of its lines, one of ``DASHES``.
    """

    colour: str
    shape: str
    dash: tuple[int, ...]


def solver_styles(names: Iterable[str]) -> dict[str, SolverStyle]:
    """Return the style of each name; among forty names, no two share colour and dash, or colour and shape."""
    return {name: solver_style(index) for index, name in enumerate(names)}


def solver_style(index: int) -> SolverStyle:
    """Return the style of solver number ``index`` of a run.

    Neighbours differ in colour, shape and dash. Colours repeat after ten. Shapes are shifted by one after three
    repetitions, and dashes after two: their numbers have common divisors with ten, so they would also repeat.
    """
    colours, shapes, dashes = len(PALETTE), len(SHAPES), len(DASHES)
    return SolverStyle(
        PALETTE[index % colours],
        SHAPES[(index + index // (3 * colours)) % shapes],
        DASHES[(index + index // (2 * colours)) % dashes],
    )


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue (0 to 255) of a colour written ``"#rrggbb"``."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def on_dark(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue (0 to 255) of a colour on a dark background: dark colours are mixed with white."""
    red, green, blue = rgb(colour)
    if 0.299 * red + 0.587 * green + 0.114 * blue >= DARK:
        return red, green, blue
    return (red + 255) // 2, (green + 255) // 2, (blue + 255) // 2
