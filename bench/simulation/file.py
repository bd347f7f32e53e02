"""Result files of simulations: the plan, the steps and states, see ``result_file``.

about          plan, names of statuses, wall time, why a step failed, files beside, doublings of the spacing of states
steps          one row a step, see ``simulation.STEP``
state_…        states, from the last of which the simulation goes on bit by bit, see ``kept_states``
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solvers.interface import Solver
from ..errors import BenchError
from .beside import beside_from
from .failure import failure_from
from .kept_states import kept_arrays, restore_kept
from .plan import SimulationPlan, make_simulation_plan
from .result_file import FIXED_KIND, ResultKind, taken_from
from .trajectory import STEP, Simulation

KIND = ResultKind(FIXED_KIND, 3, "is no result file of a simulation")


def write_simulation(simulation: Simulation, path: Path) -> None:
    """Write ``simulation`` as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written.
    """
    about = {
        "plan": simulation.plan.document(),
        "statuses": list(simulation.statuses),
        "wall_seconds": simulation.wall_seconds,
        "failure": None if simulation.failure is None else simulation.failure.document(),
        "beside": simulation.beside.document(path),
        "doublings": simulation.thinning.doublings,
    }
    simulation.thinning.offer(simulation.state)  # an interruption may have come between a step and this
    arrays = {"steps": simulation.steps, **kept_arrays(simulation.thinning)}
    KIND.write(path, about, arrays)


def read_simulation(path: Path, solver: Solver | None = None) -> Simulation:
    """Read a result file.

    Args:
        path: the file.
        solver: the solver of the plan, if ``create`` does not know it by its name.

    Raises:
        BenchError: if the file is missing, damaged, or no result file of a simulation with a fixed step; one with a
            variable step is read by ``read_variable``.
    """
    about, content = KIND.read(path)
    with taken_from(path):
        plan = _plan(about["plan"], solver)
        simulation = Simulation(plan, tuple(about["statuses"]), float(about["wall_seconds"]), path)
        simulation.failure = failure_from(about["failure"])
        simulation.beside = beside_from(about["beside"], path)
        steps = _steps(content, len(simulation.statuses))
        restore_kept(simulation.thinning, content, int(about["doublings"]), steps["time"])
        simulation.restore(steps, simulation.states[-1])
    return simulation


def _plan(stored: Mapping[str, Any], solver: Solver | None) -> SimulationPlan:
    if solver is not None and solver.name != stored["solver"]:
        raise BenchError(f"it was simulated with {stored['solver']}, not with {solver.name}.")
    return make_simulation_plan(**{**stored, "solver": solver or stored["solver"]})


def _steps(content: Mapping[str, NDArray[Any]], n_statuses: int) -> NDArray[np.void]:
    steps = content["steps"]
    if steps.dtype != STEP or steps.ndim != 1 or (steps["status"] >= n_statuses).any():
        raise ValueError("these are no steps")
    return steps
