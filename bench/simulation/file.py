"""Result files of simulations: uncompressed arrays without pickle, and JSON that describes them.

about            JSON: kind and format of the file, and the fields of ``SimulationRecord``
steps            one row per accepted step, see ``step_row.StepRow``
switches         one row per switching point, see ``simulation.SWITCH``
state_…          states, see ``kept_states``; a resumed simulation starts from the last one
closed, sticking keys of closed and of sticking contacts after the last step, if the stepper determines them

Every write replaces the file atomically, so that a complete file always exists.
"""

import json
import zipfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from ...problems.contact.solver import Solver
from ...problems.errors import ProxbenchError
from ...problems.exchange.files.archive import ArchiveError, read_arrays
from ...problems.exchange.files.atomic_file import replacing
from ...problems.motion.stepping.step import LawStates
from ..errors import BenchError
from ..plugins.files import check_plugins_unchanged, plugin_uses
from ..store.conversion import content_of, printable
from ..store.fields import Count, Number, Record
from ..store.records import PluginUse
from ..store.store import check_links_inside
from .history import Failure, Segment, check_segments
from .kept_states import kept_arrays, restore_kept
from .plan import PlanRecord, SimulationPlan, make_simulation_plan
from .simulation import LAW_STATES, LAWS, SWITCH, Simulation
from .step_row import step_columns
from .view.outputs import read_outputs

SUFFIX = ".npz"
"""Suffix of result files."""

ABOUT = "about"
"""The name of the JSON among the arrays."""

KIND = "proxbench simulation"
"""Kind of the file, stored in its description."""

FORMAT = 7
"""Version of the format."""

FORMAT_WITHOUT_OVERLAPS = 6
"""Older version of the format that can also be read; its steps lack the column ``overlap``."""

_READ_ERRORS = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError)
"""Exceptions that reading files of unknown origin may raise."""


class SimulationRecord(Record, frozen=True, kw_only=True):
    """The description of a simulation in its result file, in addition to kind and format.

    Attributes:
        version: version of Proxbench.
        plan: the plan.
        plugins: the plugins of the scene and of the solvers of all segments.
        segments: the settings of the steps.
        statuses: texts by the stored status of a step.
        wall_seconds: total wall time [s].
        failure: the failed step; None if no step failed.
        outputs: paths of chart and recording, relative to the folder of the file.
        doublings: number of doublings of the spacing of states, see ``kept_states``.
    """

    version: str
    plan: PlanRecord
    plugins: list[PluginUse]
    segments: list[Segment]
    statuses: list[str]
    wall_seconds: Number
    failure: Failure | None
    outputs: dict[str, str | None]
    doublings: Count


def write_simulation(simulation: Simulation, path: Path) -> None:
    """Write ``simulation`` to a file as a whole or not at all.

    Raises:
        BenchError: if the file cannot be written, or is a link that leaves its folder.
    """
    # an interruption may have occurred before the last step offered its state
    simulation.kept_states.offer(simulation.state)
    plan = simulation.plan
    solvers = dict.fromkeys([plan.solver.name, *(segment.solver for segment in simulation.segments)])
    record = SimulationRecord(
        version=metadata.version("proxbench"),
        plan=plan.record,
        plugins=plugin_uses(solvers, [], [plan.scene.name]),
        segments=list(simulation.segments),
        statuses=list(simulation.statuses),
        wall_seconds=simulation.wall_seconds,
        failure=simulation.failure,
        outputs=simulation.outputs.document(path),
        doublings=simulation.kept_states.doublings,
    )
    about = json.dumps({"kind": KIND, "format": FORMAT, **content_of(record)}, ensure_ascii=False)
    states = simulation.law_states or LawStates()
    arrays = {
        ABOUT: np.frombuffer(about.encode(), dtype=np.uint8),
        "steps": simulation.steps,
        "switches": simulation.switches,
        **kept_arrays(simulation.kept_states),
        "closed": np.array(states.closed, dtype=np.int64),
        "sticking": np.array(states.sticking, dtype=np.int64),
    }
    check_links_inside(path, path.parent)
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
        BenchError: if the file is missing, damaged, of another format, or not a result file of a simulation.
    """
    content = _stored_arrays(path)
    about = _about(content, path)
    try:
        record = msgspec.convert(printable(about), SimulationRecord)
        check_plugins_unchanged(record.plugins)
        simulation = Simulation(
            _plan(record.plan, solver),
            tuple(record.statuses),
            record.wall_seconds,
            path,
            record.failure,
            read_outputs(record.outputs, path),
        )
        if about["format"] == FORMAT_WITHOUT_OVERLAPS:
            content["steps"] = _with_unknown_overlaps(content["steps"], step_columns(simulation.plan.scene))
        _check_arrays(content, simulation)
        restore_kept(simulation.kept_states, content, record.doublings, content["steps"]["time"])
        states = LawStates(tuple(content["closed"].tolist()), tuple(content["sticking"].tolist()))
        check_segments(record.segments, len(content["steps"]))
        simulation.restore(content["steps"], simulation.states[-1], content["switches"], states, record.segments)
    except ProxbenchError as error:
        raise BenchError(f"cannot read {path}: {error}") from None
    except _READ_ERRORS:
        raise _damaged_file_error(path) from None
    return simulation


def is_result(path: Path) -> bool:
    """Return whether a .npz file contains a simulation rather than a problem, by the names of its arrays.

    Raises:
        BenchError: if the file is missing or damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            return "steps.npy" in archive.namelist()
    except FileNotFoundError:
        raise BenchError(f"there is no file {path}.") from None
    except (OSError, *_READ_ERRORS, zipfile.BadZipFile):
        raise BenchError(f"{path} is damaged: it holds neither a simulation nor a problem.") from None


def _plan(stored: PlanRecord, solver: Solver | None) -> SimulationPlan:
    """Return a stored plan; raise ``BenchError`` if ``solver`` is not its solver."""
    if solver is not None and solver.name != stored.solver:
        raise BenchError(f"it was simulated with {stored.solver}, not with {solver.name}.")
    return make_simulation_plan(**{**msgspec.structs.asdict(stored), "solver": solver or stored.solver})


def _with_unknown_overlaps(steps: NDArray[Any], columns: np.dtype[np.void]) -> NDArray[Any]:
    """Return steps with the column ``overlap``, all NaN; steps of other columns are returned unchanged."""
    if steps.dtype != [(name, columns[name]) for name in columns.names or () if name != "overlap"]:
        return steps
    extended_steps = np.zeros(len(steps), dtype=columns)
    extended_steps["overlap"] = np.nan
    for name in steps.dtype.names or ():
        extended_steps[name] = steps[name]
    return extended_steps


def _check_arrays(content: Mapping[str, NDArray[Any]], simulation: Simulation) -> None:
    """Raise ``ValueError`` if an array has the wrong shape or type, or an index in it is out of range."""
    steps = step_columns(simulation.plan.scene)
    for name, dtype in {"steps": steps, "switches": SWITCH, "closed": np.int64, "sticking": np.int64}.items():
        if content[name].dtype != dtype or content[name].ndim != 1:
            raise ValueError(f"{name} have the wrong shape or type")
    limits = {"status": len(simulation.statuses), "law": len(LAWS), "before": len(LAW_STATES), "after": len(LAW_STATES)}
    for name, limit in limits.items():
        if (content["steps" if name == "status" else "switches"][name] >= limit).any():
            raise ValueError(f"an index of {name} is out of range")


def _stored_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of any .npz file; reading verifies the checksum of each."""
    try:
        with path.open("rb") as file:
            if file.read(2) != b"PK":
                raise _foreign_file_error(path)
            file.seek(0)
            return read_arrays(file)
    except FileNotFoundError:
        raise BenchError(f"there is no result file {path}.") from None
    except IsADirectoryError:
        raise BenchError(f"{path} is a folder; name a result file in it, ending in {SUFFIX}.") from None
    except ArchiveError:
        raise _damaged_file_error(path) from None
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror or error}.") from None


def _about(content: Mapping[str, NDArray[Any]], path: Path) -> dict[str, Any]:
    """Return the description in a file; raise ``BenchError`` if this version cannot read its kind or format."""
    try:
        about = json.loads(content[ABOUT].tobytes().decode())
    except _READ_ERRORS:
        about = None
    if not isinstance(about, dict) or not str(about.get("kind")).startswith(KIND):
        raise _foreign_file_error(path)
    if about["kind"] != KIND or about.get("format") not in (FORMAT_WITHOUT_OVERLAPS, FORMAT):
        raise BenchError(
            f"{path} has format {about.get('format')}, this version reads formats {FORMAT_WITHOUT_OVERLAPS} "
            f"and {FORMAT}; simulate again."
        )
    return about


def _foreign_file_error(path: Path) -> BenchError:
    return BenchError(f"{path} is not a result file of a simulation; name a file that proxbench simulate wrote.")


def _damaged_file_error(path: Path) -> BenchError:
    return BenchError(f"{path} is damaged; remove it and simulate again.")
