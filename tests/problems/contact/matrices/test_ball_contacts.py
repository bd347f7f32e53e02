"""Records of contacts between balls represent the same matrix as their pieces."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws
from proxbench.problems.contact.coupling import components
from proxbench.problems.contact.matrices.ball_contacts import BallContacts, BallNormals
from proxbench.problems.contact.matrices.factors import Factors, InverseMass
from proxbench.problems.contact.matrices.pieces import Pieces


def contacts_of_balls(seed: int, n_contacts: int, n_balls: int) -> BallContacts:
    """Contacts between two balls, or a ball and a surface, in any direction."""
    rng = np.random.default_rng(seed)
    chunks = np.array([rng.choice(n_balls, 2, replace=False) for _ in range(n_contacts)]).astype(np.int64)
    chunks[rng.random(n_contacts) < 0.3, 1] = n_balls
    normals = rng.normal(size=(n_contacts, 3))
    return BallContacts(chunks.ravel(), normals / np.linalg.norm(normals, axis=1)[:, None], rng.uniform(1, 2, n_balls))


def in_pieces(contacts: BallContacts) -> Pieces:
    """The same matrix without records."""
    return Pieces(contacts.starts, contacts.chunks, contacts.values, contacts.n_chunks)


shapes = given(seed=st.integers(0, 2**31), n_contacts=st.integers(1, 40), n_balls=st.integers(2, 30))


@settings(deadline=None)
@shapes
def test_products_and_diagonal_are_those_of_the_pieces(seed: int, n_contacts: int, n_balls: int) -> None:
    contacts = contacts_of_balls(seed, n_contacts, n_balls)
    pieces, rng = in_pieces(contacts), np.random.default_rng(seed)
    lanes, dofs = rng.normal(size=3 * n_contacts), rng.normal(size=6 * n_balls)
    inverse, restitution = rng.uniform(0.5, 2.0, 6 * n_balls), rng.uniform(size=3 * n_contacts)
    rebound = pieces.transposed_times(dofs) + restitution * pieces.transposed_times(2.0 * dofs + 1.0)
    assert contacts.free_velocity(dofs, 2.0 * dofs + 1.0, restitution) == pytest.approx(rebound, abs=1e-12)
    assert contacts.times(lanes) == pytest.approx(pieces.times(lanes), abs=1e-12)
    assert contacts.transposed_times(dofs) == pytest.approx(pieces.transposed_times(dofs), abs=1e-12)
    squares = pieces.scaled(np.sqrt(inverse)).square_sums().ravel()
    assert contacts.delassus_diagonal(inverse) == pytest.approx(squares, rel=1e-12)


@settings(deadline=None)
@shapes
def test_records_and_pieces_are_one_problem_with_equal_components(seed: int, n_contacts: int, n_balls: int) -> None:
    contacts, rng = contacts_of_balls(seed, n_contacts, n_balls), np.random.default_rng(seed)
    inverse, c = InverseMass.create(rng.uniform(0.5, 2.0, 6 * n_balls)), rng.normal(size=3 * n_contacts)
    laws = Laws.contacts(0.3, 3, n_contacts)
    first = ContactProblem(c, laws, factors=Factors(contacts, inverse))
    second = ContactProblem(c, laws, factors=Factors(in_pieces(contacts), inverse))
    assert first.digest == second.digest == first.fresh().digest
    assert np.array_equal(components(first), components(second))
    assert np.array_equal(first.delassus().toarray(), second.delassus().toarray())


def test_balls_that_touch_move_no_contact_when_they_roll_on_each_other() -> None:
    """Two gears: v = 0 and r_1 ω_1 = −r_2 ω_2 give γ = 0."""
    contacts = BallContacts(np.array([0, 1]), np.array([[0.6, 0.0, 0.8]]), np.array([2.0, 0.5]))
    spin = np.array([0.3, -0.7, 0.4])
    twists = np.concatenate([np.zeros(3), spin, np.zeros(3), -4.0 * spin])
    assert np.abs(contacts.transposed_times(twists)).max() <= 1e-15


def test_records_can_be_sent_to_another_process() -> None:
    contacts = contacts_of_balls(0, 5, 4)
    scaled = pickle.loads(pickle.dumps(contacts.scaled(np.full(24, 2.0))))
    assert np.array_equal(scaled.values, 2.0 * contacts.values)


@settings(deadline=None)
@shapes
def test_normals_are_the_first_lanes_of_the_pieces(seed: int, n_contacts: int, n_balls: int) -> None:
    contacts = contacts_of_balls(seed, n_contacts, n_balls)
    normals = BallNormals(contacts.chunks, contacts.normals, n_balls, 6)
    assert np.array_equal(normals.to_csc().toarray(), contacts.to_csc().toarray()[:, ::3])
    assert np.array_equal(normals.copy().values, normals.values)


def test_rows_of_balls_that_are_laws_of_their_own_are_blocks_of_their_own() -> None:
    """Three unilateral laws in place of a contact with friction: W has the same columns, in pieces of one lane."""
    contacts, rng = contacts_of_balls(4, 12, 8), np.random.default_rng(4)
    inverse, c, laws = InverseMass.create(rng.uniform(0.5, 2.0, 48)), rng.normal(size=36), Laws.contacts(0.0, 1, 36)
    first = ContactProblem(c, laws, factors=Factors(contacts, inverse))
    second = ContactProblem(c, laws, factors=Factors.create(contacts.to_csc(), inverse))
    assert np.array_equal(components(first), components(second))
    assert first.delassus_diagonal == pytest.approx(second.delassus_diagonal, rel=1e-12)
