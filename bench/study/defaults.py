"""The studies of each scene by default: some minutes each."""

from collections.abc import Mapping, Sequence
from typing import Any

from ...problems.errors import suggestion
from ...problems.scenes.registry import SCENES
from ...problems.scenes.woodpecker import PERIOD
from ..errors import BenchError
from .plan import REFERENCE, Case, StudyPlan, check_plan

NEIGHBOURS = (0.98, 0.99, 1.0, 1.01, 1.02)
"""Factors on the number of steps of a period: its error is erratic in that number, so medians are compared."""

FEW_NEIGHBOURS = (0.99, 1.0, 1.01)
"""The same for runs that are dear, and for tolerances, in which the error is less erratic."""

STEPS_PER_PERIOD = (500, 1000, 2000, 5000, 10_000, 50_000)

EXPONENTS = (3, 4, 5, 6, 7, 8, 9)
"""Tolerances 10 to minus this of variable steppers; the minimal step is a hundredth of it, in seconds."""

STEPPERS = {
    "Extrapolated": ("Extrapolated({})", EXPONENTS),
    "Extrapolated, nested intervals": ("Extrapolated({}, search='nested')", EXPONENTS),
    "Extrapolated, two levels": ("Extrapolated({}, levels=2)", (3, 4, 5, 6, 7)),
    "StepDoubling": ("StepDoubling({})", (3, 4, 5, 6, 7)),
    "StepDoubling, last step only": ("StepDoubling({}, search='last')", (3, 4, 5, 6, 7)),
}
"""Variable steppers by the name of their curve: how they are written, and their tolerances."""

TINY_SOLVERS = ("SORprox", "NSGS", "Lemke", "HybridNewton")
"""Solvers of the woodpecker's inclusions."""

TINY_TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-12)
"""Their tolerances with a variable step, for which 1e-8 is too coarse."""

FIXED_TOLERANCES = (1e-1, 1e-2, 1e-4, 1e-6, 1e-8)
"""The same with a fixed step, for which much less is enough."""

FIXED_SIZE = PERIOD / 5000
"""The fixed step [s] with which tolerances of the solver are compared."""

LARGE_SOLVER = "MomentumFallback"
"""The solver of scenes with many contacts."""

LARGE_STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)
"""Step sizes [s] of scenes with many contacts; the reference has half of the last."""

LARGE_TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-5)

N_BALLS, N_SEEDS, POUR_SECONDS = 250, 6, 0.6
"""A small pour: it begins after 0.2 s, and half of the balls are through when it ends."""

ITERATIONS = 20_000


def make_study_plan(
    scene: str,
    options: Mapping[str, Any] | None = None,
    *,
    duration: float | None = None,
    seeds: int = N_SEEDS,
    solvers: Sequence[str] = (),
) -> StudyPlan:
    """Return the plan of the study of a scene.

    Args:
        scene: funnel, pile or woodpecker.
        options: of the scene; the woodpecker has none, as its limit cycle is known for the defaults only.
        duration: simulated time [s] of each pour; the woodpecker's is one period.
        seeds: starts that a scene of balls is poured from.
        solvers: solvers to compare in addition.

    Raises:
        BenchError: for a scene that has no study, or an option that it cannot have.
        ProxbenchError: for an option out of range, or an unknown solver.
    """
    given = dict(options or {})
    if scene == "woodpecker":
        if given or duration is not None:
            name = next(iter(given), "--duration")
            raise BenchError(f"the study of the woodpecker is over its limit cycle, once; leave {name} out.")
        plan = StudyPlan(scene, {"start": "cycle"}, PERIOD, tuple(_woodpecker_cases(solvers)))
    elif scene in ("funnel", "pile"):
        if seeds < 2:
            raise BenchError(f"a spread over seeds needs at least 2 of them, got {seeds}.")
        given = {"balls": N_BALLS, **given}
        cases = tuple(_pour_cases(solvers, [given.pop("seed", 0) + k for k in range(seeds)]))
        plan = StudyPlan(scene, given, POUR_SECONDS if duration is None else duration, cases)
    else:
        hint = suggestion(scene, ("funnel", "pile", "woodpecker")) if scene not in SCENES else "; name funnel or pile."
        raise BenchError(f"there is no study of {scene!r}{hint}")
    check_plan(plan)
    return plan


def _woodpecker_cases(added: Sequence[str]) -> list[Case]:
    def case(part: str, series: str, stepper: str, size: float | None, solver: str, tolerance: float) -> Case:
        many = size is not None and size > PERIOD / 20_000
        members = NEIGHBOURS if many else FEW_NEIGHBOURS
        return Case(part, series, stepper, size, solver, tolerance, ITERATIONS, members)

    sizes = [PERIOD / n for n in STEPS_PER_PERIOD]
    cases = [case("steppers", "Moreau, fixed step", "Moreau", size, "SORprox", 1e-10) for size in sizes]
    for series, (written, exponents) in STEPPERS.items():
        for exponent in exponents:
            stepper = written.format(_numbers(exponent))
            cases.append(case("steppers", series, stepper, None, "SORprox", 1e-12))
    fixed = "SORprox, fixed step"
    cases += [case("solvers", fixed, "Moreau", FIXED_SIZE, "SORprox", tolerance) for tolerance in FIXED_TOLERANCES]
    for solver in (*TINY_SOLVERS, *added):
        stepper = f"Extrapolated({_numbers(7)})"
        cases.extend(case("solvers", solver, stepper, None, solver, tolerance) for tolerance in TINY_TOLERANCES)
    return cases


def _pour_cases(added: Sequence[str], seeds: Sequence[int]) -> list[Case]:
    def case(part: str, series: str, size: float, solver: str, tolerance: float) -> Case:
        return Case(part, series, "Moreau", size, solver, tolerance, ITERATIONS, tuple(seeds))

    usual = 1e-4
    cases = [case(REFERENCE, REFERENCE, 0.5 * LARGE_STEPS[-1], LARGE_SOLVER, usual)]
    cases += [case("steppers", "Δt, SORprox to 1e-4", size, LARGE_SOLVER, usual) for size in LARGE_STEPS]
    middle = LARGE_STEPS[2]
    cases += [
        case("solvers", f"tolerance of SORprox, Δt {middle:g} s", middle, LARGE_SOLVER, tolerance)
        for tolerance in LARGE_TOLERANCES
    ]
    for solver in ("NSGS", *added):
        cases += [
            case("solvers", f"tolerance of {solver}, Δt {middle:g} s", middle, solver, each) for each in (1e-2, 1e-4)
        ]
    stepper = "StepDoubling(tolerance=0.01, min_step=0.0005)"
    cases.append(Case("steppers", "StepDoubling", stepper, None, LARGE_SOLVER, usual, ITERATIONS, tuple(seeds)))
    return cases


def _numbers(exponent: int) -> str:
    return f"tolerance=1e-{exponent}, min_step=1e-{exponent + 2}"
