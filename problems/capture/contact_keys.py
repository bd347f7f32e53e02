"""Persistent names of contacts across steps.

A number distinguishes contacts of one pair of geometries, as in ``"floor | box #2"``. In the next step, a contact takes
the number of the nearest previous contact of the pair. The distance is the smaller of those in the frames of the two
geometries, because the corner of a sliding box does not move in the frame of the box.
"""

from collections.abc import Sequence

import numpy as np

from ..arrays import FloatArray

NO_ANCHORS = np.zeros((0, 2, 3))
"""Anchors of a step without contacts."""


def distinct_keys(
    keys: Sequence[str], anchors: FloatArray, known: Sequence[str] = (), known_anchors: FloatArray = NO_ANCHORS
) -> tuple[str, ...]:
    """Return a distinct key for each contact of a step; the number 0 is omitted.

    Args:
        keys: key of the pair of each contact.
        anchors: point of each contact in the frames of its two geometries [m], shape (len(keys), 2, 3).
        known: distinct keys of the previous step.
        known_anchors: points of the contacts of the previous step [m], shape (len(known), 2, 3).
    """
    names = [""] * len(keys)
    known_of_pair: dict[str, list[int]] = {}
    for index, key in enumerate(known):
        known_of_pair.setdefault(pair_of(key), []).append(index)
    for key in dict.fromkeys(keys):
        contacts = [index for index, other in enumerate(keys) if other == key]
        candidates = known_of_pair.get(key, [])
        gaps = np.linalg.norm(anchors[contacts][:, None] - known_anchors[candidates][None], axis=-1).min(axis=-1)
        for flat in np.argsort(gaps, axis=None, kind="stable"):
            row, column = np.unravel_index(flat, gaps.shape)
            name = known[candidates[column]]
            if not names[contacts[row]] and name not in names:
                names[contacts[row]] = name
        unused_names = (name for number in range(len(contacts)) if (name := _numbered(key, number)) not in names)
        for index in contacts:
            names[index] = names[index] or next(unused_names)
    return tuple(names)


def pair_of(key: str) -> str:
    """Return the pair that a key names: the key without its number."""
    return key.rpartition(" #")[0] or key


def _numbered(key: str, number: int) -> str:
    return f"{key} #{number}" if number else key
