"""The solvers and funnel steps of the speed tests, and the reasons why solvers are omitted."""

from functools import cache

from proxbench.problems import ContactProblem, load
from proxbench.solvers import Solver, available, create
from proxbench.solvers.registry import composites

SIZES = (30, 300, 1000)
"""Balls in the funnel; the steps have about 60, 340 and 1670 contacts."""

TOLERANCE = 1e-4
"""The residual that every solver must reach, by the judge of the model that it solves."""

OPTIONS = {
    "JORprox": ["JORprox(relaxation=0.5)"],
    "Lemke": ["Lemke(sides=4)"],
    "PyramidPGS": ["PyramidPGS(relaxation=1.5)"],
    "SORprox": ["SORprox(relaxation=1.5)", "SORprox(relaxation=1.5, form='factors')"],
}
"""Options of solvers whose defaults do not suit a funnel; other solvers have their defaults."""

_DIVERGES = (
    "a Jacobi sweep with full steps diverges on funnel steps of any size; JORprox with relaxation 0.5 is measured"
)

EXCUSES = {
    ("Jprox", 30): _DIVERGES,
    ("Jprox", 300): _DIVERGES,
    ("Jprox", 1000): _DIVERGES,
    ("CvxpyCoulomb", 1000): "fifteen cone programs of 1.5 s each; ClarabelCoulomb solves the same ones without cvxpy",
    ("Lemke", 1000): "thousands of pivots in a tableau of hundreds of megabytes take minutes",
}
"""Reasons why a solver need not reach the tolerance, by solver and number of balls."""

_KINDS = ("funnel-{}", "funnel-planar-{}", "funnel-frictionless-{}")
"""Steps of one size, the most general first."""


def contestants() -> list[str]:
    """Return every registered solver with its options, and an example of each composite solver."""
    return [*(entry for name in available() for entry in OPTIONS.get(name, [name])), *composites().values()]


def excuse(entry: str, size: int) -> str | None:
    """Return why a solver is not measured on the step of ``size`` balls, or None if it is."""
    return EXCUSES.get((entry.partition("(")[0], size))


@cache
def step_for(entry: str, size: int) -> tuple[Solver, ContactProblem | None, str]:
    """Return the solver, the most general step of ``size`` balls that it supports, and why it supports no other.

    The step is None if the solver supports no step of this size.
    """
    solver = create(entry)
    reasons: list[str] = []
    for kind in _KINDS:
        problem = funnel_step(kind.format(size))
        reason = solver.supports(problem)
        if reason is None:
            return solver, problem, "; ".join(reasons)
        reasons.append(f"{problem.name}: {reason}")
    return solver, None, "; ".join(reasons)


@cache
def funnel_step(name: str) -> ContactProblem:
    """Return a problem of the library, the same object in every call."""
    return load(name)
