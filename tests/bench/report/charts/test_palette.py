"""Solvers can be distinguished in every chart, also by colour-blind readers."""

from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.bench.report.charts.palette import PALETTE, on_dark, rgb, solver_style, solver_styles

DICHROMATS = {
    "all cones": np.eye(3),
    "no long cones": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no medium cones": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no short cones": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""Matrices of linear RGB by the missing cones (Machado, Oliveira & Fernandes 2009, severity 1)."""

TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])


def lab(colour: str, eyes: str) -> NDArray[np.float64]:
    """Return the CIELAB coordinates of a colour as seen by a reader with this colour vision."""
    share = np.array(rgb(colour)) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    x, y, z = TO_XYZ @ np.clip(DICHROMATS[eyes] @ linear, 0.0, 1.0) / WHITE
    f = [np.cbrt(t) if t > 0.008856 else 7.787 * t + 16.0 / 116.0 for t in (x, y, z)]
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.mark.parametrize("eyes", DICHROMATS)
def test_colours_remain_distinguishable_for_colour_blind_readers(eyes: str) -> None:
    distances = [np.linalg.norm(lab(a, eyes) - lab(b, eyes)) for a, b in combinations(PALETTE, 2)]
    assert min(distances) > 15.0  # 2.3 is just noticeable


def test_forty_solvers_differ_in_their_lines_and_in_their_marks() -> None:
    assigned = [solver_style(index) for index in range(40)]
    assert len({(one.colour, one.dash) for one in assigned}) == 40
    assert len({(one.colour, one.shape) for one in assigned}) == 40


def test_neighbours_differ_in_colour_shape_and_dash() -> None:
    for one, other in zip(map(solver_style, range(40)), map(solver_style, range(1, 41)), strict=True):
        assert one.colour != other.colour
        assert one.shape != other.shape
        assert one.dash != other.dash


def test_line_style_depends_only_on_the_position_in_the_run() -> None:
    assert solver_styles(["a", "b"])["b"] == solver_styles(["c", "d", "e"])["d"]


@pytest.mark.parametrize("colour", PALETTE)
def test_all_colours_contrast_with_a_dark_background(colour: str) -> None:
    assert np.dot((0.299, 0.587, 0.114), on_dark(colour)) >= 90.0
