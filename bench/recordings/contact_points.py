"""Positions and directions of contacts, which a contact problem does not contain.

They are reconstructed from the factors. The force directions of a rigid body contain the axes e of each contact and the
moments a × e, which determine the arm a from the body's centre to the contact. Two bodies in contact share a point,
x_i + a_i = x_j + a_j. These equations determine the relative positions of all bodies in a connected heap. Separate
heaps are drawn side by side. Contacts of other problems are drawn on a grid, with normals upwards.

A body is a ball if its arms have the same length and are parallel to the normals, and its moment of inertia is at most
that of a uniform ball of that radius. Only the centre and the arms of other bodies are known.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.matrices.pieces import Pieces, cut_into_pieces
from ...problems.contact.problem import ContactProblem
from ..errors import BenchError
from ..report.layout.text import counted
from .bodies.meshes import in_space

RIGID_TOLERANCE = 1e-9
"""Largest error of the inner products of axes, and relative error of the moments a × e, of a rigid body."""

RIGID_SHAPES = {(3, 6): (3, 3), (3, 3): (3, 0), (1, 3): (3, 0), (2, 3): (2, 1), (2, 2): (2, 0), (1, 2): (2, 0)}
"""(dimension, rotational degrees of freedom) of a body, by (rows of a contact, degrees of freedom)."""

UNIFORM_INERTIA = {3: 2.0 / 5.0, 2: 1.0 / 2.0}
"""Moment of inertia over m r² of a uniform ball and a uniform disc, by the dimension."""

BALL_TOLERANCE = 1e-6
"""Largest relative error of the arms and moments of inertia of a ball."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """The bodies that have contacts, as reconstructed from the factors.

    Attributes:
        centres: centres [m], shape (n_bodies, 3).
        radii: radii of balls [m], NaN for other bodies, shape (n_bodies,).
        arms: centre and contact, for each contact of each body that is not a ball [m], shape (n_arms, 2, 3).
    """

    centres: FloatArray
    radii: FloatArray
    arms: FloatArray

    @property
    def is_ball(self) -> NDArray[np.bool_]:
        """Whether each body is a ball or a disc, shape (n_bodies,)."""
        return ~np.isnan(self.radii)

    @property
    def sentence(self) -> str:
        """A sentence about how the bodies are drawn."""
        balls = int(self.is_ball.sum())
        others = len(self.radii) - balls
        ball_text = counted(balls, "ball") + ", with radii from the force directions"
        dot_text = f"{counted(others, 'body', 'bodies')} of unknown shape as dots joined to their contacts"
        return "Drawn: " + " and ".join([ball_text] * (balls > 0) + [dot_text] * (others > 0)) + "."


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Points of the contacts of a problem, in space (x, y, z), z upwards; planar problems lie in the plane y = 0.

    Attributes:
        positions: positions of the contacts [m], shape (n_contacts, 3).
        frames: axes N, T1, T2 of each contact as rows, shape (n_contacts, 3, 3); zero for missing directions.
        size: median distance from a body to its contact, or spacing of the grid [m]; it scales arrows.
        origin: a sentence about how the points were determined.
        bodies: the bodies in contact; None if they are unknown.

    Raises:
        BenchError: if the shapes are inconsistent.
    """

    positions: FloatArray
    frames: FloatArray
    size: float
    origin: str
    bodies: Bodies | None = None

    def __post_init__(self) -> None:
        n = len(self.positions)
        if self.positions.shape != (n, 3) or self.frames.shape != (n, 3, 3):
            raise BenchError(
                "contact points need positions of shape (n_contacts, 3) and frames of shape (n_contacts, 3, 3), "
                f"got {self.positions.shape} and {self.frames.shape}."
            )

    def vectors(self, lanes: FloatArray) -> FloatArray:
        """Return impulses as vectors in space [N s], shape (n_contacts, 3), from Λ padded to (n_contacts, width)."""
        vectors: FloatArray = np.einsum("cl,clx->cx", lanes, self.frames[:, : lanes.shape[1]])
        return vectors


def find_contact_points(problem: ContactProblem) -> ContactPoints:
    """Return the contact points of a problem: from its factors if they describe rigid bodies, else on a grid."""
    return _from_factors(problem) or grid_contact_points(problem.n_contacts)


def grid_contact_points(n_contacts: int) -> ContactPoints:
    """Return contacts on a square grid of spacing 1, in the order of the problem, with normals upwards."""
    side = max(1, int(np.ceil(np.sqrt(n_contacts))))
    index = np.arange(n_contacts)
    positions = np.column_stack([index % side, index // side, np.zeros(n_contacts)]).astype(np.float64)
    frame = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    text = (
        "The problem does not contain the positions of its contacts: they are drawn on a grid, in the order of the "
        "problem, with normals upwards. Its bodies are unknown and not drawn."
    )
    return ContactPoints(positions, np.tile(frame, (n_contacts, 1, 1)), 1.0, text)


def _from_factors(problem: ContactProblem) -> ContactPoints | None:
    """Return the points computed from the factors; None if the factors do not describe rigid bodies."""
    if problem.factors is None or not problem.layout.is_dense or not problem.n_contacts:
        return None
    directions = problem.factors.force_directions
    pieces = cut_into_pieces(directions, np.ones(directions.shape[0]), problem.layout)
    pairs = _bodies_in_contact(pieces)
    rigid = None if pairs is None else _axes_and_arms(pairs[1], pairs[0] < pieces.n_chunks)
    if pairs is None or rigid is None:
        return None
    bodies, (axes, arms) = pairs[0], rigid
    size = float(np.median(np.linalg.norm(arms[:, 0], axis=1))) or 1.0
    centres = _centres(bodies, arms, pieces.n_chunks, size)
    positions = centres[bodies[:, 0]] + arms[:, 0]
    frames = np.pad(axes, ((0, 0), (0, 3 - pieces.width), (0, 0)))
    smallest_radii = _smallest_ball_radii(problem, *RIGID_SHAPES[pieces.width, pieces.length])
    reconstructed = _reconstruct_bodies(bodies, axes[:, 0], arms, centres, smallest_radii)
    text = "Positions and directions are computed from the force directions; separate heaps are drawn side by side."
    return ContactPoints(positions, frames, size, f"{text} {reconstructed.sentence}", reconstructed)


def _reconstruct_bodies(
    pairs: IntArray, normals: FloatArray, arms: FloatArray, centres: FloatArray, smallest_radii: FloatArray
) -> Bodies:
    """Return the bodies in contact.

    A body is a ball if its arms fit a ball whose radius is at least that of ``smallest_radii`` [m], shape (n_bodies,).
    """
    n_bodies = len(centres)
    contact, side = np.nonzero(pairs < n_bodies)
    body, arm = pairs[contact, side], arms[contact, side]
    outwards = np.where(side == 0, -1.0, 1.0)[:, None] * normals[contact]
    radius = np.full(n_bodies, np.inf)
    np.minimum.at(radius, body, np.einsum("cx,cx->c", arm, outwards))
    is_ball = (radius > 0.0) & (smallest_radii <= (1.0 + BALL_TOLERANCE) * radius)
    fits = np.linalg.norm(arm - radius[body, None] * outwards, axis=1) <= BALL_TOLERANCE * radius[body]
    is_ball[body[~fits]] = False
    ends = np.stack([centres[body], centres[body] + arm], axis=1)[~is_ball[body]]
    present = np.unique(body)
    return Bodies(centres[present], np.where(is_ball, radius, np.nan)[present], ends)


def _smallest_ball_radii(problem: ContactProblem, dimension: int, n_rotations: int) -> FloatArray:
    """Return the smallest radius r [m] at which each body can be a ball: θ = 2/5 m r² in space.

    The radius is infinite for bodies without rotations, and for bodies whose mass matrix does not consist of blocks
    m I and θ I.
    """
    assert problem.factors is not None
    inverse, length = problem.factors.inverse_mass.matrix, dimension + n_rotations
    n_bodies = problem.factors.n_dofs // length
    if not n_rotations:
        return np.full(n_bodies, np.inf)
    diagonal = np.asarray(inverse.diagonal()).reshape(n_bodies, length)
    linear, angular = diagonal[:, :dimension], diagonal[:, dimension:]
    radii: FloatArray = np.sqrt(linear[:, 0] / (UNIFORM_INERTIA[dimension] * angular[:, 0]))
    for part in (linear, angular):
        radii[np.ptp(part, axis=1) > BALL_TOLERANCE * part[:, 0]] = np.inf
    entries = sp.coo_array(inverse)
    radii[entries.row[(entries.row != entries.col) & (entries.data != 0.0)] // length] = np.inf
    return radii


def _bodies_in_contact(pieces: Pieces) -> tuple[IntArray, FloatArray] | None:
    """Return both bodies of each contact (n_chunks for none) and their pieces.

    Return None if a contact has more than two bodies, or no first body.
    """
    if pieces.in_pairs:
        bodies, values = pieces.chunks.reshape(-1, 2), pieces.values.reshape(-1, 2, pieces.width, pieces.length)
    elif (np.diff(pieces.starts) == 1).all():
        no_body = np.full(pieces.n_blocks, pieces.n_chunks)
        bodies = np.column_stack([pieces.chunks, no_body])
        values = np.stack([pieces.values, np.zeros_like(pieces.values)], axis=1)
    else:
        return None
    if (bodies[:, 0] == pieces.n_chunks).any():
        return None
    return bodies, values


def _axes_and_arms(values: FloatArray, has_body: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray] | None:
    """Return axes of contacts, shape (n, width, 3), and arms [m], shape (n, 2, 3); None unless the bodies are rigid.

    Args:
        values: pieces of both bodies of each contact, shape (n, 2, width, length).
        has_body: whether a contact has a first and a second body, shape (n, 2).
    """
    width, length = values.shape[2:]
    if (width, length) not in RIGID_SHAPES:
        return None
    dimension, _ = RIGID_SHAPES[width, length]
    linear, moments = values[..., :dimension], values[..., dimension:]
    gram = np.einsum("cplx,cpmx->cplm", linear, linear)[has_body]
    opposed = (linear[:, 0] + linear[:, 1])[has_body[:, 1]]
    if max(np.abs(gram - np.eye(width)).max(), np.abs(opposed).max(initial=0.0)) > RIGID_TOLERANCE:
        return None
    spatial = in_space(linear)
    if width == 1:  # no friction, no rotation: equal balls of unknown radius, drawn with radius 1
        return spatial[:, 0], -spatial[:, :, 0] * has_body[..., None]
    if not moments.size:
        return spatial[:, 0], np.zeros((len(values), 2, 3))
    spatial_moments = moments if dimension == 3 else -moments * np.array([0.0, 1.0, 0.0])
    # for orthonormal e and m = a × e, Σ e × m = Σ (a − e (e·a)) is 2a with three axes, and a with two
    arms: FloatArray = np.cross(spatial, spatial_moments).sum(axis=2) / (width - 1)
    if np.abs(np.cross(arms[:, :, None], spatial) - spatial_moments).max() > RIGID_TOLERANCE * max(
        1.0, np.abs(arms).max()
    ):
        return None
    return spatial[:, 0], arms


def _centres(bodies: IntArray, arms: FloatArray, n_bodies: int, size: float) -> FloatArray:
    """Return the centres of the bodies, shape (n_bodies, 3), computed for each heap by least squares."""
    paired = np.flatnonzero(bodies[:, 1] < n_bodies)
    first, second = bodies[paired, 0], bodies[paired, 1]
    count = len(paired)
    indices = (np.concatenate([first, second]), np.tile(np.arange(count), 2))
    incidence: Any = sp.csr_array(
        sp.coo_array((np.concatenate([np.ones(count), -np.ones(count)]), indices), shape=(n_bodies, count))
    )
    offsets = arms[paired, 1] - arms[paired, 0]
    laplacian = sp.csc_array(incidence @ incidence.T)
    _, heap = connected_components(laplacian, directed=False)
    anchors = np.zeros(n_bodies)
    anchors[np.unique(heap, return_index=True)[1]] = 1.0  # fix one body of each heap; otherwise the matrix is singular
    solved = spsolve(sp.csc_array(laplacian + sp.diags_array(anchors)), incidence @ offsets)
    return _side_by_side(np.asarray(solved).reshape(n_bodies, 3), heap.astype(np.int64), bodies[:, 0], size)


def _side_by_side(centres: FloatArray, heap: IntArray, bodies_in_contact: IntArray, size: float) -> FloatArray:
    """Return the centres with the largest heap at the origin, and the other heaps that have contacts to its right.

    The other heaps form columns as deep as the largest heap, on the same floor.
    """
    in_contact = np.unique(heap[bodies_in_contact])
    order = in_contact[np.argsort(-np.bincount(heap)[in_contact], kind="stable")]
    gap = 3.0 * size
    edge = floor = depth = along = across = 0.0
    for rank, number in enumerate(order):
        members = heap == number
        low, extent = centres[members].min(axis=0), np.ptp(centres[members], axis=0)
        if rank == 0:
            centres[members] -= low + extent / 2.0
            edge, depth, floor = extent * (0.5, 0.5, -0.5) + (gap, 0.0, 0.0)
            along = -depth
            continue
        if along > depth:
            edge, along, across = edge + across + gap, -depth, 0.0
        centres[members] += np.array([edge, along, floor]) - low
        along += extent[1] + gap
        across = max(across, extent[0])
    return centres
