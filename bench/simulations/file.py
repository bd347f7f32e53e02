"""Result files of simulations: the plan, the steps and the last state, compressed by nothing, without pickle.

    about          JSON: what the file is, the plan, the names of statuses, wall time
    steps          one row a step, see ``simulation.STEP``
    time, position, velocity, keys, impulses      the last state, from which the simulation goes on bit by bit

Every write replaces the whole file, so whatever happens, the last complete one is there.
"""

import json
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.archive import ArchiveError, read_arrays
from ...problems.errors import ProxbenchError
from ...problems.files import replacing
from ...problems.moreau import State
from ...solvers.interface import Solver
from ..errors import BenchError
from .plan import SimulationPlan, make_simulation_plan
from .simulation import STEP, Simulation

KIND = "proxbench simulation"
"""What a result file says it is."""

FORMAT = 2
"""Version of the file format."""

SUFFIX = ".npz"


def write_simulation(simulation: Simulation, path: Path) -> None:
    """Write ``simulation`` as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written.
    """
    about = {
        "kind": KIND,
        "format": FORMAT,
        "version": metadata.version("proxbench"),
        "plan": simulation.plan.document(),
        "statuses": list(simulation.statuses),
        "wall_seconds": simulation.wall_seconds,
    }
    state = simulation.state
    arrays: dict[str, Any] = {
        "about": np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), dtype=np.uint8),
        "steps": simulation.steps,
        "time": np.array(state.time),
        "position": state.position,
        "velocity": state.velocity,
        "keys": state.keys,
        "impulses": state.impulses,
    }
    try:
        with replacing(path) as file:
            np.savez(file, **arrays)
    except OSError as error:
        raise BenchError(f"cannot write {path}: {error.strerror}; choose another --output.") from None


def read_simulation(path: Path, solver: Solver | None = None) -> Simulation:
    """Read a result file.

    Args:
        path: the file.
        solver: the solver of the plan, if ``create`` does not know it by its name.

    Raises:
        BenchError: if the file is missing, damaged, or no result file of a simulation.
    """
    content = stored_arrays(path)
    try:
        about = json.loads(content["about"].tobytes().decode())
        is_ours = about["kind"] == KIND
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError):
        is_ours = False
    if not is_ours:
        raise BenchError(f"{path} is no result file of a simulation; name a file that proxbench simulate wrote.")
    if about.get("format") != FORMAT:
        raise BenchError(f"{path} has format {about.get('format')}, this version reads format {FORMAT}; simulate anew.")
    try:
        plan = _plan(about["plan"], solver)
        simulation = Simulation(plan, tuple(about["statuses"]), float(about["wall_seconds"]), path)
        simulation.restore(_steps(content, len(simulation.statuses)), _state(content, plan))
    except ProxbenchError as error:
        raise BenchError(f"cannot go on from {path}: {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError):
        raise damaged(path) from None
    return simulation


def stored_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of any .npz file; zip holds a checksum of each, which reading compares.

    Raises:
        BenchError: if the file is missing, cannot be read, or is damaged.
    """
    try:
        with path.open("rb") as file:
            if file.read(2) != b"PK":
                raise BenchError(
                    f"{path} is no result file of a simulation; name a file that proxbench simulate wrote."
                )
            file.seek(0)
            return read_arrays(file)
    except FileNotFoundError:
        raise BenchError(f"there is no result file {path}.") from None
    except ArchiveError:
        raise damaged(path) from None
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror or error}.") from None


def damaged(path: Path) -> BenchError:
    """Return the error for a file that is not what was written."""
    return BenchError(f"{path} is damaged; remove it and simulate anew.")


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
