"""Result files of simulations: arrays without pickle, compressed by nothing, and JSON that says what they are.

about            JSON: kind and format of the file, version of the framework, plan, plugins, names of statuses, wall
                 time, why a step failed, files beside, doublings of the spacing of states
steps            one row an accepted step, see ``trajectory.STEP``
switches         one row a switching point, see ``trajectory.SWITCH``
state_…          states, from the last of which the simulation goes on, see ``thinning``
closed, sticking keys of the contacts that are so after the last step, where the stepper looks at them

Every write replaces the whole file, so whatever happens, the last complete one is there.
"""

import json
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.catalog.archive import ArchiveError, read_arrays
from ...problems.catalog.atomic_file import replacing
from ...problems.errors import ProxbenchError
from ...problems.stepping.contact_states import LawStates
from ...solvers.interface import Solver
from ..errors import BenchError
from ..measure.plugins import check_again, sources
from ..store.records import content_of, plugin_uses
from .beside import beside_from
from .failure import failure_from
from .plan import SimulationPlan, make_simulation_plan
from .thinning import kept_arrays, restore_kept
from .trajectory import LAW_STATES, LAWS, STEP, SWITCH, Simulation

SUFFIX = ".npz"

ABOUT = "about"
"""The name of the JSON among the arrays."""

KIND = "proxbench simulation"
"""What a file says it is."""

FORMAT = 4
"""Version of the content."""

_UNREADABLE = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError)
"""What content that Proxbench did not write may raise where it is read."""


def write_simulation(simulation: Simulation, path: Path) -> None:
    """Write ``simulation`` as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written.
    """
    simulation.thinning.offer(simulation.state)  # an interruption may have come between a step and this
    plan = simulation.plan
    about = {
        "kind": KIND,
        "format": FORMAT,
        "version": metadata.version("proxbench"),
        "plan": simulation.plan.document(),
        "plugins": [content_of(use) for use in sources([plan.solver.name], [], [plan.scene.name])],
        "statuses": list(simulation.statuses),
        "wall_seconds": simulation.wall_seconds,
        "failure": None if simulation.failure is None else simulation.failure.document(),
        "beside": simulation.beside.document(path),
        "doublings": simulation.thinning.doublings,
    }
    states = simulation.law_states or LawStates()
    arrays = {
        ABOUT: np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), dtype=np.uint8),
        "steps": simulation.steps,
        "switches": simulation.switches,
        **kept_arrays(simulation.thinning),
        "closed": np.array(states.closed, dtype=np.int64),
        "sticking": np.array(states.sticking, dtype=np.int64),
    }
    try:
        with replacing(path) as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
    except OSError as error:
        raise BenchError(f"cannot write {path}: {error.strerror}; choose another --output.") from None


def read_simulation(path: Path, solver: Solver | None = None) -> Simulation:
    """Read a result file.

    Args:
        path: the file.
        solver: the solver of the plan, if ``create`` does not know it by its name.

    Raises:
        BenchError: if the file is missing, damaged, of another format, or no result file of a simulation.
    """
    content = _stored_arrays(path)
    about = _about(content, path)
    try:
        check_again(plugin_uses(about["plugins"]))
        simulation = Simulation(
            _plan(about["plan"], solver), tuple(about["statuses"]), float(about["wall_seconds"]), path
        )
        simulation.failure = failure_from(about["failure"])
        simulation.beside = beside_from(about["beside"], path)
        steps, switches = _rows(content, len(simulation.statuses))
        restore_kept(simulation.thinning, content, int(about["doublings"]), steps["time"])
        simulation.restore(steps, simulation.states[-1], switches, _law_states(content))
    except ProxbenchError as error:
        raise BenchError(f"cannot go on from {path}: {error.sentence}") from None
    except _UNREADABLE:
        raise _damaged(path) from None
    return simulation


def _plan(stored: Mapping[str, Any], solver: Solver | None) -> SimulationPlan:
    if solver is not None and solver.name != stored["solver"]:
        raise BenchError(f"it was simulated with {stored['solver']}, not with {solver.name}.")
    return make_simulation_plan(**{**stored, "solver": solver or stored["solver"]})


def _rows(content: Mapping[str, NDArray[Any]], n_statuses: int) -> tuple[NDArray[np.void], NDArray[np.void]]:
    steps, switches = content["steps"], content["switches"]
    if steps.dtype != STEP or steps.ndim != 1 or (steps["status"] >= n_statuses).any():
        raise ValueError("these are no steps")
    if switches.dtype != SWITCH or switches.ndim != 1 or (switches["law"] >= len(LAWS)).any():
        raise ValueError("these are no switching points")
    if any((switches[name] >= len(LAW_STATES)).any() for name in ("before", "after")):
        raise ValueError("these are no states of laws")
    return steps, switches


def _law_states(content: Mapping[str, NDArray[Any]]) -> LawStates:
    closed, sticking = content["closed"], content["sticking"]
    if closed.dtype != np.int64 or sticking.dtype != np.int64 or closed.ndim != 1 or sticking.ndim != 1:
        raise ValueError("these are no contacts")
    return LawStates(tuple(closed.tolist()), tuple(sticking.tolist()))


def _stored_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of any .npz file; zip holds a checksum of each, which reading compares."""
    try:
        with path.open("rb") as file:
            if file.read(2) != b"PK":
                raise _foreign(path)
            file.seek(0)
            return read_arrays(file)
    except FileNotFoundError:
        raise BenchError(f"there is no result file {path}.") from None
    except IsADirectoryError:
        raise BenchError(f"{path} is a folder; name a result file in it, ending in {SUFFIX}.") from None
    except ArchiveError:
        raise _damaged(path) from None
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror or error}.") from None


def _about(content: Mapping[str, NDArray[Any]], path: Path) -> dict[str, Any]:
    """Return what a file says of itself, if it is of the kind and format that this version reads."""
    try:
        about = json.loads(content[ABOUT].tobytes().decode())
    except _UNREADABLE:
        about = None
    if not isinstance(about, dict) or not str(about.get("kind")).startswith(KIND):
        raise _foreign(path)
    if about["kind"] != KIND or about.get("format") != FORMAT:
        raise BenchError(f"{path} has format {about.get('format')}, this version reads format {FORMAT}; simulate anew.")
    return about


def _foreign(path: Path) -> BenchError:
    return BenchError(f"{path} is no result file of a simulation; name a file that proxbench simulate wrote.")


def _damaged(path: Path) -> BenchError:
    return BenchError(f"{path} is damaged; remove it and simulate anew.")
