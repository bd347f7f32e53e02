"""Answers that are sensitive to rounding, checked in rational arithmetic on the stored numbers."""

from fractions import Fraction

import pytest
from proxbench.problems import ContactProblem
from proxbench.problems.hard import hard_case

Rational = list[Fraction]


def exact_delassus(problem: ContactProblem) -> list[Rational]:
    """G of the stored numbers without rounding: WᵀM⁻¹W, or the matrix itself."""
    if problem.factors is None:
        return [[Fraction(value) for value in row] for row in problem.delassus().toarray().tolist()]
    directions = [[Fraction(v) for v in row] for row in problem.factors.force_directions.toarray().T.tolist()]
    inverse_mass = [Fraction(v) for v in problem.factors.inverse_mass.matrix.diagonal().tolist()]

    def product(left: Rational, right: Rational) -> Fraction:
        return sum((a * m * b for a, m, b in zip(left, inverse_mass, right, strict=True) if a and b), Fraction(0))

    return [[product(left, right) for right in directions] for left in directions]


def solved(matrix: list[Rational], right: Rational) -> Rational:
    """Gaussian elimination without rounding."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    n = len(rows)
    for k in range(n):
        pivot = next(i for i in range(k, n) if rows[i][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for i in range(n):
            if i != k and rows[i][k]:
                factor = rows[i][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    return [row[-1] for row in rows]


@pytest.mark.parametrize(
    "name",
    [
        "hard-stack-2-top-heavy",
        "hard-stack-2-top-1e8",
        "hard-stack-10-top-1e4",
        "hard-stack-10-top-1e8",
        "hard-stack-10-bottom-1e8",
        "hard-stack-10-growing-1e8",
        "hard-stack-10-shrinking-1e8",
        "hard-scaled-rows",
        "hard-scaled-rows-3",
        "hard-scaled-rows-15",
        "hard-cradle-10",
        "hard-grazing-10",
        "hard-groove-narrow-frictionless",
        "hard-arch-3-frictionless",
    ],
)
def test_all_contacts_closed_is_the_exact_solution(name: str) -> None:
    problem = hard_case(name)
    assert problem.answer is not None
    exact = solved(exact_delassus(problem), [-Fraction(value) for value in problem.free_velocity.tolist()])
    assert all(value >= 0 for value in exact)
    # c is rounded, and a stack multiplies this error by the mass above; a relative comparison tolerates it
    assert problem.answer.impulses[0] == pytest.approx([float(value) for value in exact], rel=1e-9)


RODS = [
    "hard-counterexample",
    "hard-counterexample-mu4",
    "hard-counterexample-mu10",
    "hard-painleve-jam",
    "hard-painleve-jam-light",
    "hard-painleve-jam-heavy",
    "hard-three-solutions",
    "hard-three-solutions-light",
    "hard-three-solutions-heavy",
    "hard-pressing-rod-mu0.5",
    "hard-pressing-rod-mu1.2",
    "hard-pressing-rod-below",
    "hard-pressing-rod-critical",
    "hard-pressing-rod-above",
    "hard-pressing-rod-mu10",
    "hard-leaving-rod-below",
    "hard-leaving-rod-above",
    "hard-leaving-rod-mu1.4",
    "hard-leaving-rod-mu10",
]


def states_of_a_planar_contact(problem: ContactProblem) -> list[tuple[Fraction, Fraction]]:
    """Every solution of one planar contact without rounding, open, sliding either way, and sticking."""
    (g_nn, g_nt), (_, g_tt) = exact_delassus(problem)
    c_n, c_t = (Fraction(value) for value in problem.free_velocity.tolist())
    mu = Fraction(float(problem.laws.friction_coefficient[1]))
    found = []
    if c_n >= 0:
        found.append((Fraction(0), Fraction(0)))
    for sign in (1, -1):
        compliance = g_nn + sign * mu * g_nt
        normal = -c_n / compliance if compliance else Fraction(-1)
        if normal > 0 and sign * (c_t + (g_nt + sign * mu * g_tt) * normal) < 0:
            found.append((normal, sign * mu * normal))
    determinant = g_nn * g_tt - g_nt * g_nt
    normal, tangent = (-g_tt * c_n + g_nt * c_t) / determinant, (g_nt * c_n - g_nn * c_t) / determinant
    if normal > 0 and abs(tangent) <= mu * normal:
        found.append((normal, tangent))
    return found


@pytest.mark.parametrize("name", RODS)
def test_the_rods_have_no_other_solutions(name: str) -> None:
    problem = hard_case(name)
    assert problem.answer is not None
    exact = sorted((float(normal), float(tangent)) for normal, tangent in states_of_a_planar_contact(problem))
    known = sorted(tuple(impulses.tolist()) for impulses in problem.answer.impulses)
    assert len(exact) == len(known)
    for one, other in zip(exact, known, strict=True):
        assert one == pytest.approx(other, rel=1e-11)
