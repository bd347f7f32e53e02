"""Labels stand beside the ends of their curves, or nowhere."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.bench.report.charts.drawing import CHARACTER_WIDTH, HEIGHT, Label, placed_labels

WIDTH, TALL = 600.0, 300.0


def line(*points: tuple[float, float]) -> NDArray[np.float64]:
    return np.array(points)


def box(name: str, label: Label) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a label."""
    length = CHARACTER_WIDTH * len(name)
    left = label.x - {"left": 0.0, "center": length / 2.0, "right": length}[label.align]
    return left, label.y - HEIGHT / 2.0, left + length, label.y + HEIGHT / 2.0


def test_a_curve_alone_is_named_to_its_right() -> None:
    label = placed_labels({"alone": line((0.0, 0.0), (100.0, 100.0))}, WIDTH, TALL)["alone"]
    assert label.align == "left"
    assert label.x > 100.0
    assert label.y == 100.0


@pytest.mark.parametrize("seed", range(20))
def test_labels_overlap_neither_each_other_nor_any_curve(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curves = {f"solver number {k}": rng.uniform((0.0, 0.0), (WIDTH, TALL), (3, 2)) for k in range(12)}
    labels = placed_labels(curves, WIDTH, TALL, 50.0)
    assert labels
    boxes = {name: box(name, label) for name, label in labels.items()}
    for name, (left, top, right, bottom) in boxes.items():
        assert left >= 0.0
        assert right <= WIDTH + 50.0
        for other, (its_left, its_top, its_right, its_bottom) in boxes.items():
            apart = right <= its_left or its_right <= left or bottom <= its_top or its_bottom <= top
            assert other == name or apart
        for points in curves.values():
            for begin, end in pairwise(points):
                x, y = (begin + np.linspace(0.0, 1.0, 2001)[:, None] * (end - begin)).T
                assert not ((x > left) & (x < right) & (y > top) & (y < bottom)).any()


def test_curves_that_end_in_one_point_are_not_named() -> None:
    curves = {"one": line((0.0, 0.0), (100.0, 100.0)), "other": line((0.0, 200.0), (101.0, 100.0))}
    assert placed_labels(curves, WIDTH, TALL) == {}


def test_a_curve_that_leaves_the_plot_is_not_named() -> None:
    assert placed_labels({"diverging": line((0.0, 10.0), (100.0, -1e6))}, WIDTH, TALL) == {}


def test_a_name_that_is_longer_than_the_plot_has_no_room() -> None:
    assert placed_labels({"long" * 100: line((0.0, 0.0), (100.0, 100.0))}, WIDTH, TALL) == {}
