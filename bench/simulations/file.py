"""Result files of simulations: the plan, the steps and the last state, see ``result_file``.

about          the plan, the names of statuses, wall time
steps          one row a step, see ``simulation.STEP``
time, position, velocity, keys, impulses      the last state, from which the simulation goes on bit by bit
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.moreau import State
from ...solvers.interface import Solver
from ..errors import BenchError
from .plan import SimulationPlan, make_simulation_plan
from .result_file import FIXED_KIND, ResultKind, taken_from
from .simulation import STEP, Simulation

KIND = ResultKind(FIXED_KIND, 2, "is no result file of a simulation")


def write_simulation(simulation: Simulation, path: Path) -> None:
    """Write ``simulation`` as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written.
    """
    about = {
        "plan": simulation.plan.document(),
        "statuses": list(simulation.statuses),
        "wall_seconds": simulation.wall_seconds,
    }
    state = simulation.state
    arrays = {
        "steps": simulation.steps,
        "time": np.array(state.time),
        "position": state.position,
        "velocity": state.velocity,
        "keys": state.keys,
        "impulses": state.impulses,
    }
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
        simulation.restore(_steps(content, len(simulation.statuses)), _state(content, plan))
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


def _state(content: Mapping[str, NDArray[Any]], plan: SimulationPlan) -> State:
    """Return the stored state.

    Raises:
        ValueError: if it is none of the scene.
    """
    start, steps = plan.scene.start, content["steps"]
    time, keys, impulses = float(content["time"]), content["keys"], content["impulses"]
    vectors = {name: content[name] for name in ("position", "velocity")}
    if any(
        vector.shape != getattr(start, name).shape or vector.dtype != np.float64 or not np.isfinite(vector).all()
        for name, vector in vectors.items()
    ):
        raise ValueError("position and velocity are not those of the scene")
    if keys.dtype != np.int64 or impulses.dtype != np.float64 or keys.shape != impulses.shape[:1] or impulses.ndim != 2:
        raise ValueError("keys and impulses do not go together")
    if time != (steps["time"][-1] if len(steps) else start.time):
        raise ValueError("the state is not that after the last step")
    return State(time, vectors["position"], vectors["velocity"], keys, impulses)
