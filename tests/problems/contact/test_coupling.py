"""Components and neighbourhoods of contacts, against scipy's graph search over the blocks of G."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, load
from proxbench.problems.contact.coupling import components, largest_around
from scipy.sparse.csgraph import connected_components


def blocks_of(problem: ContactProblem) -> np.ndarray:
    """Return which contacts are coupled, by G or by the bound of a friction law, shape (n_contacts, n_contacts)."""
    layout = problem.layout
    contact = layout.slot // layout.width
    coupled = np.eye(layout.n_blocks, dtype=bool)
    entries = problem.delassus().tocoo()
    coupled[contact[entries.row], contact[entries.col]] |= entries.data != 0.0
    coupled[np.arange(layout.n_blocks), layout.partner] = True
    return coupled | coupled.T


def sparse_bodies(seed: int) -> ContactProblem:
    """Frictional contacts, each of one or two bodies with 3 or 6 degrees of freedom."""
    rng = np.random.default_rng(seed)
    n_contacts, n_bodies, size = int(rng.integers(1, 12)), int(rng.integers(1, 10)), int(rng.choice([3, 6]))
    directions = np.zeros((n_bodies * size, 3 * n_contacts))
    for contact in range(n_contacts):
        for body in rng.choice(n_bodies, size=min(n_bodies, int(rng.integers(1, 3))), replace=False):
            directions[body * size : (body + 1) * size, 3 * contact : 3 * contact + 3] = rng.normal(size=(size, 3))
    root = rng.normal(size=(n_bodies, size, size))
    inverse_mass = sp.block_diag([one @ one.T + np.eye(size) for one in root])
    c = rng.normal(size=3 * n_contacts)
    return ContactProblem.from_factors(sp.csc_array(directions), inverse_mass, c, friction=0.3)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_both_forms_have_the_components_and_neighbourhoods_of_the_graph_of_g(seed: int) -> None:
    problem = sparse_bodies(seed)
    coupled = blocks_of(problem)
    _, expected = connected_components(sp.csr_array(coupled), directed=False)
    values = np.random.default_rng(seed).random(problem.n_contacts)
    around = np.where(coupled, values, 0.0).max(axis=1)
    of_matrix = ContactProblem.from_delassus(problem.delassus(), problem.free_velocity, laws=problem.laws)
    for form in (problem, of_matrix):
        assert np.array_equal(components(form), expected)
        assert np.array_equal(largest_around(form, values), around)


@pytest.mark.parametrize("name", ["funnel-100", "funnel-planar-30", "pile-100", "funnel-frictionless-30"])
def test_components_of_captured_steps_are_those_of_g(name: str) -> None:
    problem = load(name)
    _, expected = connected_components(sp.csr_array(blocks_of(problem)), directed=False)
    assert np.array_equal(components(problem), expected)


def test_friction_couples_its_contact_to_the_one_that_bounds_it() -> None:
    laws = Laws(
        np.array([0, 0, 1]), np.array([0, 1, 2]), np.array([0, 0, 0.5]), np.zeros(3), np.array([-1, -1, 0])
    )  # the friction law 2 follows law 1 and is bounded by law 0
    problem = ContactProblem.from_delassus(np.eye(3), -np.ones(3), laws=laws)
    component = components(problem)
    owner = problem.layout.slot // problem.layout.width
    assert component[owner[0]] == component[owner[2]] != component[owner[1]]
    assert largest_around(problem, np.array([3.0, 2.0, 1.0])[: problem.n_contacts]).max() == 3.0


def test_stored_zeros_of_the_delassus_matrix_couple_no_contacts() -> None:
    matrix = sp.csr_array((np.array([1.0, 0.0, 0.0, 1.0]), np.array([0, 1, 0, 1]), np.array([0, 2, 4])), shape=(2, 2))
    assert list(components(ContactProblem.from_delassus(matrix, -np.ones(2), dim=1))) == [0, 1]


def test_a_contact_and_the_one_that_bounds_its_friction_are_neighbours() -> None:
    """Of three contacts that G does not couple, the first bounds the friction of the third."""
    problem = load("hard-remote-partner")
    problem = ContactProblem.from_delassus(np.eye(problem.n_rows), -np.ones(problem.n_rows), laws=problem.laws)
    coupled = blocks_of(problem)
    assert coupled.sum() == problem.n_contacts + 2
    for values in np.eye(problem.n_contacts):
        assert np.array_equal(largest_around(problem, values), np.where(coupled, values, 0.0).max(axis=1))


@pytest.mark.parametrize(("entry", "is_coupled"), [(1e-19, True), (2e-28, True), (0.5e-28, False), (-2e-28, True)])
def test_contacts_of_very_different_masses_are_coupled_relative_to_both(entry: float, is_coupled: bool) -> None:
    """An entry g_ij counts against √(g_ii g_jj) = 1e-15, neither against g_ii = 1 nor against g_jj = 1e-30."""
    problem = ContactProblem.from_delassus(np.array([[1.0, entry], [entry, 1e-30]]), -np.ones(2), dim=1)
    assert list(components(problem)) == ([0, 0] if is_coupled else [0, 1])
    for values in (np.array([1.0, 2.0]), np.array([2.0, 1.0])):
        assert list(largest_around(problem, values)) == ([2.0, 2.0] if is_coupled else list(values))
