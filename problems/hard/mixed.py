"""Cases that mix laws: fixed bounds, planar and spatial friction, remote partners, disconnected parts."""

import numpy as np
import scipy.sparse as sp

from ..contact.answer import Answer
from ..contact.laws import LawKind, Laws
from ..contact.problem import ContactProblem
from ..contact.transformations import in_units, united
from .degenerate import one_row
from .rods import pressing_rod
from .stacks import sliding_tower, stack
from .supports import block_on_supports, sticking_box


def tresca_joint() -> ContactProblem:
    """Return joints with dry friction a = 0.2 N s between unit masses, with c = 1, 0.1 and (3, 4) m/s.

    Λ = −0.2 (slip), −0.1 (stick), and −0.2 · (0.6, 0.8) (slip).
    """
    kind = [LawKind.PLANAR_FRICTION, LawKind.PLANAR_FRICTION, LawKind.SPATIAL_FRICTION]
    laws = Laws.in_order(kind, np.zeros(3), np.full(3, 0.2), np.full(3, -1))
    impulses = np.array([-0.2, -0.1, -0.12, -0.16])
    c = np.array([1.0, 0.1, 3.0, 4.0])
    answer = Answer(impulses=(impulses,), velocity=impulses + c)
    return ContactProblem.from_delassus(sp.eye_array(4), c, laws=laws, answer=answer)


def mixed_laws(copies: int = 1) -> ContactProblem:
    """Return six contacts of 1 to 3 rows and a joint with dry friction, ``copies`` times, with a chosen solution.

    Λ and ξ are chosen to be complementary (open, closed; stick, slip; at the bound a + μΛ_N), and c = ξ − G Λ. G has
    full rank and is nearly diagonal, so the solution is unique.
    """
    first_copy = np.array([-1, -1, -1, 2, -1, 4, -1, 6, -1, 8, -1])
    n, t, s = LawKind.UNILATERAL, LawKind.PLANAR_FRICTION, LawKind.SPATIAL_FRICTION
    kind = np.tile([n, n, n, t, n, t, n, s, n, s, t], copies)
    partner = np.concatenate([np.where(first_copy >= 0, first_copy + 11 * copy, -1) for copy in range(copies)])
    laws = Laws.in_order(kind, np.where(partner >= 0, 0.5, 0.0), np.where(kind != n, 0.1, 0.0), partner)
    impulses = np.tile([0.0, 1.0, 1.0, 0.6, 1.0, 0.2, 2.0, -0.66, 0.88, 1.0, 0.1, 0.2, -0.1], copies)
    velocity = np.tile([1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.5, -2.0, 0.0, 0.0, 0.0, 0.7], copies)
    n_rows = 13 * copies
    root = np.random.default_rng(2).normal(size=(n_rows, n_rows))
    delassus = np.eye(n_rows) + 0.02 * (root @ root.T) / n_rows
    answer = Answer(impulses=(impulses,), velocity=velocity)
    return ContactProblem.from_delassus(delassus, velocity - delassus @ impulses, laws=laws, answer=answer)


def remote_partner() -> ContactProblem:
    """Return a brake whose friction is bounded by the impulse of another contact: Λ = (1, 1, −0.5, 0.25), μ = 0.5.

    Two separate contacts close with Λ_N = 1 each. The second contact bounds the first planar friction law, which slips
    at 0.5. The first contact bounds the second friction law, which sticks with 0.25.
    """
    kind = np.repeat([LawKind.UNILATERAL, LawKind.PLANAR_FRICTION], 2)
    laws = Laws.in_order(kind, np.array([0.0, 0.0, 0.5, 0.5]), np.zeros(4), np.array([-1, -1, 1, 0]))
    impulses = np.array([1.0, 1.0, -0.5, 0.25])
    c = np.array([-1.0, -1.0, 1.5, -0.25])
    answer = Answer(impulses=(impulses,), velocity=impulses + c)
    return ContactProblem.from_delassus(np.eye(4), c, laws=laws, answer=answer)


def remote_brakes(n: int) -> ContactProblem:
    """Return ``n`` separate contacts that close with Λ_N = 1, 2 and 3 in turn, and ``n`` brakes.

    The spatial friction law k, μ = 0.5, is bounded by the impulse of the contact after contact k. Laws of even k slip
    with Λ_T = −0.5 Λ_N (0.6, 0.8), and the other laws stick with 0.25 Λ_N (0.6, 0.8).
    """
    kind = np.repeat([LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION], n)
    partner = np.concatenate([np.full(n, -1), np.roll(np.arange(n), -1)])
    laws = Laws.in_order(kind, np.repeat([0.0, 0.5], n), np.zeros(2 * n), partner)
    normal, direction = np.resize([1.0, 2.0, 3.0], n), np.array([0.6, 0.8])
    slips = np.arange(n) % 2 == 0
    tangent = np.where(slips, -0.5, 0.25) * np.roll(normal, -1)
    impulses = np.concatenate([normal, np.outer(tangent, direction).ravel()])
    velocity = np.concatenate([np.zeros(n), np.outer(np.where(slips, 1.0, 0.0), direction).ravel()])
    answer = Answer(impulses=(impulses,), velocity=velocity)
    return ContactProblem.from_delassus(sp.eye_array(3 * n), velocity - impulses, laws=laws, answer=answer)


def few_parts() -> ContactProblem:
    """Return an opening row, a jammed rod, joints and a remote partner as one problem."""
    return united([one_row(0.1), pressing_rod(2.0), tresca_joint(), remote_partner()])


def disconnected_twice() -> ContactProblem:
    """Return the disconnected parts twice, the second time a thousand times lighter."""
    return united([disconnected_parts(), in_units(disconnected_parts(), mass=1e3).problem])


def disconnected_parts() -> ContactProblem:
    """Return supports, a stack, a tower, a box, rods, joints and single rows as one uncoupled problem."""
    return united(
        [
            block_on_supports(8),
            stack(np.ones(10)),
            one_row(0.1),
            sliding_tower(np.ones(3)),
            tresca_joint(),
            pressing_rod(0.5),
            sticking_box(),
            one_row(-0.1),
            mixed_laws(),
        ]
    )
