"""Result files of simulations with variable steps: plan, accepted steps, switching points, states; see ``result_file``.

about        the plan, wall time, the failure if a step failed
steps        one row an accepted step, see ``simulation.STEP``
switches     one row a switching point, see ``simulation.SWITCH``
state_…      states evenly over time and at switching points, see ``kept_states``
closed, sticking   keys of the contacts that are so after the last one
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.stepping.contact_states import LawStates
from ..simulation.beside import beside_from
from ..simulation.failure import failure_from
from ..simulation.kept_states import kept_arrays, restore_kept
from ..simulation.result_file import VARIABLE_KIND, ResultKind, taken_from
from .plan import make_variable_plan
from .simulation import LAWS, STATES, STEP, SWITCH, VariableSimulation

KIND = ResultKind(VARIABLE_KIND, 2, "holds no simulation with variable steps")


def write_variable(simulation: VariableSimulation, path: Path) -> None:
    """Write ``simulation`` as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written.
    """
    about = {
        "plan": simulation.plan.document(),
        "wall_seconds": simulation.wall_seconds,
        "failure": None if simulation.failure is None else simulation.failure.document(),
        "beside": simulation.beside.document(path),
        "doublings": simulation.thinning.doublings,
    }
    states = simulation.states or LawStates()
    arrays = {
        "steps": simulation.steps,
        "switches": simulation.switches,
        **kept_arrays(simulation.thinning),
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
        simulation.failure = failure_from(about["failure"])
        simulation.beside = beside_from(about["beside"], path)
        _restore(simulation, content, int(about["doublings"]))
    return simulation


def _restore(simulation: VariableSimulation, content: Mapping[str, NDArray[Any]], doublings: int) -> None:
    """Put what was stored into ``simulation``.

    Raises:
        ValueError: if it is none of the scene.
    """
    steps, switches = content["steps"], content["switches"]
    fits = steps.dtype == STEP and steps.ndim == 1 and switches.dtype == SWITCH
    known = fits and (switches["law"] < len(LAWS)).all() and (switches["before"] < len(STATES)).all()
    if not (known and (switches["after"] < len(STATES)).all()):
        raise ValueError("these are no steps")
    restore_kept(simulation.thinning, content, doublings, steps["time"])
    simulation.restore(steps, switches, _law_states(content))


def _law_states(content: Mapping[str, NDArray[Any]]) -> LawStates:
    closed, sticking = content["closed"], content["sticking"]
    if closed.dtype != np.int64 or sticking.dtype != np.int64 or closed.ndim != 1 or sticking.ndim != 1:
        raise ValueError("these are no contacts")
    return LawStates(tuple(closed.tolist()), tuple(sticking.tolist()))
