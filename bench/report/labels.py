"""Where labels fit beside the ends of curves: plain geometry in pixels, x to the right and y downwards."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FONT_SIZE = 11
"""Of labels [pixels]."""

CHARACTER_WIDTH = 0.56 * FONT_SIZE
"""Mean width of a character of a sans serif [pixels], rather too large than too small."""

HEIGHT = 13.0
"""Of a label [pixels]."""

REACH = 7.0
"""From the end of a curve to its label [pixels]: a mark and a little room."""

CLEAR = 4.0
"""Room between a label and any curve [pixels], half the size of a mark."""

SPACING = 3.0
"""Distance of the points in which curves are looked at [pixels]."""

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Label:
    """Where the label of a curve stands.

    Attributes:
        x: its anchor [pixels].
        y: its middle [pixels].
        align: on which side of it the anchor is.
    """

    x: float
    y: float
    align: Literal["left", "center", "right"]


@dataclass(frozen=True)
class _Box:
    left: float
    top: float
    right: float
    bottom: float

    def meets(self, points: Points) -> bool:
        x, y = points.T
        inside = (x > self.left - CLEAR) & (x < self.right + CLEAR) & (y > self.top - CLEAR) & (y < self.bottom + CLEAR)
        return bool(inside.any())

    def distances(self, points: Points) -> Points:
        """Return how far points are from the box, shape (n,)."""
        x, y = points.T
        across = np.maximum(0.0, np.maximum(self.left - x, x - self.right))
        return np.asarray(np.hypot(across, np.maximum(0.0, np.maximum(self.top - y, y - self.bottom))))

    def overlaps(self, other: "_Box") -> bool:
        return not (
            self.right <= other.left or other.right <= self.left or self.bottom <= other.top or other.bottom <= self.top
        )


def placed_labels(curves: Mapping[str, Points], width: float, height: float, margin: float = 0.0) -> dict[str, Label]:
    """Return a label for each curve that has room for its name beside its end: it meets no curve and no other label.

    A curve that ends where another one does gets none, and no label is nearer to the end of another curve than to its
    own: nothing would say whose it is.

    Args:
        curves: points of each curve by its name, shape (n, 2), its end last [pixels].
        width: of the plot [pixels].
        height: of the plot [pixels]; a curve that ends above or below has left the plot and gets no label.
        margin: how far labels may stand out to the right of the plot [pixels].
    """
    ends = {name: points[-1] for name, points in curves.items()}
    drawn = {name: _sampled(points) for name, points in curves.items()}
    taken: list[_Box] = []
    labels = {}
    for name, end in ends.items():
        if not (0.0 <= end[0] <= width and 0.0 <= end[1] <= height):
            continue
        others = np.array([other for label, other in ends.items() if label != name]).reshape(-1, 2)
        if (np.hypot(*(others - end).T) < REACH).any():
            continue
        for label, box in _candidates(name, float(end[0]), float(end[1])):
            inside = box.left >= 0.0 and box.right <= width + margin and box.top >= 0.0 and box.bottom <= height
            nearest = bool((box.distances(others) > box.distances(end[None])).all())
            free = not any(map(box.overlaps, taken)) and not any(map(box.meets, drawn.values()))
            if inside and nearest and free:
                labels[name] = label
                taken.append(box)
                break
    return labels


def _candidates(name: str, x: float, y: float) -> Iterator[tuple[Label, _Box]]:
    """Yield where the label of a curve that ends at (x, y) may stand, the best place first."""
    length, half = CHARACTER_WIDTH * len(name), HEIGHT / 2.0
    step = half + CLEAR + 1.0
    for shift in (0.0, -step, step):
        yield (
            Label(x + REACH, y + shift, "left"),
            _Box(x + REACH, y + shift - half, x + REACH + length, y + shift + half),
        )
    for shift in (-REACH - half, REACH + half):
        yield (
            Label(x, y + shift, "center"),
            _Box(x - length / 2.0, y + shift - half, x + length / 2.0, y + shift + half),
        )
    yield Label(x - REACH, y, "right"), _Box(x - REACH - length, y - half, x - REACH, y + half)


def _sampled(points: Points) -> Points:
    """Return points along a polyline, at most ``SPACING`` apart."""
    parts = [points[-1:]]
    for begin, end in pairwise(points):
        count = min(int(np.hypot(*(end - begin)) / SPACING) + 1, 10_000)
        parts.append(begin + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (end - begin))
    return np.concatenate(parts)
