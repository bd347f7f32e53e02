"""Result files of simulations with variable steps: plan, accepted steps, switching points and states, without pickle.

    about        JSON: what the file is, the plan, wall time
    steps        one row an accepted step, see ``simulation.STEP``
    switches     one row a switching point, see ``simulation.SWITCH``
    trajectory   (q, u) after every step
    closed, sticking   keys of the contacts that are so after the last one

Every write replaces the whole file, so whatever happens, the last complete one is there.
"""

import json
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ...problems.errors import ProxbenchError
from ...problems.files import replacing
from ...problems.law_states import LawStates
from ..errors import BenchError
from ..simulations.file import damaged, stored_arrays
from .plan import make_variable_plan
from .simulation import LAWS, STATES, STEP, SWITCH, VariableSimulation

KIND = "proxbench simulation with variable steps"
"""What a result file says it is."""

FORMAT = 1
"""Version of the file format."""


def write_variable(simulation: VariableSimulation, path: Path) -> None:
    """Write ``simulation`` as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written.
    """
    about = {
        "kind": KIND,
        "format": FORMAT,
        "version": metadata.version("proxbench"),
        "plan": simulation.plan.document(),
        "wall_seconds": simulation.wall_seconds,
    }
    states = simulation.states or LawStates()
    arrays: dict[str, Any] = {
        "about": np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), dtype=np.uint8),
        "steps": simulation.steps,
        "switches": simulation.switches,
        "trajectory": simulation.trajectory,
        "closed": np.array(states.closed, dtype=np.int64),
        "sticking": np.array(states.sticking, dtype=np.int64),
    }
    try:
        with replacing(path) as file:
            np.savez(file, **arrays)
    except OSError as error:
        raise BenchError(f"cannot write {path}: {error.strerror}; choose another --output.") from None


def is_variable(path: Path) -> bool:
    """Whether a file says that it holds a simulation with variable steps.

    Raises:
        BenchError: if it is missing or damaged, or no result file at all.
    """
    about = _about(stored_arrays(path))
    return about is not None and about.get("kind") == KIND


def read_variable(path: Path) -> VariableSimulation:
    """Read a result file.

    Raises:
        BenchError: if the file is missing, damaged, or not of a simulation with variable steps.
    """
    content = stored_arrays(path)
    about = _about(content)
    if about is None or about.get("kind") != KIND:
        raise BenchError(f"{path} holds no simulation with variable steps; name a file that proxbench simulate wrote.")
    if about.get("format") != FORMAT:
        raise BenchError(f"{path} has format {about.get('format')}, this version reads format {FORMAT}; simulate anew.")
    try:
        simulation = VariableSimulation(make_variable_plan(**about["plan"]), path, float(about["wall_seconds"]))
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
    except ProxbenchError as error:
        raise BenchError(f"cannot go on from {path}: {error}") from None
    except (KeyError, TypeError, ValueError, IndexError):
        raise damaged(path) from None
    return simulation


def _law_states(content: dict[str, Any]) -> LawStates:
    closed, sticking = content["closed"], content["sticking"]
    if closed.dtype != np.int64 or sticking.dtype != np.int64 or closed.ndim != 1 or sticking.ndim != 1:
        raise ValueError("these are no contacts")
    return LawStates(tuple(closed.tolist()), tuple(sticking.tolist()))


def _about(content: dict[str, Any]) -> dict[str, Any] | None:
    try:
        about = json.loads(content["about"].tobytes().decode())
    except (KeyError, ValueError):
        return None
    return about if isinstance(about, dict) else None
