"""Result files of simulations with variable steps: plan, accepted steps, switching points, states; see ``result_file``.

about        the plan, wall time
steps        one row an accepted step, see ``simulation.STEP``
switches     one row a switching point, see ``simulation.SWITCH``
trajectory   (q, u) after every step
closed, sticking   keys of the contacts that are so after the last one
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.law_states import LawStates
from ..simulations.result_file import VARIABLE_KIND, ResultKind, taken_from
from .plan import make_variable_plan
from .simulation import LAWS, STATES, STEP, SWITCH, VariableSimulation

KIND = ResultKind(VARIABLE_KIND, 1, "holds no simulation with variable steps")


def write_variable(simulation: VariableSimulation, path: Path) -> None:
    """Write ``simulation`` as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written.
    """
    about = {"plan": simulation.plan.document(), "wall_seconds": simulation.wall_seconds}
    states = simulation.states or LawStates()
    arrays = {
        "steps": simulation.steps,
        "switches": simulation.switches,
        "trajectory": simulation.trajectory,
        "closed": np.array(states.closed, dtype=np.int64),
        "sticking": np.array(states.sticking, dtype=np.int64),
    }
    KIND.write(path, about, arrays)


def is_variable(path: Path) -> bool:
    """Whether a file says that it holds a simulation with variable steps.

    Raises:
        BenchError: if it is missing or damaged, or no result file at all.
    """
    return KIND.is_of(path)


def read_variable(path: Path) -> VariableSimulation:
    """Read a result file.

    Raises:
        BenchError: if the file is missing, damaged, or not of a simulation with variable steps; one with a fixed
            step is read by ``read_simulation``.
    """
    about, content = KIND.read(path)
    with taken_from(path):
        simulation = VariableSimulation(make_variable_plan(**about["plan"]), path, float(about["wall_seconds"]))
        _restore(simulation, content)
    return simulation


def _restore(simulation: VariableSimulation, content: Mapping[str, NDArray[Any]]) -> None:
    """Put what was stored into ``simulation``.

    Raises:
        ValueError: if it is none of the scene.
    """
    steps, switches, trajectory = content["steps"], content["switches"], content["trajectory"]
    start = simulation.plan.scene.start
    shape = (len(steps), len(start.position) + len(start.velocity))
    fits = steps.dtype == STEP and switches.dtype == SWITCH and trajectory.dtype == np.float64
    known = (switches["law"] < len(LAWS)).all() and (switches["before"] < len(STATES)).all()
    if not (fits and known and (switches["after"] < len(STATES)).all() and trajectory.shape == shape):
        raise ValueError("these are no steps")
    if not np.isfinite(trajectory).all():
        raise ValueError("these are no states")
    simulation.restore(steps, switches, trajectory, _law_states(content))


def _law_states(content: Mapping[str, NDArray[Any]]) -> LawStates:
    closed, sticking = content["closed"], content["sticking"]
    if closed.dtype != np.int64 or sticking.dtype != np.int64 or closed.ndim != 1 or sticking.ndim != 1:
        raise ValueError("these are no contacts")
    return LawStates(tuple(closed.tolist()), tuple(sticking.tolist()))
