"""A search for wrong certificates: impulses that the judge accepts and exact arithmetic does not.

    python tests/problems/contact/judging/adversary.py 100000 SEED

runs that many trials. Problems are random ones with contacts, joints and rolling friction, by G or by factors, in units
that are many orders apart, and small ones of the library. Impulses oppose each other, cancel exactly or nearly, are
subnormal, have signed zeros, are on the friction bound, or are not finite. The exact residual is a rational number.
"""

import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from exact_residual import exact_residual
from proxbench.problems import ContactProblem, Laws, ProblemError, judge, load
from proxbench.problems.contact.residual import Residual
from proxbench.problems.exchange.catalog import suite_members
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem

FACTOR, ROUNDING = 2.5, 2e-15
"""A certificate r is correct if the exact residual is at most ``FACTOR`` r + ``ROUNDING``."""

TOLERANCE = 1e-2
"""Largest judged residual of impulses that are judged exactly."""

IMPULSES = 50
"""Number of trials on one problem."""

MAX_ROWS = 40
"""Largest number of rows of the problems from the library."""


@dataclass
class Search:
    """The result of a search: the numbers of trials and of exactly judged ones, and the wrong certificates."""

    trials: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    certificates: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    worst: float = 0.0

    def judge(self, problem: ContactProblem, prepared: Residual, kind: str, impulses: np.ndarray) -> None:
        """Count one trial."""
        self.trials += 1
        self.kinds[kind] += 1
        if prepared.infeasible:
            return
        judged = min(judge(problem, impulses).residual, prepared.judged(problem, impulses))
        if not judged <= TOLERANCE or prepared.scale == 0.0:
            return
        self.certificates[kind] += 1
        exact = exact_residual(problem, impulses)
        if exact > FACTOR * judged + ROUNDING:
            self.wrong.append(f"{problem.name}, {kind}: judged {judged:.1e}, exact {float(exact):.1e}, {impulses!r}")
        if exact > ROUNDING and judged > 0.0:
            self.worst = max(self.worst, float(exact) / judged)


def search(trials: int, seed: int) -> Search:
    """Run trials and return the result."""
    found, rng = Search(), np.random.default_rng(seed)
    library = small_problems()
    while found.trials < trials:
        problem, answer = random_problem(rng, library)
        count = min(IMPULSES, trials - found.trials)
        with np.errstate(all="ignore"):
            prepared = Residual(problem)
            for kind, impulses in adversaries(problem, answer, count, rng):
                found.judge(problem, prepared, kind, impulses)
    return found


def small_problems() -> list[tuple[ContactProblem, np.ndarray]]:
    """Return small problems of the library, with known solutions if there are any."""
    problems = []
    for name in suite_members("hard") + suite_members("woodpecker"):
        problem = load(name)
        if 0 < problem.n_rows <= MAX_ROWS:
            known = () if problem.answer is None else problem.answer.impulses
            problems.append((problem, known[0] if known else np.zeros(problem.n_rows)))
    return problems


def random_problem(
    rng: np.random.Generator, library: list[tuple[ContactProblem, np.ndarray]]
) -> tuple[ContactProblem, np.ndarray]:
    """Return a problem and impulses that nearly solve it."""
    while True:
        try:
            kind = rng.integers(0, 6)
            if kind == 0:
                problem, answer = library[rng.integers(len(library))]
            elif kind == 1:
                family = LinkedFamily(int(rng.integers(1, 4)), int(rng.integers(1, 4)), rolling_rows=rng.integers(1, 4))
                problem = random_linked_problem(family, int(rng.integers(2**31)))
                answer = np.zeros(problem.n_rows) if problem.answer is None else known_impulses(problem)
            elif kind == 2:
                problem, answer = walls(rng)
            else:
                problem, answer = random_contacts(rng)
            return in_other_units(problem, answer, rng)
        except ProblemError:
            continue


def known_impulses(problem: ContactProblem) -> np.ndarray:
    """Return impulses that solve a problem of a family with known answers."""
    assert problem.answer is not None
    known = problem.answer.impulses[0] if problem.answer.impulses else problem.answer.witness
    return np.zeros(problem.n_rows) if known is None else known


def walls(rng: np.random.Generator) -> tuple[ContactProblem, np.ndarray]:
    """Return one body between contacts whose directions are opposite, equal, or nearly so."""
    dim, n_contacts = int(rng.integers(1, 4)), int(rng.integers(2, 5))
    n_dofs = dim + int(rng.integers(0, 3))
    first = np.round(rng.normal(size=(n_dofs, dim)) * 4) / 4 if rng.random() < 0.5 else rng.normal(size=(n_dofs, dim))
    turned = [first * rng.choice([-1.0, 1.0], size=dim) for _ in range(n_contacts)]
    directions = np.hstack(turned)
    if rng.random() < 0.5:
        directions = directions * (1.0 + 10.0 ** rng.uniform(-16, -3) * rng.normal(size=directions.shape))
    velocity = rng.choice([-1.0, 1.0, 0.0, 0.5, rng.normal()], size=directions.shape[1])
    problem = ContactProblem.from_factors(
        directions, 10.0 ** rng.uniform(-3, 3, n_dofs), velocity, rng.choice([0.0, 0.3, 1.0]), dim=dim, name="walls"
    )
    return problem, np.zeros(problem.n_rows)


def random_contacts(rng: np.random.Generator) -> tuple[ContactProblem, np.ndarray]:
    """Return contacts and joints with rank-deficient G, and Λ that solves it to rounding: c = ξ − GΛ."""
    dim, n_contacts, n_joints = int(rng.integers(1, 4)), int(rng.integers(1, 5)), int(rng.integers(0, 3))
    laws = Laws.contacts(float(rng.choice([0.0, 0.2, 1.0])), dim, n_contacts)
    if n_joints:
        laws = Laws.concatenate([laws, Laws.joints(n_joints)])
    n_rows, n_dofs = laws.n_rows, int(rng.integers(1, 7))
    directions = rng.normal(size=(n_dofs, n_rows))
    root = rng.normal(size=(n_dofs, n_dofs)) + 2.0 * np.eye(n_dofs)
    inverse = np.diag(10.0 ** rng.uniform(-6, 6, n_dofs)) if rng.random() < 0.5 else root @ root.T
    impulses = 10.0 ** rng.uniform(-3, 12) * rng.normal(size=n_rows)
    velocity = np.zeros(n_rows)
    unilateral = laws.first_row[laws.is_unilateral]
    impulses[unilateral] = np.abs(impulses[unilateral])
    for law in np.flatnonzero(laws.is_friction):
        rows = slice(laws.first_row[law], laws.first_row[law] + int(laws.kind[law]))
        bound = laws.friction_coefficient[law] * impulses[laws.first_row[laws.partner[law]]]
        impulses[rows] *= bound / max(float(np.linalg.norm(impulses[rows])), 1e-300) * rng.choice([0.5, 1.0])
        velocity[rows] = -impulses[rows] * rng.choice([0.0, 1.0])
    delassus = directions.T @ inverse @ directions
    free = velocity - delassus @ impulses
    if rng.random() < 0.5:
        return ContactProblem.from_factors(directions, inverse, free, laws=laws, name="factors"), impulses
    return ContactProblem.from_delassus(0.5 * (delassus + delassus.T), free, laws=laws, name="Delassus"), impulses


def in_other_units(
    problem: ContactProblem, answer: np.ndarray, rng: np.random.Generator
) -> tuple[ContactProblem, np.ndarray]:
    """Return the problem with other units of mass and velocity, up to 150 orders apart, or as it is."""
    if rng.random() < 0.6:
        return problem, answer
    mass, speed = 10.0 ** (rng.choice([10, 60, 140]) * rng.uniform(-1, 1, 2))
    laws = problem.laws
    if (laws.fixed_bound > 0.0).any():
        return problem, answer
    free = speed * problem.free_velocity
    if problem.factors is None:
        assert problem.matrix is not None
        changed = ContactProblem.from_delassus(problem.matrix / mass, free, laws=laws, name=problem.name)
    else:
        directions, inverse = problem.factors.force_directions, problem.factors.inverse_mass.matrix / mass
        changed = ContactProblem.from_factors(directions, inverse, free, laws=laws, name=problem.name)
    return changed, mass * speed * answer


def adversaries(
    problem: ContactProblem, answer: np.ndarray, count: int, rng: np.random.Generator
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield impulses [N s] to judge, with the names of their kinds."""
    delassus, n = problem.delassus().toarray(), problem.n_rows
    size = max(float(np.abs(answer).max(initial=0.0)), typical_impulse(problem, delassus))
    braces = null_vectors(delassus)
    for _ in range(count):
        kind = rng.choice(
            ["brace", "mirror", "equal", "round", "bound", "tiny", "zeros", "infinite", "walk", "negative"]
        )
        impulses = answer.copy()
        large = size * 10.0 ** rng.uniform(0, rng.choice([8, 20, 150]))
        if kind == "brace" and len(braces):
            impulses += large * (braces.T @ rng.normal(size=len(braces)))
        elif kind == "mirror":
            impulses = mirrored(delassus, impulses, 2.0 ** np.round(np.log2(large)), rng)
        elif kind == "equal":
            impulses = large * rng.choice([0.0, 1.0, 1.0, -1.0], size=n)
        elif kind == "round":
            impulses = impulses + large - large
        elif kind == "bound":
            impulses = on_bounds(problem, np.abs(impulses) + large * rng.choice([0.0, 1.0], size=n), rng)
        elif kind == "tiny":
            impulses *= 1.0 + 10.0 ** rng.uniform(-17, -6) * rng.normal(size=n)
            impulses[rng.integers(n)] = rng.choice([5e-324, -5e-324, 1e-310, 2.2e-308])
        elif kind == "zeros":
            impulses[rng.random(n) < 0.5] = rng.choice([0.0, -0.0])
        elif kind == "infinite":
            impulses[rng.integers(n)] = rng.choice([np.inf, -np.inf, np.nan, 1.7e308, -1.7e308])
        elif kind == "walk":
            steps = rng.integers(-3, 4, size=n)
            impulses += steps * np.spacing(impulses)
        else:
            impulses *= rng.choice([1.0, -1.0], size=n)
        yield str(kind), impulses


def typical_impulse(problem: ContactProblem, delassus: np.ndarray) -> float:
    """Return the largest |c|/G_ii [N s], 1 if there is none."""
    diagonal, free = np.diag(delassus), np.abs(problem.free_velocity)
    found = (free[diagonal > 0.0] / diagonal[diagonal > 0.0]).max(initial=0.0)
    return float(found) if 0.0 < found < np.inf else 1.0


def null_vectors(delassus: np.ndarray) -> np.ndarray:
    """Return Λ for which GΛ is zero up to rounding, shape (any, n_rows)."""
    if not np.isfinite(delassus).all() or not delassus.any():
        return np.zeros((0, len(delassus)))
    values, vectors = np.linalg.eigh(delassus / np.abs(delassus).max())
    return vectors[:, np.abs(values) < 1e-9].T


def mirrored(delassus: np.ndarray, impulses: np.ndarray, large: float, rng: np.random.Generator) -> np.ndarray:
    """Return impulses with the same power of two added to rows that are opposite, and subtracted from equal ones."""
    first = int(rng.integers(len(delassus)))
    for other in rng.permutation(len(delassus)):
        if other != first and np.allclose(np.abs(delassus[other]), np.abs(delassus[first]), rtol=1e-6, atol=0.0):
            impulses[first] += large
            impulses[other] -= np.sign(delassus[first, other]) * large
            break
    return impulses


def on_bounds(problem: ContactProblem, impulses: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return impulses with every friction on its bound, up to a few last bits."""
    laws = problem.laws
    bounds = laws.friction_bounds(impulses)
    for law in np.flatnonzero(laws.is_friction):
        kind = int(laws.kind[law])
        rows = slice(laws.first_row[law], laws.first_row[law] + (kind if kind < 3 else kind - 3))
        direction = rng.normal(size=rows.stop - rows.start)
        direction /= np.linalg.norm(direction)
        impulses[rows] = bounds[law] * direction * (1.0 + rng.integers(-3, 4) * 2.0**-52)
    return impulses


if __name__ == "__main__":
    began = time.perf_counter()
    result = search(int(sys.argv[1]), int(sys.argv[2]))
    print(f"{result.trials} trials in {time.perf_counter() - began:.0f} s: {dict(result.kinds)}")
    print(f"certificates up to {TOLERANCE:g}: {dict(result.certificates)}, largest exact/judged {result.worst:.3f}")
    print(f"{len(result.wrong)} wrong certificates", *result.wrong[:10], sep="\n")
