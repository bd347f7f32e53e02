"""Convex polyhedra as shapes of rigid bodies: the hull of given points, in its principal axes of inertia."""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ....arrays import FloatArray, IntArray
from ....errors import ProblemError

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

MAX_FACES = 64
"""Largest number of faces of a polyhedron."""

MAX_CORNERS = 32
"""Largest number of corners of a face."""

DIRECTION_TOLERANCE = 1e-9**0.5
"""Largest angle [rad], or distance divided by the size, up to which faces and directions count as equal."""

FLATNESS = 1e-4
"""Tolerated distance of corners from their face, divided by the size; more than ``DIRECTION_TOLERANCE``, up to which
triangles are merged into one face."""


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A convex polyhedron; ``convex_polyhedron`` creates one from its corners.

    Attributes:
        vertices: corners in body axes [m], shape (n, 3).
        faces: indices of the corners of each face, counter-clockwise seen from outside.
        volume: volume [m³].
        inertia: principal moments of inertia for a density of 1 [m⁵], shape (3,).

    Raises:
        ProblemError: if a face is flat, inside out or names a missing vertex, the body is not convex around the origin,
            the faces do not close its surface, or volume or inertia is not positive.
    """

    vertices: FloatArray
    faces: tuple[tuple[int, ...], ...]
    volume: float
    inertia: FloatArray

    def __post_init__(self) -> None:
        remedy = "build the polyhedron from its corners with convex_polyhedron"
        if not 0.0 < self.volume < np.inf or not (np.asarray(self.inertia) > 0.0).all():
            raise ProblemError(f"volume and inertia of a polyhedron must be positive; {remedy}.")
        slack = FLATNESS * np.ptp(self.vertices, axis=0).max()
        for number, face in enumerate(self.faces):
            if not 0 <= min(face, default=-1) <= max(face) < len(self.vertices):
                raise ProblemError(f"face {number} of a polyhedron must name vertices 0 to {len(self.vertices) - 1}.")
            normal, height = self._plane(face)
            if not height > slack:
                raise ProblemError(
                    f"face {number} of a polyhedron is flat or inside out: its corners must run counter-clockwise seen "
                    f"from outside, around the centre of mass at the origin; {remedy}."
                )
            if (self.vertices @ normal).max() > height + slack:
                raise ProblemError(f"a polyhedron is not convex at its face {number}; divide the body, or {remedy}.")
        self._check_edges(remedy)

    def _check_edges(self, remedy: str) -> None:
        """Require that each edge of a face is, in the opposite direction, an edge of another face."""
        edges = Counter(edge for face in self.faces for edge in zip(face, (*face[1:], face[0]), strict=True))
        for (begin, end), count in edges.items():
            if count != 1 or edges[end, begin] != 1:
                raise ProblemError(
                    f"the edge from vertex {begin} to vertex {end} of a polyhedron must belong to two faces; {remedy}."
                )

    @cached_property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that contains the shape [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @cached_property
    def thickness(self) -> float:
        """Diameter of the largest sphere about the centre of mass inside the shape [m]."""
        return 2.0 * min(self._plane(face)[1] for face in self.faces)

    def _plane(self, face: tuple[int, ...]) -> tuple[FloatArray, float]:
        """Return the unit normal of a face, NaN if it is flat, and its height above the centre of mass [m]."""
        corners = self.vertices[list(face)]
        area = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        normal = area / np.linalg.norm(area) if area.any() else np.full(3, np.nan)
        return normal, float(corners.mean(axis=0) @ normal)


def convex_polyhedron(points: ArrayLike) -> tuple[Polyhedron, FloatArray]:
    """Return a homogeneous convex polyhedron and the pose at which its corners are the given points.

    Args:
        points: corners [m], shape (n, 3), in any order.

    Returns:
        The polyhedron, and (centre of mass [m], quaternion), shape (7,).

    Raises:
        ProblemError: if there are fewer than four points, they lie in one plane, a point is not finite or not a corner
            of the hull, a face is nearer to the centre of mass than ``FLATNESS`` times the size, or there are more
            than ``MAX_FACES`` faces or ``MAX_CORNERS`` corners of a face.
    """
    from scipy.spatial import ConvexHull, QhullError  # import takes 0.2 s
    from scipy.spatial.transform import Rotation

    corners = _finite_points(points)
    try:
        hull = ConvexHull(corners)
    except QhullError:
        raise ProblemError("the points of a polyhedron lie in one plane; give it a thickness.") from None
    inside = np.setdiff1d(np.arange(len(corners)), hull.vertices)
    if len(inside):
        raise ProblemError(
            f"point {inside[0]} of a polyhedron is not a corner of the convex hull; omit it, or divide the body."
        )
    faces = _merged_faces(corners, hull)
    if len(faces) > MAX_FACES or max(map(len, faces)) > MAX_CORNERS:
        raise ProblemError(f"a polyhedron has at most {MAX_FACES} faces of at most {MAX_CORNERS} corners each.")
    volume, centre, inertia = _mass_properties(corners, faces)
    height, size = -float((hull.equations @ [*centre, 1.0]).max()), float(np.ptp(corners, axis=0).max())
    if not height > FLATNESS * size:
        raise ProblemError(
            f"a polyhedron is too thin: a face is {height:.3g} m from its centre of mass; this distance must exceed "
            f"{FLATNESS * size:.3g} m; make the polyhedron thicker, or use a Box."
        )
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    x, y, z, w = Rotation.from_matrix(axes).as_quat()
    return Polyhedron((corners - centre) @ axes, faces, volume, moments), np.array([*centre, w, x, y, z])


def _finite_points(points: ArrayLike) -> FloatArray:
    """Return points as an array of shape (n, 3), n ≥ 4.

    Raises:
        ProblemError: if the points do not form such an array, or a point is not finite.
    """
    requirement = "a polyhedron needs at least 4 points (x, y, z)"
    try:
        corners = np.array(points, dtype=np.float64)
    except (TypeError, ValueError):
        raise ProblemError(f"{requirement}, got rows of unequal lengths or values that are not numbers.") from None
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 4:
        raise ProblemError(f"{requirement}, got an array of shape {corners.shape}.")
    if not np.isfinite(corners).all():
        point = int(np.flatnonzero(~np.isfinite(corners).all(axis=1))[0])
        raise ProblemError(
            f"point {point} of a polyhedron is not finite: {tuple(corners[point].tolist())}; correct it."
        )
    return corners


def _merged_faces(corners: FloatArray, hull: "ConvexHull") -> tuple[tuple[int, ...], ...]:
    """Return the faces of a hull, with coplanar triangles merged, each counter-clockwise seen from outside."""
    size = np.ptp(corners, axis=0).max()
    scaled = hull.equations / np.array([1.0, 1.0, 1.0, size])
    faces: list[tuple[int, ...]] = []
    remaining = np.arange(len(scaled))
    while len(remaining):
        is_coplanar = np.abs(scaled[remaining] - scaled[remaining[0]]).max(axis=1) < DIRECTION_TOLERANCE
        normal = hull.equations[remaining[0], :3]
        faces.append(_ordered_corners(corners, np.unique(hull.simplices[remaining[is_coplanar]]), normal))
        remaining = remaining[~is_coplanar]
    return tuple(faces)


def _ordered_corners(corners: FloatArray, face: IntArray, normal: FloatArray) -> tuple[int, ...]:
    """Return the corners of a face in the order of their angles about its normal."""
    arms = corners[face] - corners[face].mean(axis=0)
    first = arms[0] / np.linalg.norm(arms[0])
    angles = np.arctan2(arms @ np.cross(normal, first), arms @ first)
    return tuple(face[np.argsort(angles)].tolist())


def _mass_properties(corners: FloatArray, faces: tuple[tuple[int, ...], ...]) -> tuple[float, FloatArray, FloatArray]:
    """Return volume, centre of mass and tensor of inertia about it, for a density of 1, as a sum over tetrahedra."""
    apex = corners.mean(axis=0)
    triangles = [(face[0], face[k], face[k + 1]) for face in faces for k in range(1, len(face) - 1)]
    edges = corners[np.array(triangles)] - apex  # of tetrahedra from the common apex
    volumes = np.linalg.det(edges) / 6.0
    volume = float(volumes.sum())
    centre = np.einsum("t,tij->j", volumes, edges) / (4.0 * volume)
    sums = edges.sum(axis=1)
    # ∫ x xᵀ over a tetrahedron at the origin is V/20 (Σ vᵢ vᵢᵀ + s sᵀ) with s = Σ vᵢ
    second = (np.einsum("t,tij,tik->jk", volumes, edges, edges) + np.einsum("t,tj,tk->jk", volumes, sums, sums)) / 20.0
    second -= volume * np.outer(centre, centre)
    inertia: FloatArray = np.trace(second) * np.eye(3) - second
    return volume, apex + centre, inertia
