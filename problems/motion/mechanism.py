"""Description of a mechanism: the bodies that hinge, slide or separate, from the velocities of their contacts."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..arrays import FloatArray
from ..contact.matrices.pieces import Pieces
from ..contact.problem import ContactProblem

REST_SHARE, FREE_REST_SHARE = 1e-3, 1e-6
"""Fractions of the largest sum of absolute terms in a contact velocity, and of the largest free velocity, below which a
contact counts as at rest."""

MAX_LISTED = 8
"""Largest number of pairs of bodies that a sentence lists."""

FIXED = -1
"""The number of a body that does not move."""


class Motion(StrEnum):
    """How two bodies in contact move relative to each other."""

    HINGES = "hinges"
    SLIDES = "slides"
    OPENS = "opens"


@dataclass(frozen=True)
class PairMotion:
    """Two bodies in contact that move relative to each other.

    Attributes:
        bodies: their numbers, ascending; the first is ``FIXED`` if only one of them can move.
        motion: their motion; a hinge if some of their contacts open and others stay at rest.
    """

    bodies: tuple[int, int]
    motion: Motion


def contact_motions(problem: ContactProblem, velocity: FloatArray) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which contacts slide and which open at the velocity u, shape (n_contacts,) each; joints do neither.

    A contact slides if it opens no faster than by sliding in the associated model, γ_N ≤ μ ‖γ_T‖.
    """
    layout = problem.layout
    assert problem.factors is not None
    directions = problem.factors.force_directions
    lanes = layout.pad(directions.T @ velocity)
    normal, tangential = lanes[:, 0], np.linalg.norm(lanes[:, 1 : 1 + layout.sliding], axis=1)
    is_contact = (layout.normal_law >= 0) & ~layout.is_bilateral
    rest = max(
        REST_SHARE * (abs(directions).T @ np.abs(velocity)).max(initial=0.0),
        FREE_REST_SHARE * np.abs(problem.free_velocity).max(initial=0.0),
    )
    opens = is_contact & (normal > layout.friction_coefficient * tangential + rest)
    return is_contact & ~opens & (tangential > rest), opens


def pair_motions(problem: ContactProblem, velocity: FloatArray) -> list[PairMotion]:
    """Return the pairs of bodies that move relative to each other at the velocity u, in the order of their numbers.

    Bodies are the chunks of W; a system without bodies has none.
    """
    pieces = _pieces_of_bodies(problem)
    if pieces is None:
        return []
    slides, opens = contact_motions(problem, velocity)
    states: dict[tuple[int, int], list[tuple[bool, bool]]] = {}
    for contact in range(pieces.n_blocks):
        touched = sorted(set(pieces.chunks[pieces.starts[contact] : pieces.starts[contact + 1]].tolist()))
        moving = [body for body in touched if body < pieces.n_chunks]
        pair = (moving[0], moving[-1]) if len(moving) > 1 else (FIXED, moving[0])
        states.setdefault(pair, []).append((bool(slides[contact]), bool(opens[contact])))
    return [PairMotion(pair, motion) for pair, contacts in sorted(states.items()) if (motion := _motion(contacts))]


def _pieces_of_bodies(problem: ContactProblem) -> Pieces | None:
    """Return W with a chunk for each body, or None if the system has no bodies."""
    assert problem.factors is not None
    pieces = problem.factors.directions
    return pieces if isinstance(pieces, Pieces) and not pieces.n_chunks == 1 < pieces.length else None


def _motion(contacts: Sequence[tuple[bool, bool]]) -> Motion | None:
    """Return the motion of a pair from (slides, opens) of each of its contacts, None if all of them are at rest."""
    if any(slides for slides, _ in contacts):
        return Motion.SLIDES
    opening = sum(opens for _, opens in contacts)
    if opening == len(contacts):
        return Motion.OPENS
    return Motion.HINGES if opening else None


def free_bodies(problem: ContactProblem, velocity: FloatArray) -> list[int]:
    """Return the numbers of the bodies that move at the velocity u and have neither contacts nor joints, ascending."""
    pieces = _pieces_of_bodies(problem)
    if pieces is None:
        return []
    speeds = np.abs(velocity.reshape(pieces.n_chunks, -1)).max(axis=1)
    is_free = speeds > REST_SHARE * speeds.max()
    is_free[pieces.chunks[pieces.chunks < pieces.n_chunks]] = False
    return np.flatnonzero(is_free).tolist()


def mechanism_text(problem: ContactProblem, velocity: FloatArray) -> str:
    """Return a description of the motion with the velocity u, such as ``"hinges at fixed-0, 2-3, 4-5, fixed-6"``."""
    pairs = pair_motions(problem, velocity)
    parts = [f"{motion} at {_listed(names)}" for motion in Motion if (names := _names(pairs, motion))]
    bodies_without_contacts = free_bodies(problem, velocity)
    if bodies_without_contacts:
        parts.append(f"without contacts: {_listed([*map(str, bodies_without_contacts)])}")
    if parts:
        return "; ".join(parts)
    if not problem.n_contacts:
        return "no contact is closed"
    moving = zip(("slide", "open"), contact_motions(problem, velocity), strict=True)
    counts = [
        f"contacts that {verb}: {int(is_moving.sum())} of {problem.n_contacts}"
        for verb, is_moving in moving
        if is_moving.any()
    ]
    return "; ".join(counts) or "no contact slides or opens"


def _names(pairs: Sequence[PairMotion], motion: Motion) -> list[str]:
    return [
        "-".join("fixed" if body == FIXED else str(body) for body in pair.bodies)
        for pair in pairs
        if pair.motion is motion
    ]


def _listed(names: Sequence[str]) -> str:
    remainder = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return ", ".join(names[:MAX_LISTED]) + remainder
