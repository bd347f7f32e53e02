"""Contacts of one colour share no movable body, and the number of colours is bounded by the contacts of a body."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems.contact.matrices.pieces import Pieces
from proxbench.solvers.prox.parallel.colouring import MAX_FIRST_FIT, colour_contacts


def graph(seed: int, n_blocks: int, n_bodies: int, hub: bool = False) -> tuple[Pieces, np.ndarray]:
    """Return contacts of random bodies, a third of them with the ground; with a hub, each touches body 0."""
    rng = np.random.default_rng(seed)
    bodies = np.array([rng.choice(n_bodies, 2, replace=False) for _ in range(n_blocks)], dtype=np.int64).reshape(-1, 2)
    bodies[rng.random(n_blocks) < 0.3, 1] = n_bodies
    if hub:
        bodies[:, 0] = 0
        bodies[bodies[:, 1] == 0, 1] = n_bodies
    pieces = Pieces(2 * np.arange(n_blocks + 1), bodies.ravel(), np.zeros((2 * n_blocks, 3, 6)), n_bodies)
    return pieces, bodies


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n_blocks=st.integers(0, 150), n_bodies=st.integers(2, 60), hub=st.booleans())
def test_contacts_of_one_colour_share_no_body(seed: int, n_blocks: int, n_bodies: int, hub: bool) -> None:
    pieces, bodies = graph(seed, n_blocks, n_bodies, hub)
    colours, n_colours = colour_contacts(pieces)
    assert len(colours) == n_blocks
    assert n_colours == (colours.max() + 1 if n_blocks else 0)
    for colour in range(n_colours):
        touched = bodies[colours == colour].ravel()
        moved = touched[touched != n_bodies]
        assert len(set(moved.tolist())) == len(moved)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), n_blocks=st.integers(1, 150))
def test_first_fit_needs_fewer_colours_than_both_bodies_have_contacts(seed: int, n_blocks: int) -> None:
    pieces, bodies = graph(seed, n_blocks, 60)
    degree = np.bincount(bodies.ravel(), minlength=61)
    degree[60] = 0
    bound = degree[bodies].sum(axis=1).max()
    assert colour_contacts(pieces).n_colours <= min(bound, MAX_FIRST_FIT)


def test_a_body_of_many_contacts_needs_exactly_one_colour_for_each() -> None:
    pieces, _ = graph(1, 3 * MAX_FIRST_FIT, 50, hub=True)
    assert colour_contacts(pieces).n_colours == 3 * MAX_FIRST_FIT
