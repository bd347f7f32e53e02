"""Selection of the states that a result file keeps, evenly spaced in time although the duration is unknown.

Time is divided into cells of 2^k base spacings, and the first state in each cell is kept. If there are more than 2N
states, k grows by one: pairs of cells are merged, and the first state of each pair is kept. The selection depends only
on the states, not on interruptions of the simulation. Marked states are kept in addition.

A result file contains the arrays

state_times              times of n states [s], shape (n,)
state_marks              whether each is marked, shape (n,)
state_positions, state_velocities    q and u of each, shapes (n, n_coordinates) and (n, n_dofs)
state_contacts           number of contacts of each, shape (n,)
state_keys, state_impulses           keys and impulses of all contacts, one state after the other
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.motion.state import State

DEFAULT_STATES = 500
"""Default of N."""


@dataclass(frozen=True, eq=False)
class KeptState:
    """A state that is kept.

    Attributes:
        state: the state.
        cell: index of its base spacing, from 0.
        is_marked: whether to keep it even if it is not the first state of its cell.
    """

    state: State
    cell: int
    is_marked: bool = False


class KeptStates:
    """Select states to keep from states that arrive in the order of time.

    With steps as long as the base spacing, every 2^k-th state is kept. With steps of at most a third of the current
    spacing, the intervals between kept states differ by at most a factor of two.

    Args:
        number: N, at least 1. At most 2N states are kept, including the last one and excluding marked ones. At least N
            are kept if states were offered in more than N cells.
        start: the first state, which is always kept.
        spacing: base spacing [s].
    """

    def __init__(self, number: int, start: State, spacing: float) -> None:
        self._max_cells = 2 * number - 1
        self._begin, self._spacing = start.time, spacing
        self._last = start
        self._set_kept(0, [KeptState(start, 0)])

    @property
    def doublings(self) -> int:
        """k, the number of doublings of the spacing."""
        return self._kept_states[0]

    @property
    def kept(self) -> list[KeptState]:
        """The kept states and the last offered one, in the order of time."""
        kept = self._kept_states[1]
        if kept[-1].state.time >= self._last.time:
            return list(kept)
        return [*kept, self._in_cell(self._last)]

    @property
    def states(self) -> list[State]:
        """The kept states without cells and marks."""
        return [kept.state for kept in self.kept]

    def offer(self, state: State, is_marked: bool = False) -> None:
        """Offer the next state; the last one may be offered again to mark it."""
        doublings, kept = self._kept_states
        self._last = state
        if state.time <= kept[-1].state.time:
            kept[-1] = replace(kept[-1], is_marked=kept[-1].is_marked or is_marked)
            return
        new = self._in_cell(state, is_marked)
        is_first = new.cell >> doublings > kept[-1].cell >> doublings
        if is_first or is_marked:
            kept.append(new)
        self._n_cells += is_first
        while self._n_cells > self._max_cells:
            doublings += 1
            kept = _thinned(kept, doublings)
            self._set_kept(doublings, kept)

    def restore(self, states: Sequence[State], marks: Sequence[bool], doublings: int) -> None:
        """Replace all kept states by those of another object with the same arguments."""
        self._last = states[-1]
        kept = [self._in_cell(state, is_marked) for state, is_marked in zip(states, marks, strict=True)]
        self._set_kept(doublings, _thinned(kept, doublings))

    def _set_kept(self, doublings: int, kept: list[KeptState]) -> None:
        self._kept_states = (doublings, kept)
        self._n_cells = len({kept_state.cell >> doublings for kept_state in kept})

    def _in_cell(self, state: State, is_marked: bool = False) -> KeptState:
        return KeptState(state, math.floor((state.time - self._begin) / self._spacing + 0.5), is_marked)


def _thinned(kept: Sequence[KeptState], doublings: int) -> list[KeptState]:
    """Return the first state of each cell of 2^doublings base spacings, and the marked ones."""
    is_kept = [
        current.is_marked or previous.cell >> doublings < current.cell >> doublings
        for previous, current in pairwise(kept)
    ]
    return [kept[0], *compress(kept[1:], is_kept)]


def kept_arrays(kept_states: KeptStates) -> dict[str, NDArray[Any]]:
    """Return the arrays for ``restore_kept``."""
    kept = kept_states.kept
    states = [kept_state.state for kept_state in kept]
    width = max(state.impulses.shape[1] for state in states)
    # states without contacts may have empty impulses of another width
    impulses = [state.impulses if len(state.keys) else np.zeros((0, width)) for state in states]
    return {
        "state_times": np.array([state.time for state in states]),
        "state_marks": np.array([kept_state.is_marked for kept_state in kept]),
        "state_positions": np.array([state.position for state in states]),
        "state_velocities": np.array([state.velocity for state in states]),
        "state_contacts": np.array([len(state.keys) for state in states], dtype=np.int64),
        "state_keys": np.concatenate([state.keys for state in states]),
        "state_impulses": np.concatenate(impulses),
    }


def restore_kept(
    kept_states: KeptStates, content: Mapping[str, NDArray[Any]], doublings: int, times: NDArray[Any]
) -> None:
    """Restore stored states into ``kept_states``.

    Args:
        kept_states: a new object, created with the arguments of the stored one.
        content: the arrays of ``kept_arrays``.
        doublings: number of doublings of the stored object.
        times: times of all states that were offered after the first [s].

    Raises:
        KeyError, ValueError: if an array is missing or malformed, or if the states do not belong to the motion.
    """
    names = ("times", "marks", "positions", "velocities", "contacts", "keys", "impulses")
    time, marks, positions, velocities, contacts, keys, impulses = (content[f"state_{name}"] for name in names)
    start = kept_states.states[0]
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
            raise ValueError(f"the {name} of the kept states have a wrong shape or type, or are not finite")
    all_times = np.array([start.time, *times])
    if not len(time) or time[0] != all_times[0] or time[-1] != all_times[-1] or not np.isin(time, all_times).all():
        raise ValueError("the kept states are not states of the motion")
    if (contacts < 0).any() or (np.diff(time) <= 0.0).any() or doublings < 0:
        raise ValueError("the times of the kept states do not increase, or a count is negative")
    borders = np.cumsum(contacts)[:-1]
    parts = zip(time, positions, velocities, np.split(keys, borders), np.split(impulses, borders), strict=True)
    states = [State(float(t), *arrays) for t, *arrays in parts]
    kept_states.restore(states, marks.tolist(), doublings)
