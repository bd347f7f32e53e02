"""Slabs of one colour share no movable body, and each contact has one lane of a batch of its slab."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems.contact.matrices.pieces import Pieces
from proxbench.solvers.prox.parallel.slabs import MIN_SLAB, OPEN_BATCHES, Slabs, divide_into_slabs
from proxbench.solvers.sweeps.batches.lanes import LANES


def graph(pairs: np.ndarray, n_bodies: int) -> Pieces:
    """Return contacts of given bodies, shape (n_contacts, 2); body ``n_bodies`` is the ground."""
    n_contacts = len(pairs)
    return Pieces(2 * np.arange(n_contacts + 1), pairs.ravel(), np.zeros((2 * n_contacts, 3, 6)), n_bodies)


def neighbouring(seed: int, n_contacts: int, n_bodies: int, reach: int) -> np.ndarray:
    """Return contacts of bodies whose numbers differ by at most ``reach``, shuffled; a third are with the ground."""
    rng = np.random.default_rng(seed)
    first = rng.integers(n_bodies, size=n_contacts)
    second = (first + rng.integers(1, reach + 1, size=n_contacts)) % n_bodies
    second[(rng.random(n_contacts) < 0.3) | (second == first)] = n_bodies
    return np.append(rng.permutation(n_bodies), n_bodies)[np.stack([first, second], axis=1)]


def slab_of_contacts(slabs: Slabs) -> np.ndarray:
    return np.searchsorted(slabs.first_batch, slabs.positions // LANES, side="right") - 1


def bodies_by_colour(slabs: Slabs, pairs: np.ndarray, n_bodies: int) -> list[list[set[int]]]:
    """Return the movable bodies of each slab of each colour."""
    of_contact = slab_of_contacts(slabs)
    touched = [set(pairs[of_contact == slab].ravel().tolist()) - {n_bodies} for slab in range(slabs.first_slab[2])]
    return [touched[: slabs.first_slab[1]], touched[slabs.first_slab[1] :]]


contacts = given(
    seed=st.integers(0, 2**31),
    n_contacts=st.integers(0, 900),
    n_bodies=st.integers(2, 300),
    reach=st.sampled_from([1, 3, 20, 300]),
)


@settings(max_examples=60, deadline=None)
@contacts
def test_slabs_of_one_colour_share_no_body(seed: int, n_contacts: int, n_bodies: int, reach: int) -> None:
    pairs = neighbouring(seed, n_contacts, n_bodies, reach)
    slabs = divide_into_slabs(graph(pairs, n_bodies))
    for touched in bodies_by_colour(slabs, pairs, n_bodies):
        assert sum(map(len, touched)) == len(set().union(*touched))


@settings(max_examples=60, deadline=None)
@contacts
def test_each_contact_has_its_own_lane_and_contacts_of_a_batch_share_no_body(
    seed: int, n_contacts: int, n_bodies: int, reach: int
) -> None:
    pairs = neighbouring(seed, n_contacts, n_bodies, reach)
    slabs = divide_into_slabs(graph(pairs, n_bodies))
    assert len(set(slabs.positions.tolist())) == n_contacts
    for batch in range(slabs.n_batches):
        moved = [body for body in pairs[slabs.positions // LANES == batch].ravel().tolist() if body != n_bodies]
        assert len(set(moved)) == len(moved)


@settings(max_examples=60, deadline=None)
@contacts
@pytest.mark.parametrize("has_hub", [False, True])
def test_each_contact_is_in_the_first_open_batch_that_can_take_it(
    has_hub: bool, seed: int, n_contacts: int, n_bodies: int, reach: int
) -> None:
    """Earlier batches of the same window of a slab are full, or touch one of its bodies. A hub touches most bodies."""
    pairs = neighbouring(seed, n_contacts, n_bodies, reach)
    if has_hub:
        pairs[(np.arange(n_contacts) % 2 == 0) & (pairs[:, 0] != 0), 1] = 0
    slabs = divide_into_slabs(graph(pairs, n_bodies))
    of_batch = [pairs[slabs.positions // LANES == batch] for batch in range(slabs.n_batches)]
    bodies = [set(members.ravel().tolist()) - {n_bodies} for members in of_batch]
    for batch, members in enumerate(of_batch):
        first = slabs.first_batch[np.searchsorted(slabs.first_batch, batch, side="right") - 1]
        window = range(batch - (batch - first) % OPEN_BATCHES, batch)
        for pair in members:
            assert all(len(of_batch[k]) == LANES or bodies[k] & set(pair.tolist()) for k in window)


@settings(max_examples=60, deadline=None)
@contacts
def test_bodies_without_contacts_are_left_out_of_the_numbering(
    seed: int, n_contacts: int, n_bodies: int, reach: int
) -> None:
    pairs = neighbouring(seed, n_contacts, n_bodies, reach)
    slabs = divide_into_slabs(graph(pairs, n_bodies))
    assert sorted(slabs.bodies.tolist()) == sorted(set(pairs.ravel().tolist()) - {n_bodies})
    assert np.array_equal(np.append(slabs.bodies, n_bodies)[slabs.chunks], pairs.ravel())


@pytest.mark.parametrize("shuffles", [False, True])
def test_a_chain_is_cut_into_slabs_of_the_least_size(shuffles: bool) -> None:
    """Each level of a chain has one body, whichever contact is the first one."""
    n_contacts = 10 * MIN_SLAB
    pairs = np.stack([np.arange(n_contacts), np.arange(n_contacts) + 1], axis=1)
    if shuffles:
        pairs = np.random.default_rng(4).permutation(pairs)
    slabs = divide_into_slabs(graph(pairs, n_contacts + 1))
    assert np.array_equal(np.bincount(slab_of_contacts(slabs)), np.full(10, MIN_SLAB))
    assert slabs.first_slab.tolist() == [0, 5, 10]


def test_a_body_that_touches_all_others_leaves_one_slab() -> None:
    """All its contacts belong to neighbouring levels, so that no two of them may be updated at the same time."""
    n_bodies = 5 * MIN_SLAB
    pairs = np.stack([np.zeros(n_bodies - 1, dtype=np.int64), np.arange(1, n_bodies)], axis=1)
    slabs = divide_into_slabs(graph(pairs, n_bodies))
    assert slabs.n_batches == n_bodies - 1  # one contact a batch
    assert slabs.first_slab[1] == 1


def test_batches_of_a_lattice_are_nearly_full() -> None:
    """A cubic lattice of balls has three contacts per ball, as many as packings of balls without friction."""
    size = 16
    numbers = np.arange(size**3).reshape(size, size, size)
    shifted = [
        np.stack([numbers.take(range(size - 1), k).ravel(), numbers.take(range(1, size), k).ravel()], axis=1)
        for k in range(3)
    ]
    pairs = np.random.default_rng(0).permutation(np.concatenate(shifted))
    slabs = divide_into_slabs(graph(pairs, size**3))
    assert len(pairs) / (LANES * slabs.n_batches) > 0.9
    sizes = np.bincount(slab_of_contacts(slabs))
    assert sizes.max() < 0.1 * len(pairs)
