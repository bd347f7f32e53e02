"""The command ``proxbench warm``: compile all kernels into the cache, for container images and clusters."""

import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import product
from typing import Annotated, Any

from .. import options

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
"""Problems on which composite solvers also call methods after their first."""

MAX_ITERATIONS, MAX_SECONDS = 60, 2.0
"""Limits of each solve, except those of demanding problems; compilation time does not count."""

DEMANDING_SECONDS = 20.0
"""Time limit of each solve of a demanding problem [s]."""

VARIANTS = ("SORprox(form='factors')", "SORprox(step_size='row_sum')")
"""Solvers with options that select other kernels."""

SIMULATIONS: tuple[tuple[Any, ...], ...] = (
    ("funnel(balls=300)", "Moreau(step=5e-3)", 0.1),
    ("funnel(balls=300, planar=True)", "Moreau(step=5e-3)", 0.1),
    ("funnel(balls=300, friction=None)", "Moreau(step=5e-3)", 0.1),
    ("funnel(balls=300)", "Moreau(step=5e-3)", 0.1, "ColouredSORprox"),
    ("funnel(balls=1000)", "Moreau(step=5e-3)", 0.1),
    ("bouncing_ball", "StepDoubling", 0.6),
    ("woodpecker", "Extrapolated", 0.02),
    ("woodpecker", "EventDriven", 0.02),
    ("dominoes", "Moreau(step=1e-3)", 2e-3),
    ("drum", "Moreau(step=1e-3)", 2e-3),
    ("arch", "Moreau(step=1e-3)", 2e-3),
    ("rolling_sphere", "Moreau(step=1e-3)", 2e-3),
    ("rolling_cylinder", "Moreau(step=1e-3)", 2e-3),
    ("spinning_top", "Moreau(step=1e-3)", 2e-3),
    ("four_bar", "Moreau(step=1e-3)", 2e-3),
    ("brick_wall", "Moreau(step=1e-3)", 2e-3),
)
"""Scene, stepper and duration [s] of short simulations, and the solver if it is not the default.

Contacts occur with every stepper and every kind of body.
"""

MAX_PROCESSES = 4
"""Largest number of processes, each of which takes 0.7 GB of memory.

With more processes, the slowest part determines the time.
"""


def warm(
    quiet: Annotated[bool, options.flag("--quiet", help="Print nothing.")] = False, as_json: options.Json = False
) -> None:
    """Compile all kernels into the cache."""
    from ....solvers.iteration.cores import usable_cores
    from ...report.layout.text import print_json
    from .processes import compile_here, compile_in_processes

    begin, n_processes = time.perf_counter(), min(usable_cores(), MAX_PROCESSES)
    if n_processes == 1:
        compiled = compile_here(parts())
    else:
        compiled = compile_in_processes(f"{__name__}:parts", len(parts()), n_processes)
    result: dict[str, Any] = {
        "compiled": compiled.kernels,
        "compile_seconds": compiled.seconds,
        "seconds": time.perf_counter() - begin,
        "cache": _cache_folder(),
    }
    if as_json:
        print_json(result)
    elif not quiet:
        print(
            f"Compiled {result['compiled']} kernels in {result['compile_seconds']:.0f} s "
            f"({result['seconds']:.0f} s in total); they are cached in {result['cache']}."
        )


def parts() -> list[Callable[[], None]]:
    """Return calls that together compile all kernels; neighbours have most kernels in common."""
    from ....solvers.registry import compiled_solvers

    solves = [partial(_solve, name) for name in (*compiled_solvers(), *VARIANTS)]
    simulations = [partial(_simulate, *simulation) for simulation in SIMULATIONS]
    demanding = [
        partial(_solve_to_convergence, *pair) for pair in product(("Robust", "MomentumFallback"), DEMANDING_PROBLEMS)
    ]
    return [*solves, _solve_many, _judge, *demanding, *simulations]


def _solve(name: str) -> None:
    """Solve small problems of every kind with one solver."""
    from ....problems.contact.solver import Stop
    from ....problems.exchange.catalog import load
    from ....solvers.registry import compiled_solvers, create
    from ...isolation.preload import load_kernels_of

    if name in compiled_solvers():
        load_kernels_of([name])
    solver = create(name)
    for problem in map(load, (*PROBLEMS, *MATRIX_PROBLEMS)):
        if not solver.supports(problem):
            solver.prepare(problem).solve(Stop(1e-10, MAX_ITERATIONS, MAX_SECONDS))


def _judge() -> None:
    """Judge zero impulses for problems of every kind under every kind of model."""
    import numpy as np

    from ....problems.contact.judge import judge
    from ....problems.contact.model import Model
    from ....problems.errors import ProxbenchError
    from ....problems.exchange.catalog import load

    for problem in map(load, (*PROBLEMS, *MATRIX_PROBLEMS)):
        for model in (Model.COULOMB, Model.CONVEX, Model.pyramid(8), Model.FRICTIONLESS):
            with suppress(ProxbenchError):  # the model does not apply to the laws
                judge(problem, np.zeros(problem.n_rows), model)


def _solve_many() -> None:
    """Solve small problems of every kind in one call."""
    from ....solvers.composite.small.solve_many import solve_many

    solve_many([*PROBLEMS, *MATRIX_PROBLEMS])


def _solve_to_convergence(solver: str, problem: str) -> None:
    """Solve a demanding problem until the solver converges or the time limit is reached."""
    from ....problems.contact.solver import Stop
    from ....problems.exchange.catalog import load
    from ....solvers.registry import create

    create(solver).prepare(load(problem)).solve(Stop(1e-10, sys.maxsize, DEMANDING_SECONDS))


def _simulate(scene: str, stepper: str, duration: float, solver: str | None = None) -> None:
    """Simulate a scene for a duration [s]."""
    from ...simulation.plan import make_simulation_plan
    from ...simulation.run import simulate

    simulate(make_simulation_plan(scene, stepper=stepper, duration=duration, solver=solver))


def _cache_folder() -> str:
    """Return the folder of numba's cache, or a description of the default folders."""
    return os.environ.get("NUMBA_CACHE_DIR") or "__pycache__ of the modules"
