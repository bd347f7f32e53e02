"""The shapes of all bodies as arrays, cached for each tuple of shapes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...arrays import FloatArray
from ..bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from ..bodies.rigid.shapes import Box, HalfSpace, Shape
from .polyhedra import PackedPolyhedra, pack_polyhedra
from .round_bodies import CYLINDER, PLANE, POLYHEDRON, SEGMENT, RoundShapes

MAX_KEPT = 16
"""Largest number of cached tuples of shapes."""


@dataclass(frozen=True, eq=False)
class ShapeArrays:
    """Shapes as arrays.

    Attributes:
        shapes: shapes of all bodies.
        half_sizes: half the edge lengths of boxes [m], 0 for other shapes, shape (n, 3).
        is_box: whether each shape is a box, shape (n,).
        is_ball: whether each shape is a sphere, shape (n,).
        round_shapes: kinds, half lengths and radii of all shapes.
    """

    shapes: tuple[Shape, ...]
    half_sizes: FloatArray
    is_box: NDArray[np.bool_]
    is_ball: NDArray[np.bool_]
    round_shapes: RoundShapes

    @cached_property
    def polyhedra(self) -> PackedPolyhedra:
        """The polyhedra, boxes among them."""
        return pack_polyhedra(self.shapes)


def shape_arrays(shapes: tuple[Shape, ...]) -> ShapeArrays:
    """Return shapes as arrays; the same tuple returns the same arrays, without hashing thousands of shapes."""
    arrays = _cache.get(id(shapes))
    if arrays is None:
        while len(_cache) >= MAX_KEPT:
            del _cache[next(iter(_cache))]
        # the entry keeps a reference to the tuple, so that its id is not reused
        arrays = _cache[id(shapes)] = _make_arrays(shapes)
    return arrays


def _make_arrays(shapes: tuple[Shape, ...]) -> ShapeArrays:
    n = len(shapes)
    half_sizes, kind, half_length, radius = np.zeros((n, 3)), np.full(n, POLYHEDRON), np.zeros(n), np.zeros(n)
    for index, shape in enumerate(shapes):
        if isinstance(shape, Box):
            half_sizes[index] = 0.5 * np.array(shape.size)
        elif isinstance(shape, HalfSpace):
            kind[index] = PLANE
        elif isinstance(shape, Sphere | Capsule | Cylinder):
            kind[index] = CYLINDER if isinstance(shape, Cylinder) else SEGMENT
            half_length[index] = 0.0 if isinstance(shape, Sphere) else 0.5 * shape.length
            radius[index] = shape.radius
    is_ball = np.array([isinstance(shape, Sphere) for shape in shapes], dtype=np.bool_)
    return ShapeArrays(shapes, half_sizes, half_sizes[:, 0] > 0.0, is_ball, RoundShapes(kind, half_length, radius))


_cache: dict[int, ShapeArrays] = {}
