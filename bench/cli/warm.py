"""The command ``proxbench warm``: compile all kernels into the cache, for container images and clusters."""

import os
import sys
import time
from contextlib import suppress
from itertools import product
from typing import Annotated, Any

from . import options

PROBLEMS = (
    "funnel-30-early",
    "funnel-planar-30",
    "funnel-frictionless-30",
    "hard-mixed-laws",
    "pile-100-rolling",
    "bodies-arch-13-thin",
    "bodies-train-10",
    "bodies-four-bar",
)
"""Problems with factors and contacts of each kind, mixed laws, rolling friction, redundant contacts, and joints."""

MATRIX_PROBLEMS = ("hard-random-redundant", "hard-counterexample", "hard-disconnected-parts")
"""Problems without factors."""

DEMANDING_PROBLEMS = ("bodies-table-4-1e4", "bodies-train-10", "hard-tower-100")
"""Problems on which composite solvers also use the methods that follow their first one."""

MAX_ITERATIONS, MAX_SECONDS = 60, 2.0
"""Limits of each solve, except those of demanding problems; the time to compile does not count."""

DEMANDING_SECONDS = 20.0
"""Time limit of the solve of a demanding problem."""

SIMULATIONS = (
    ("funnel(balls=30)", "Moreau(step=1e-3)", 5e-3),
    ("funnel(balls=30, planar=True)", "Moreau(step=1e-3)", 5e-3),
    ("funnel(balls=30, friction=None)", "Moreau(step=1e-3)", 5e-3),
    ("funnel(balls=1000)", "Moreau(step=5e-3)", 0.1),
    ("bouncing_ball", "StepDoubling", 0.6),
    ("woodpecker", "Extrapolated", 0.02),
    ("woodpecker", "EventDriven", 0.02),
    ("brick_wall", "Moreau(step=1e-3)", 2e-3),
    ("dominoes", "Moreau(step=1e-3)", 2e-3),
    ("drum", "Moreau(step=1e-3)", 2e-3),
    ("arch", "Moreau(step=1e-3)", 2e-3),
    ("rolling_sphere", "Moreau(step=1e-3)", 2e-3),
    ("rolling_cylinder", "Moreau(step=1e-3)", 2e-3),
    ("spinning_top", "Moreau(step=1e-3)", 2e-3),
    ("four_bar", "Moreau(step=1e-3)", 2e-3),
)
"""Scene, stepper and duration [s] of short simulations; contacts occur with every stepper and every kind of body."""


def warm(
    quiet: Annotated[bool, options.flag("--quiet", help="Print nothing.")] = False, as_json: options.Json = False
) -> None:
    """Compile all kernels into the cache."""
    from ...problems.compilation import COMPILATION, compiled_kernels
    from ..report.layout.text import print_json

    options.check_output_options(quiet, as_json)
    begin = time.perf_counter()
    with compiled_kernels():
        _solve()
        _simulate()
    done: dict[str, Any] = {
        "compiled": COMPILATION.kernels,
        "compile_seconds": COMPILATION.seconds,
        "seconds": time.perf_counter() - begin,
        "cache": _cache_folder(),
    }
    if as_json:
        print_json(done)
    elif not quiet:
        print(
            f"Compiled {done['compiled']} kernels in {done['compile_seconds']:.0f} s "
            f"({done['seconds']:.0f} s in total); they are cached in {done['cache']}."
        )


def _solve() -> None:
    """Solve small problems of every kind with every built-in solver that has kernels, and judge one result of each."""
    from ...problems.contact.judge import judge
    from ...problems.contact.model import Model
    from ...problems.contact.solver import Stop
    from ...problems.errors import ProxbenchError
    from ...problems.exchange.catalog import load
    from ...solvers.composite.small.solve_many import solve_many
    from ...solvers.registry import compiled_solvers, create
    from ..isolation.preload import load_kernels_of

    load_kernels_of(compiled_solvers())
    solvers = [create(name) for name in compiled_solvers()]
    solvers += [create("SORprox", form="factors"), create("SORprox", step_size="row_sum")]
    for name in (*PROBLEMS, *MATRIX_PROBLEMS):
        problem = load(name)
        for solver in solvers:
            if not solver.supports(problem):
                impulses = solver.prepare(problem).solve(Stop(1e-10, MAX_ITERATIONS, MAX_SECONDS)).impulses
        for model in (Model.COULOMB, Model.CONVEX, Model.pyramid(8), Model.FRICTIONLESS):
            with suppress(ProxbenchError):  # the model does not apply to the laws
                judge(problem, impulses, model)
    solve_many([*PROBLEMS, *MATRIX_PROBLEMS])
    for name, solver_name in product(DEMANDING_PROBLEMS, ("Robust", "MomentumFallback")):
        create(solver_name).prepare(load(name)).solve(Stop(1e-10, sys.maxsize, DEMANDING_SECONDS))


def _simulate() -> None:
    from ..simulation.plan import make_simulation_plan
    from ..simulation.run import simulate

    for scene, stepper, duration in SIMULATIONS:
        simulate(make_simulation_plan(scene, stepper=stepper, duration=duration))


def _cache_folder() -> str:
    """Return the folder of numba's cache, or a description of the default folders."""
    return os.environ.get("NUMBA_CACHE_DIR") or "__pycache__ of the modules"
