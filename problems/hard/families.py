"""Random problems with a chosen solution, of any rank, mass ratio, sparsity and friction.

Λ and ξ are random and complementary, law by law (open, sticking, sliding, and the boundaries between them), W and M⁻¹
are random, and c = ξ − Wᵀ M⁻¹ W Λ. All numbers are short binary fractions (M⁻¹ powers of two, sliding along (3, 4)/5).
So c has no rounding error, and the chosen solution solves the stored problem exactly at any condition number.

Without friction ξ is unique, since G is symmetric and positive semidefinite. With friction there may be other
solutions, unless normal impulses alone carry the load (see ``random_braced_problem``).
"""

from dataclasses import dataclass

import numpy as np

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.laws import Laws
from ..contact.problem import ContactProblem

STATES = ("open", "stick", "slip", "graze", "edge")
"""States of a contact: open, sticking, sliding; Λ = 0 with ξ_N = 0; and Λ_T at its bound with ξ_T = 0."""

MAX_MASS_EXPONENT = 12
"""Largest exponent of masses, from 2⁻¹² to 2¹² kg, with which c has no rounding error."""


@dataclass(frozen=True)
class Family:
    """The parameters of a random problem.

    Attributes:
        n_contacts: number of contacts.
        dim: rows per contact, 1, 2 or 3.
        n_dofs: degrees of freedom, the largest rank that G can have.
        mass_exponent: largest exponent of masses, powers of two from 2^−mass_exponent to 2^mass_exponent kg; at most
            ``MAX_MASS_EXPONENT``.
        density: fraction of nonzero entries of W; every column has at least one.
        friction: μ of all contacts, a multiple of 1/8.
        states: the states that contacts may have, a subset of ``STATES``.
    """

    n_contacts: int
    dim: int = 3
    n_dofs: int = 30
    mass_exponent: int = 0
    density: float = 1.0
    friction: float = 0.5
    states: tuple[str, ...] = STATES


def random_problem(family: Family, seed: int) -> ContactProblem:
    """Return a random problem of ``family`` with a known solution."""
    rng = np.random.default_rng(seed)
    directions, inverse_mass = _factors(family, rng, family.n_contacts * family.dim)
    impulses, velocity = _complementary(family, rng)
    is_unique = family.dim == 1 or family.friction == 0.0
    return _solved_by(impulses, velocity, is_unique, directions, inverse_mass, _contacts(family))


@dataclass(frozen=True)
class LinkedFamily(Family):
    """The parameters of a random problem with joints and rolling friction.

    Attributes:
        n_joints: number of bilateral rows.
        rolling_rows: axes of rolling friction of each contact, 0, 1, 2 or 3.
        rolling_friction: μ_r of all contacts [m], a multiple of 1/8.
    """

    n_joints: int = 2
    rolling_rows: int = 2
    rolling_friction: float = 0.25


def random_linked_problem(family: LinkedFamily, seed: int) -> ContactProblem:
    """Return a random problem of ``family`` with a known solution, its joints after its contacts.

    A closed contact rolls or does not roll, independently of whether it slides.
    """
    rng = np.random.default_rng(seed)
    laws = _contacts(family)
    if family.rolling_rows:
        laws = laws.with_rolling(family.rolling_friction, family.rolling_rows)
    laws = Laws.concatenate([laws, Laws.joints(family.n_joints)])
    directions, inverse_mass = _factors(family, rng, laws.n_rows)
    sliding = [part.reshape(family.n_contacts, -1) for part in _complementary(family, rng)]
    rolling = [np.zeros((family.n_contacts, family.rolling_rows)) for _ in range(2)]
    rolling_states = [state for state in family.states if state in ("stick", "slip", "edge")]
    for contact in range(family.n_contacts if family.rolling_rows else 0):
        bound = family.rolling_friction * sliding[0][contact, 0]
        state = rng.choice(rolling_states) if bound else "slip"
        direction = _direction(1 + family.rolling_rows, rng)
        share = {"stick": 0.5, "slip": 1.0, "edge": 1.0}[state]
        rolling[0][contact] = -share * bound * direction / 5.0
        rolling[1][contact] = float(rng.integers(1, 9)) / 8.0 * direction * (state == "slip")
    joints = [rng.integers(-8, 9, size=family.n_joints) / 8.0, np.zeros(family.n_joints)]
    impulses, velocity = (np.append(np.column_stack([sliding[k], rolling[k]]).ravel(), joints[k]) for k in range(2))
    is_unique = family.dim == 1 and family.rolling_rows == 0
    return _solved_by(impulses, velocity, is_unique, directions, inverse_mass, laws)


def random_braced_problem(family: Family, seed: int) -> ContactProblem:
    """Return a random problem in which normal impulses λ > 0 alone carry the load, so that ξ = 0 for any μ.

    c = −G (λ, 0). Every solution has u·M u ≤ −λ·ξ_N ≤ 0 (see ``supports``); Λ itself is unique only if W has full rank
    and no body can be wedged. The states of the family are ignored.
    """
    rng = np.random.default_rng(seed)
    directions, inverse_mass = _factors(family, rng, family.n_contacts * family.dim)
    bearing = np.zeros((family.n_contacts, family.dim))
    bearing[:, 0] = rng.integers(1, 17, size=family.n_contacts) / 8.0
    impulses = bearing.ravel()
    return _solved_by(impulses, np.zeros(len(impulses)), True, directions, inverse_mass, _contacts(family))


def random_spectrum_problem(eigenvalues: FloatArray, dim: int, friction: float, seed: int) -> ContactProblem:
    """Return a random problem in Delassus form whose G has these eigenvalues [1/kg], with a known solution.

    Zero eigenvalues lower the rank. c is rounded, so the solution is exact only to rounding.
    """
    rng = np.random.default_rng(seed)
    n_rows = len(eigenvalues)
    basis, _ = np.linalg.qr(rng.normal(size=(n_rows, n_rows)))
    root = basis * np.sqrt(eigenvalues)
    delassus = root @ root.T
    delassus = 0.5 * (delassus + delassus.T)
    impulses, velocity = _complementary(Family(n_rows // dim, dim, friction=friction), rng)
    is_unique = dim == 1 or friction == 0.0
    answer = Answer(velocity=velocity if is_unique else None, witness=impulses, sensitivity=1e6)
    c = velocity - delassus @ impulses
    return ContactProblem.from_delassus(delassus, c, friction, dim=dim, answer=answer)


def single_precision(family: Family, seed: int, assembled: bool = False) -> ContactProblem:
    """Return a problem of ``family`` from float32 arrays, which represent its numbers exactly.

    The problem has factors, or G if ``assembled``. G is exact for equal masses and few degrees of freedom.
    """
    exact = random_problem(family, seed)
    assert exact.factors is not None
    c, friction = exact.free_velocity.astype(np.float32), np.float32(family.friction)
    if assembled:
        delassus = exact.delassus().toarray().astype(np.float32)
        return ContactProblem.from_delassus(delassus, c, friction, dim=family.dim, answer=exact.answer)
    directions = exact.factors.force_directions.astype(np.float32)
    inverse_mass = exact.factors.inverse_mass.matrix.diagonal().astype(np.float32)
    return ContactProblem.from_factors(directions, inverse_mass, c, friction, dim=family.dim, answer=exact.answer)


def _contacts(family: Family) -> Laws:
    return Laws.contacts(np.full(family.n_contacts, family.friction), family.dim, family.n_contacts)


def _solved_by(
    impulses: FloatArray,
    velocity: FloatArray,
    is_unique: bool,
    directions: FloatArray,
    inverse_mass: FloatArray,
    laws: Laws,
) -> ContactProblem:
    """Return the problem with c = ξ − Wᵀ M⁻¹ W Λ; ``is_unique`` states that ξ is unique."""
    c = velocity - directions.T @ (inverse_mass * (directions @ impulses))
    answer = Answer(velocity=velocity if is_unique else None, witness=impulses, sensitivity=1e6)
    return ContactProblem.from_factors(directions, inverse_mass, c, laws=laws, answer=answer)


def _factors(family: Family, rng: np.random.Generator, n_rows: int) -> tuple[FloatArray, FloatArray]:
    """Return W, whose entries are multiples of 1/16 in [−1, 1], and the diagonal of M⁻¹, powers of two."""
    shape = (family.n_dofs, n_rows)
    directions = rng.integers(-16, 17, size=shape) / 16.0 * (rng.random(shape) < family.density)
    empty = np.flatnonzero(~directions.any(axis=0))
    directions[rng.integers(0, family.n_dofs, size=len(empty)), empty] = 1.0
    spread = min(family.mass_exponent, MAX_MASS_EXPONENT)
    return directions, 2.0 ** rng.integers(-spread, spread + 1, size=family.n_dofs).astype(np.float64)


def _complementary(family: Family, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return Λ and ξ, shape (n_contacts · dim,), complementary under the laws of the family."""
    impulses, velocity = np.zeros((2, family.n_contacts, family.dim))
    for contact, state in enumerate(rng.choice(family.states, size=family.n_contacts)):
        size, speed = float(rng.integers(1, 9)), float(rng.integers(1, 9)) / 8.0
        direction = _direction(family.dim, rng)
        if state == "open":
            velocity[contact, 0], velocity[contact, 1:] = speed, speed * direction
            continue
        if state == "graze":
            velocity[contact, 1:] = speed * direction
            continue
        impulses[contact, 0] = 0.625 * size  # 5/8, so that the parts of a slip along (3, 4)/5 are short fractions
        share = {"stick": 0.5, "slip": 1.0, "edge": 1.0}[state]
        impulses[contact, 1:] = -share * family.friction * 0.125 * size * direction
        if state == "slip":
            velocity[contact, 1:] = speed * direction
    return impulses.ravel(), velocity.ravel()


def _direction(dim: int, rng: np.random.Generator) -> FloatArray:
    """Return a tangential vector of length 5 with integer entries, shape (dim − 1,)."""
    if dim == 1:
        return np.zeros(0)
    if dim == 4:
        spatial: FloatArray = rng.choice([-1.0, 1.0], size=3) * rng.permutation([0.0, 3.0, 4.0])
        return spatial
    sign = rng.choice([-1.0, 1.0], size=2)
    return sign[:1] * 5.0 if dim == 2 else sign * rng.permutation([3.0, 4.0])
