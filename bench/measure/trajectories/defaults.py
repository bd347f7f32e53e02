"""Default methods of a study, chosen so that it takes a few minutes."""

from collections.abc import Iterator, Sequence

from ....problems.motion.scenes.scene import Scene
from ...plugins.descriptions import solver_spec
from ...plugins.solver_specs import SolverSpec
from ...store.plans import TrajectoryRecord
from .methods import Method, make_method, solver_method_name

STEPS = (500, 1000, 2000, 5000, 10_000, 50_000)
"""Numbers of fixed steps in the duration of a scene with few contacts."""

STEPPERS = {
    "Extrapolated": (3, 4, 5, 6, 7, 8, 9),
    "Extrapolated(search='nested')": (3, 4, 5, 6, 7, 8, 9),
    "Extrapolated(levels=2)": (3, 4, 5, 6, 7),
    "StepDoubling": (3, 4, 5, 6, 7),
    "StepDoubling(search='last')": (3, 4, 5, 6, 7),
}
"""Variable steppers for few contacts, with the negative exponents of their tolerances."""

SOLVERS = ("SORprox", "NSGS", "Lemke", "HybridNewton")
"""Solvers for few contacts."""

TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-12)
"""Tolerances of these solvers with a variable step; 1e-8 is already too coarse."""

FIXED_STEPS = 5000
"""Number of fixed steps in the duration for comparing tolerances of a solver."""

FIXED_TOLERANCES = (1e-1, 1e-2, 1e-4, 1e-6, 1e-8)
"""Tolerances of a solver with a fixed step, for which coarser ones suffice."""

LARGE_SOLVER = "MomentumFallback"
"""The solver for many contacts."""

LARGE_STEPS = (8.0, 4.0, 2.0, 1.0, 0.5)
"""Fixed step sizes for many contacts, relative to that of the scene; the reference has half the last one."""

LARGE_TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-5)
"""Tolerances of the solver for many contacts."""


def default_methods(scene: Scene, trajectory: TrajectoryRecord) -> Iterator[Method]:
    """Yield the default methods of a study of a scene."""
    if scene.has_few_contacts:
        yield make_method("Moreau with SORprox", [trajectory.duration / number for number in STEPS], 1e-10)
        for stepper, exponents in STEPPERS.items():
            yield make_method(f"{stepper} with SORprox", [10.0**-exponent for exponent in exponents])
        yield make_method(f"SORprox in Moreau(step={trajectory.duration / FIXED_STEPS:.3g})", FIXED_TOLERANCES)
        solvers: Sequence[str] = SOLVERS
    else:
        steps = [factor * scene.step_size for factor in LARGE_STEPS]
        yield make_method(f"Moreau with {LARGE_SOLVER}", steps, _usual_tolerance(trajectory))
        doubling = f"StepDoubling(min_step={scene.step_size!r}) with {LARGE_SOLVER}"
        yield make_method(doubling, [1e-2], _usual_tolerance(trajectory))
        yield make_method(f"{LARGE_SOLVER} in Moreau(step={2.0 * scene.step_size!r})", LARGE_TOLERANCES)
        solvers = ("NSGS",)
    yield from added_methods(scene, map(solver_spec, solvers))


def added_methods(scene: Scene, solvers: Iterator[SolverSpec]) -> Iterator[Method]:
    """Yield the methods that compare solvers over their tolerances."""
    fixed_stepper, variable_stepper = f"Moreau(step={2.0 * scene.step_size!r})", "Extrapolated"
    for solver in solvers:
        if scene.has_few_contacts:
            yield make_method(solver_method_name(solver, variable_stepper), TOLERANCES, specification=solver)
        else:
            yield make_method(solver_method_name(solver, fixed_stepper), (1e-2, 1e-4), specification=solver)


def default_reference(scene: Scene, trajectory: TrajectoryRecord) -> Method:
    """Return the method of the reference, finer than all ``default_methods``."""
    if scene.has_few_contacts:
        return make_method("Extrapolated with SORprox", [1e-10], 1e-13)
    size = 0.5 * LARGE_STEPS[-1] * scene.step_size
    return make_method(f"Moreau with {LARGE_SOLVER}", [size], _usual_tolerance(trajectory))


def _usual_tolerance(trajectory: TrajectoryRecord) -> float:
    """Return the tolerance of solvers in a fixed step; for a single motion, the error of the step must dominate."""
    return 1e-4 if trajectory.error == "aggregates" else 1e-8
