"""States that are kept, as the arrays of a result file.

state_times              of n states [s], shape (n,)
state_marks              whether each is marked, shape (n,)
state_positions, state_velocities    q and u of each, shapes (n, n_coordinates) and (n, n_dofs)
state_contacts           number of contacts of each, shape (n,)
state_keys, state_impulses           of all contacts, one state after the other
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.mechanics.state import State
from .thinning import Thinning


def kept_arrays(thinning: Thinning) -> dict[str, NDArray[Any]]:
    """Return what ``restore_kept`` reads."""
    kept = thinning.kept
    states = [one.state for one in kept]
    width = max(state.impulses.shape[1] for state in states)
    # states without contacts may have impulses of another width, and no number in them
    impulses = [state.impulses if len(state.keys) else np.zeros((0, width)) for state in states]
    return {
        "state_times": np.array([state.time for state in states]),
        "state_marks": np.array([one.is_marked for one in kept]),
        "state_positions": np.array([state.position for state in states]),
        "state_velocities": np.array([state.velocity for state in states]),
        "state_contacts": np.array([len(state.keys) for state in states], dtype=np.int64),
        "state_keys": np.concatenate([state.keys for state in states]),
        "state_impulses": np.concatenate(impulses),
    }


def restore_kept(thinning: Thinning, content: Mapping[str, NDArray[Any]], doublings: int, times: NDArray[Any]) -> None:
    """Put stored states into ``thinning``, which is new.

    Args:
        thinning: made of what the stored one was made of.
        content: the arrays of ``kept_arrays``.
        doublings: of the stored one.
        times: of all states that were offered after the first [s].

    Raises:
        KeyError, ValueError: if these are no states of the motion.
    """
    names = ("times", "marks", "positions", "velocities", "contacts", "keys", "impulses")
    time, marks, positions, velocities, contacts, keys, impulses = (content[f"state_{name}"] for name in names)
    start = thinning.states[0]
    shapes = {
        "times": (time, np.float64, time.shape[:1]),
        "marks": (marks, np.bool_, time.shape),
        "positions": (positions, np.float64, (*time.shape, *start.position.shape)),
        "velocities": (velocities, np.float64, (*time.shape, *start.velocity.shape)),
        "contacts": (contacts, np.int64, time.shape),
        "keys": (keys, np.int64, (int(contacts.sum()),)),
        "impulses": (impulses, np.float64, (len(keys), *impulses.shape[1:2])),
    }
    for name, (array, kind, shape) in shapes.items():
        if array.dtype != kind or array.shape != shape or (kind == np.float64 and not np.isfinite(array).all()):
            raise ValueError(f"the {name} of the states are none")
    known = np.array([start.time, *times])
    if not len(time) or time[0] != known[0] or time[-1] != known[-1] or not np.isin(time, known).all():
        raise ValueError("these are no states of the motion")
    if (contacts < 0).any() or (np.diff(time) <= 0.0).any() or doublings < 0:
        raise ValueError("these are no states that follow each other")
    borders = np.cumsum(contacts)[:-1]
    parts = zip(time, positions, velocities, np.split(keys, borders), np.split(impulses, borders), strict=True)
    states = [State(float(t), *arrays) for t, *arrays in parts]
    thinning.restore(states, marks.tolist(), doublings)
